"use strict";
(() => {
  // The value under the pointer, by the axes of the panel below it.
  const hint = document.createElement("div");
  hint.className = "hint";
  hint.hidden = true;
  document.body.append(hint);
  const between = (share, low, high, log) => log ? low * (high / low) ** share : low + (high - low) * share;
  const rounded = (value) => String(Number(value.toPrecision(4)));
  for (const svg of document.querySelectorAll("svg[data-axes]")) {
    const panels = JSON.parse(svg.dataset.axes);
    svg.addEventListener("pointermove", (event) => {
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const panel = panels.find(([left, top, right, bottom]) => point.x >= left && point.x <= right && point.y >= top && point.y <= bottom);
      hint.hidden = !panel;
      if (!panel) { return; }
      const [left, top, right, bottom, xLow, xHigh, yLow, yHigh, xLog, yLog, xLabel, yLabel] = panel;
      const x = between((point.x - left) / (right - left), xLow, xHigh, xLog);
      const y = between((bottom - point.y) / (bottom - top), yLow, yHigh, yLog);
      hint.textContent = `${xLabel} ${rounded(x)}, ${yLabel} ${rounded(y)}`;
      hint.style.left = `${Math.min(event.clientX + 12, innerWidth - hint.offsetWidth - 4)}px`;
      hint.style.top = `${event.clientY + 14}px`;
    });
    svg.addEventListener("pointerleave", () => { hint.hidden = true; });
  }
  // Tables that are sorted by the heading that is clicked, and show the rows that hold what is typed; as cards on a narrow screen.
  for (const table of document.querySelectorAll("table.sorted")) {
    const filter = document.createElement("label");
    const typed = document.createElement("input");
    const count = document.createElement("output");
    filter.className = "controls";
    typed.type = "search";
    filter.append("Show rows with", typed, count);
    table.parentElement.before(filter);
    typed.addEventListener("input", () => {
      const words = typed.value.toLowerCase().split(/\s+/);
      const rows = [...table.tBodies[0].rows];
      for (const row of rows) { row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word)); }
      count.textContent = `${rows.filter((row) => !row.hidden).length} of ${rows.length}`;
    });
    table.classList.add("cards");
    [...table.tHead.rows[0].cells].forEach((cell, column) => {
      for (const row of table.tBodies[0].rows) { if (column) { row.cells[column].dataset.head = cell.textContent; } }
      const button = document.createElement("button");
      button.type = "button";
      button.append(...cell.childNodes);
      cell.append(button);
      button.addEventListener("click", () => {
        const up = cell.getAttribute("aria-sort") !== "ascending";
        for (const other of table.tHead.rows[0].cells) { other.removeAttribute("aria-sort"); }
        cell.setAttribute("aria-sort", up ? "ascending" : "descending");
        const key = (row) => { const text = row.cells[column].textContent.trim(); return text === "" || isNaN(Number(text)) ? text : Number(text); };
        const order = (a, b) => typeof a === typeof b ? (a < b ? -1 : a > b ? 1 : 0) : typeof a === "number" ? -1 : 1;
        const rows = [...table.tBodies[0].rows].sort((a, b) => (up ? 1 : -1) * order(key(a), key(b)));
        table.tBodies[0].append(...rows);
      });
    });
  }
})();
