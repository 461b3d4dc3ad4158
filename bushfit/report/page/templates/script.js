"use strict";
(() => {
  // Values under the pointer: the nearest point of the picture, back from pixels by the axes that it states.
  const hint = document.createElement("div");
  hint.className = "hint";
  hint.hidden = true;
  document.body.append(hint);
  const back = (axis, pixel) => {
    const [low, high, first, last] = axis.split(" ").map(Number);
    const share = (pixel - first) / (last - first);
    return axis.endsWith("log") ? low * (high / low) ** share : low + (high - low) * share;
  };
  const shown = (value) => String(Number(value.toPrecision(4)));
  const points = (path) => [...path.getAttribute("d").matchAll(/(-?[\d.]+) (-?[\d.]+)/g)].map((pair) => [Number(pair[1]), Number(pair[2])]);
  for (const svg of document.querySelectorAll("svg[data-x]")) {
    let known;
    svg.addEventListener("pointermove", (event) => {
      known ??= [...svg.querySelectorAll("g[data-series]")].flatMap((group) =>
        [...group.querySelectorAll("path[data-of]")].flatMap((path) => points(path).map(([x, y]) => ({ x, y, group, of: path.dataset.of }))));
      const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      let best = null, least = 18;
      for (const point of known) {
        const distance = Math.hypot(point.x - place.x, point.y - place.y);
        if (distance < least && point.group.getAttribute("display") !== "none") { least = distance; best = point; }
      }
      hint.hidden = best === null;
      if (best === null) { return; }
      const series = best.group.dataset.series;
      const y = back(svg.dataset.y, best.y), angle = svg.dataset.angles ? ` (${shown(Math.atan(y) * 180 / Math.PI)} deg)` : "";
      hint.textContent = `${series ? series + ", " : ""}${best.of}: ${shown(back(svg.dataset.x, best.x))}, ${shown(y)}${angle}`;
      hint.style.left = `${Math.min(event.clientX + 14, innerWidth - hint.offsetWidth - 8)}px`;
      hint.style.top = `${event.clientY + 16}px`;
    });
    svg.addEventListener("pointerleave", () => { hint.hidden = true; });
  }
  // Switches: which levels of a panel, which direction of the page.
  const controls = (label, names, turned) => {
    const row = document.createElement("div");
    row.className = "controls";
    row.setAttribute("role", "group");
    row.setAttribute("aria-label", label);
    for (const name of names) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.setAttribute("aria-pressed", "true");
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(on));
        turned(name, on);
      });
      row.append(button);
    }
    return row;
  };
  for (const panel of document.querySelectorAll(".panel")) {
    const groups = [...panel.querySelectorAll("g[data-series]")];
    const names = [...new Set(groups.map((group) => group.dataset.series))].filter(Boolean);
    if (names.length < 2) { continue; }
    panel.prepend(controls("Shown", names, (name, on) => {
      for (const group of groups.filter((each) => each.dataset.series === name)) { group.setAttribute("display", on ? "inline" : "none"); }
    }));
  }
  for (const section of document.querySelectorAll("#predicted, #amplitude, #colecole, #loops, #gap")) {
    const panels = [...section.querySelectorAll("[data-place]")];
    const names = [...new Set(panels.map((panel) => panel.dataset.place))];
    if (names.length < 2) { continue; }
    section.querySelector("h2").after(controls("Directions", names, (name, on) => {
      for (const panel of panels.filter((each) => each.dataset.place === name)) { panel.hidden = !on; }
    }));
  }
  // Tables that are sorted by the heading that is clicked, and show the rows that hold what is typed; as cards on a narrow screen.
  for (const table of document.querySelectorAll("table.sorted")) {
    const filter = document.createElement("label");
    const typed = document.createElement("input");
    const count = document.createElement("output");
    filter.className = "controls";
    typed.type = "search";
    filter.append("Rows with", typed, count);
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
