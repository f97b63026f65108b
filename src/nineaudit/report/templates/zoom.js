"use strict";
(() => {
  const NONE = -32768;
  const supported = typeof DecompressionStream === "function" && typeof uPlot === "function";

  const inflated = async (key) => {
    const text = document.getElementById(key).content.textContent;
    const raw = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };

  // bytes by rank, differences, codes: value = middle + code * step
  const values = async ({ key, size, middle, step }) => {
    const bytes = await inflated(key);
    const n = bytes.length / size, shift = 32 - 8 * size, out = new Array(n);
    let code = 0;
    for (let i = 0; i < n; i++) {
      let difference = 0;
      for (let rank = 0; rank < size; rank++) difference |= bytes[rank * n + i] << (8 * rank);
      code = ((code + difference) << shift) >> shift;
      out[i] = size === 2 && code === NONE ? null : middle + code * step;
    }
    return out;
  };

  const number = (v) => (v == null ? "–" : String(Number(v.toPrecision(4))).replace("-", "−"));
  const made = (tag, className, text = "") => {
    const node = document.createElement(tag);
    node.className = className;
    node.textContent = text;
    return node;
  };
  const painted = (plot, selector, property) => {
    const node = plot.querySelector(selector);
    return node ? getComputedStyle(node)[property] : "transparent";
  };

  const open = async (plot, told) => {
    const time = (await values(told.time)).map((t) => (t - told.time.origin) / told.time.one);
    const data = [time], series = [{}], bands = [];
    const ink = () => getComputedStyle(plot.closest("figure").querySelector("figcaption")).color;
    for (const { upper, lower } of told.bands) {
      const fill = () => painted(plot, "svg.chart .band", "fill");
      data.push(await values(upper), await values(lower));
      bands.push({ series: [series.length, series.length + 1], fill });
      for (const label of ["upper", "lower"]) series.push({ label, width: 0, auto: false, points: { show: false } });
    }
    for (const line of told.lines) {
      const path = `svg.chart path.line.${line.style.split(" ").join(".")}`;
      data.push(await values(line));
      const width = parseFloat(painted(plot, path, "strokeWidth")) || 1.5;
      const dash = (painted(plot, path, "strokeDasharray").match(/[\d.]+/g) || []).map((d) => d * devicePixelRatio);
      series.push({
        label: line.label, width, dash, stroke: () => painted(plot, path, "stroke"),
        points: { size: 4, space: 8 }, says: line.label ? `${line.label} ` : "",
      });
    }
    if (told.flags.length) {
      const at = data[data.length - 1], marked = new Array(time.length).fill(null);
      for (const [first, last] of told.flags) for (let i = first; i <= last; i++) marked[i] = at[i];
      const red = () => painted(plot, "svg.chart path.flag", "stroke");
      data.push(marked);
      series.push({ label: "flagged", width: 0, paths: () => null, points: { show: true, size: 6, fill: red, stroke: red } });
    }
    const box = made("div", "zoomed"), bar = made("div", "zoom-bar"), area = made("div", "zoom-area");
    const said = made("p", "zoom-said");
    said.setAttribute("role", "status");
    area.setAttribute("role", "img");
    area.setAttribute("aria-label", `${told.title}, to be zoomed`);
    box.append(bar, area, said);
    plot.append(box);
    plot.classList.add("is-zoomed");

    const first = time[0], last = time[time.length - 1];
    const shade = (u) => {
      u.ctx.fillStyle = painted(plot, "svg.chart .span", "fill");
      for (const [a, b] of told.shaded) {
        const x = u.valToPos(time[a], "x", true);
        u.ctx.fillRect(x, u.bbox.top, Math.max(u.valToPos(time[b], "x", true) - x, 2), u.bbox.height);
      }
    };
    const levels = (u) => {
      u.ctx.save();
      u.ctx.strokeStyle = ink();
      u.ctx.setLineDash([5, 4]);
      for (const level of told.levels) {
        const y = u.valToPos(level, "y", true);
        if (y < u.bbox.top || y > u.bbox.top + u.bbox.height) continue;
        u.ctx.beginPath();
        u.ctx.moveTo(u.bbox.left, y);
        u.ctx.lineTo(u.bbox.left + u.bbox.width, y);
        u.ctx.stroke();
      }
      u.ctx.restore();
    };
    const axis = {
      stroke: ink, font: "12px sans-serif",
      grid: { stroke: () => painted(plot, "svg.chart .grid", "stroke"), width: 1 },
      ticks: { show: false },
    };
    const height = Math.max(told.height, 180) + 30;
    const u = new uPlot({
      width: area.clientWidth, height, series, bands, pxAlign: 0,
      legend: { show: false },
      scales: { x: { time: false } },
      axes: [{ ...axis, size: 30 }, { ...axis, size: 60 }],
      cursor: {
        drag: { x: true, y: false },
        bind: { mousedown: (_, __, handler) => (event) => { if (!event.shiftKey) handler(event); return null; } },
      },
      hooks: {
        drawClear: [shade],
        draw: [levels],
        setScale: [(self, key) => { if (key === "x") say(self); }],
        setCursor: [(self) => say(self)],
      },
    }, data, area);

    function say(self) {
      const i = self.cursor.idx, { min, max } = self.scales.x;
      if (i == null) {
        said.textContent = `shown: ${number(min)} to ${number(max)}; ${told.time.label}`;
        return;
      }
      const each = self.series.flatMap((s, k) => (s.says === undefined ? [] : [`${s.says}${number(self.data[k][i])} ${told.unit}`]));
      said.textContent = `${number(time[i])} (${told.time.label}): ${each.join(", ")}`;
    }
    const show = (min, max) => {
      const width = Math.min(max - min, last - first), start = Math.min(Math.max(min, first), last - width);
      u.setScale("x", { min: start, max: start + width });
    };
    const scaled = (factor, by = 0) => {
      const { min, max } = u.scales.x, middle = (min + max) / 2 + by * (max - min), half = (factor * (max - min)) / 2;
      show(middle - half, middle + half);
    };
    const close = () => {
      watcher.disconnect();
      scheme.removeEventListener("change", again);
      u.destroy();
      box.remove();
      plot.classList.remove("is-zoomed");
      delete plot.dataset.opened;
      plot.querySelector(".zoom-open").focus({ preventScroll: true });
    };
    const again = () => u.redraw(false);
    const scheme = matchMedia("(prefers-color-scheme: dark)");
    scheme.addEventListener("change", again);
    const watcher = new ResizeObserver(() => { if (area.clientWidth) u.setSize({ width: area.clientWidth, height }); });
    watcher.observe(area);
    u.over.addEventListener("mousedown", (event) => {
      if (!event.shiftKey) return;
      const from = event.clientX, { min, max } = u.scales.x, one = (max - min) / u.over.clientWidth;
      const move = (e) => show(min - (e.clientX - from) * one, max - (e.clientX - from) * one);
      const stop = () => { removeEventListener("mousemove", move); removeEventListener("mouseup", stop); };
      addEventListener("mousemove", move);
      addEventListener("mouseup", stop);
      event.preventDefault();
    });
    const actions = [
      ["Zoom in", () => scaled(0.5)], ["Zoom out", () => scaled(2)], ["Earlier", () => scaled(1, -0.5)],
      ["Later", () => scaled(1, 0.5)], ["Whole record", () => show(first, last)], ["Close", close],
    ];
    for (const [name, act] of actions) {
      const button = made("button", "", name);
      button.type = "button";
      button.addEventListener("click", act);
      bar.append(button);
    }
    bar.append(made("span", "zoom-help", "Drag to zoom, shift and drag to pan, double click for the whole record."));
    say(u);
    bar.firstChild.focus({ preventScroll: true });
  };

  if (supported) {
    for (const plot of document.querySelectorAll("[data-plot]")) {
      const told = JSON.parse(plot.dataset.plot);
      const start = () => {
        if (plot.dataset.opened) return;
        plot.dataset.opened = "yes";
        open(plot, told);
      };
      const button = made("button", "zoom-open", "Zoom");
      const more = made("span", "sr", ` into ${told.title}`);
      button.type = "button";
      button.append(more);
      button.addEventListener("click", start);
      plot.querySelector("svg.chart").addEventListener("click", start);
      plot.prepend(button);
      plot.classList.add("can-zoom");
    }
  }
})();
