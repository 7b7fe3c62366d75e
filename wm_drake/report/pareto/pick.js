"use strict";
{
  const given = JSON.parse(document.getElementById("designs").textContent);
  const marks = [...document.querySelectorAll("#plot circle")];
  const drawing = document.getElementById("envelopes");
  let picked = given.picked;

  function add(parent, kind, attributes, text = "") {
    const element = document.createElementNS("http://www.w3.org/2000/svg", kind);
    Object.entries(attributes).forEach(([name, value]) => element.setAttribute(name, value));
    element.textContent = text;
    parent.append(element);
    return element;
  }

  /* Panels of the envelopes, three in a row, with one common scale. */
  const columns = Math.min(3, given.sensors.length), rows = Math.ceil(given.sensors.length / columns);
  const left = 46, between = 24, top = 24, panelHeight = 150, rowHeight = panelHeight + 62;
  const width = (900 - left - 8 - (columns - 1) * between) / columns;
  const duration = given.time[0] + given.time[given.time.length - 1];
  /* A step of 1, 2 or 5 times a power of ten that divides a length into up to five parts. */
  const stepOf = length => {
    const power = 10 ** Math.floor(Math.log10(length / 5));
    return power * [1, 2, 5, 10].find(factor => factor * power * 5 >= length);
  };
  const text = value => String(Number(value.toPrecision(6)));
  const step = stepOf(given.largest), second = stepOf(duration), highest = step * Math.ceil(given.largest / step);
  drawing.setAttribute("viewBox", `0 0 900 ${rows * rowHeight}`);
  const panels = given.sensors.map((sensor, i) => {
    const x = left + (i % columns) * (width + between), y = top + Math.floor(i / columns) * rowHeight;
    const at = (time, size) => [x + width * time / duration, y + panelHeight * (1 - size / highest)];
    for (let size = 0; size <= highest * 1.001; size += step) {
      const [, height] = at(0, size);
      add(drawing, "line", { x1: x, x2: x + width, y1: height, y2: height, stroke: "#e2e5ea" });
      if (i % columns === 0) add(drawing, "text", { x: x - 6, y: height + 4, "font-size": 12, "text-anchor": "end" }, text(size));
    }
    for (let time = 0; time <= duration * 1.001; time += second) {
      const [across] = at(time, 0);
      const anchor = time === 0 ? "start" : across > x + width - 10 ? "end" : "middle";
      add(drawing, "text", { x: across, y: y + panelHeight + 16, "font-size": 12, "text-anchor": anchor }, text(time));
    }
    add(drawing, "text", { x: x, y: y - 8, "font-size": 13 }, `${sensor}, mm`);
    add(drawing, "text", { x: x + width / 2, y: y + panelHeight + 33, "font-size": 12, "text-anchor": "middle" }, "time, s");
    const path = values => values.map((size, k) => size === null ? "" : (k && values[k - 1] !== null ? "L" : "M") + at(given.time[k], size).map(v => v.toFixed(1)).join(" ")).join("");
    add(drawing, "path", { d: path(given.nominal[i]), fill: "none", stroke: "#6b7280", "stroke-width": 1.2 });
    const own = add(drawing, "path", { fill: "none", stroke: "#b34700", "stroke-width": 1.6 });
    return values => own.setAttribute("d", path(values));
  });

  function pick(number) {
    picked = Math.max(0, Math.min(given.rows.length - 1, number));
    marks.forEach((mark, i) => mark.setAttribute("fill", i === picked ? "#b34700" : "#0072b2"));
    document.getElementById("picked-title").textContent = "Design " + (picked + 1);
    const body = document.querySelector("#picked tbody");
    body.replaceChildren(...given.rows[picked].map(cells => {
      const row = document.createElement("tr");
      cells.forEach(text => { const cell = document.createElement("td"); cell.textContent = text; row.append(cell); });
      return row;
    }));
    panels.forEach((draw, i) => draw(given.designs[picked][i]));
  }
  marks.forEach((mark, i) => mark.addEventListener("click", () => pick(i)));
  document.getElementById("plot").addEventListener("keydown", event => {
    const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (step) { event.preventDefault(); pick(picked + step); }
  });
  pick(picked);
}
