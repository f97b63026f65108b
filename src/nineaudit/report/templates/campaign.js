"use strict";
(() => {
  const table = document.querySelector("#recordings table");
  const form = document.getElementById("filters");
  if (!table || !form) return;
  const body = table.tBodies[0], said = document.getElementById("shown");
  const rows = [...body.rows].map((row) => {
    const cells = [...row.cells].map((cell) => cell.textContent);
    return { row, cells, text: cells.join("\n").toLowerCase(), verdict: row.cells[4].className.split(" ")[0] };
  });
  const number = (text) => text.toLocaleString("en");

  const matches = ({ cells, text, verdict }, wanted) =>
    wanted.words.every((word) => text.includes(word)) &&
    (!wanted.verdict || verdict === wanted.verdict) &&
    (!wanted.rig || cells[3] === wanted.rig) &&
    (!wanted.fault || cells[6] === wanted.fault) &&
    (!wanted.since || (cells[2] && cells[2] >= wanted.since)) &&
    (!wanted.until || (cells[2] && cells[2] <= wanted.until));

  const filter = () => {
    const wanted = Object.fromEntries([...new FormData(form)].map(([name, value]) => [name, String(value)]));
    wanted.words = wanted.text.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const one of rows) {
      one.row.hidden = !matches(one, wanted);
      shown += !one.row.hidden;
    }
    said.textContent = `${number(shown)} of ${number(rows.length)} recordings shown`;
  };

  const heads = [...table.tHead.rows[0].cells];
  const key = (one, column) => {
    const value = one.row.cells[column].dataset.s;
    if (column === 7) return value ? Number(value) : -Infinity;
    return one.cells[column];
  };
  const collator = new Intl.Collator("en", { numeric: true });
  const compared = (a, b) => (typeof a === "number" ? a - b : collator.compare(a, b));
  const sort = (column) => {
    const head = heads[column], falling = head.ariaSort === "ascending" || (head.ariaSort !== "descending" && column === 7);
    for (const each of heads) each.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const sign = falling ? -1 : 1;
    const keyed = rows.map((one, place) => ({ one, place, key: key(one, column) }));
    keyed.sort((a, b) => sign * compared(a.key, b.key) || a.place - b.place);
    body.append(...keyed.map(({ one }) => one.row));
  };

  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    button.addEventListener("click", () => sort(column));
    head.append(button);
  });
  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(filter));
  form.hidden = false;
  filter();
})();
