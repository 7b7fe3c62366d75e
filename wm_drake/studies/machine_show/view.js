"use strict";
/* The machine in parallel projection: lines in space (m, x right, y to the rear, z up), which turn. */
const MachineView = (() => {
  const svg = document.getElementById("machine-view"), said = document.querySelector(".pointed");
  const things = JSON.parse(document.getElementById("things").textContent);
  const WIDE = 900, HIGH = 640;
  const make = (name, attributes, text) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text) element.textContent = text;
    return element;
  };
  const points = things.flatMap(thing => thing.lines.flat());
  const ends = [0, 1, 2].map(k => [Math.min(...points.map(p => p[k])), Math.max(...points.map(p => p[k]))]);
  const middle = ends.map(([low, high]) => 0.5 * (low + high));
  const reach = Math.max(0.05, ...points.map(p => Math.hypot(...p.map((value, k) => value - middle[k]))));
  const scale = 0.48 * HIGH / reach;
  const state = { turn: -0.55, tilt: 0.3 };

  /* Place of a point on the paper: turned about z, then tilted towards the eye. */
  function seen(point) {
    const [x, y, z] = point.map((value, k) => value - middle[k]);
    const right = Math.cos(state.turn) * x - Math.sin(state.turn) * y, away = Math.sin(state.turn) * x + Math.cos(state.turn) * y;
    return [0.5 * WIDE + scale * right, 0.5 * HIGH - scale * (Math.cos(state.tilt) * z + Math.sin(state.tilt) * away)];
  }

  const path = lines => lines.map(line => line.map((point, k) => `${k ? "L" : "M"}${seen(point).map(v => v.toFixed(1)).join(" ")}`).join("")).join("");

  const drawn = things.map(thing => {
    const group = make("g", { "data-name": thing.name });
    const line = make("path", { class: thing.kind, d: "" }), wide = make("path", { class: "hit", d: "" });
    const label = thing.label ? make("text", {}, thing.label) : null;
    group.append(make("title", {}, thing.words), line, wide, ...(label ? [label] : []));
    group.addEventListener("pointerenter", () => { said.textContent = thing.words; line.classList.add("pointed-at"); });
    group.addEventListener("pointerleave", () => line.classList.remove("pointed-at"));
    svg.append(group);
    return { thing, line, wide, label };
  });

  const LINE = 15, CHARACTER = 7.5; // height and width of a label's text [px]

  /* The nearest place below that no other label takes. */
  function free(place, width, taken) {
    const meets = other => Math.abs(other.y - place.y) < LINE && place.x < other.x + other.width && other.x < place.x + width;
    while (taken.some(meets)) place.y += 1;
    taken.push({ ...place, width });
    return place;
  }

  function draw() {
    const taken = [];
    for (const { thing, line, wide, label } of drawn) {
      const d = path(thing.lines);
      line.setAttribute("d", d);
      wide.setAttribute("d", thing.kind === "housing" ? "" : d);
      if (!label) continue;
      const [right, down] = seen(thing.lines[0][thing.lines[0].length - 1]);
      const { x, y } = free({ x: right + 5, y: down - 5 }, CHARACTER * thing.label.length, taken);
      label.setAttribute("x", x); label.setAttribute("y", y);
    }
  }

  let last = null;
  svg.addEventListener("pointerdown", event => { last = [event.clientX, event.clientY]; svg.setPointerCapture(event.pointerId); });
  svg.addEventListener("pointerup", () => { last = null; });
  svg.addEventListener("pointermove", event => {
    if (!last) return;
    state.turn += 0.01 * (event.clientX - last[0]);
    state.tilt = Math.min(1.57, Math.max(-1.57, state.tilt + 0.01 * (event.clientY - last[1])));
    last = [event.clientX, event.clientY];
    draw();
  });
  document.querySelectorAll(".views button").forEach(button => button.addEventListener("click", () => {
    state.turn = Number(button.dataset.turn); state.tilt = Number(button.dataset.tilt);
    draw();
  }));
  draw();
  return { state, draw, seen, things };
})();
