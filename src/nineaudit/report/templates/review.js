"use strict";
(() => {
  const form = document.getElementById("review-form");
  if (!form) return;
  const button = document.getElementById("review-export"), said = document.getElementById("review-said");
  const about = JSON.parse(form.dataset.about);
  button.hidden = false;
  form.addEventListener("submit", (event) => event.preventDefault());
  button.addEventListener("click", () => {
    const review = Object.fromEntries([...new FormData(form)].map(([name, value]) => [name, String(value)]));
    const text = JSON.stringify({ schema: "nineaudit/review/1", ...about, review }, null, 2) + "\n";
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
    link.download = `review-${about.report}.json`;
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    said.textContent = `Saved as ${link.download}.`;
  });
})();
