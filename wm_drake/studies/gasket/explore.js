"use strict";
/* Explores the fitted models of a gasket study: profiler, interactions, contours.

   The model is that of studies/gasket/surface.py: sum-coded parabolas of each factor and their
   products, at places from -1 to 1 of the factors. */
const Explore = (() => {
  const box = document.getElementById("explore");
  const data = JSON.parse(document.getElementById("models").textContent);
  const SVG = "http://www.w3.org/2000/svg", STEPS = 24, HUES = ["#0072b2", "#6b7280", "#b34700"];
  const { factors, responses, loads } = data;
  const middle = factors.map(() => 0);
  const state = { places: data.proposed ? data.proposed.slice() : middle.slice(), load: loads[0], response: responses[0].name, x: 0, y: Math.min(1, factors.length - 1) };
  const unpacked = new Map();

  function numbers(packed) {
    if (!unpacked.has(packed)) {
      const bytes = Uint8Array.from(atob(packed.bdata), c => c.charCodeAt(0));
      unpacked.set(packed, new Float32Array(bytes.buffer));
    }
    return unpacked.get(packed);
  }

  // ---- the model -------------------------------------------------------------------------------
  /* Row of the model at places; a place null means the mean over a factor, whose codes average to 0. */
  function row(places) {
    const codes = places.map(x => x === null ? [0, 0] : [-x, 1 - 0.5 * x - 1.5 * x * x]);
    const found = [1, ...codes.flat()];
    if (data.interactions)
      for (let i = 0; i < codes.length; i++)
        for (let j = i + 1; j < codes.length; j++)
          for (const u of codes[i]) for (const v of codes[j]) found.push(u * v);
    return found;
  }

  const dot = (a, b) => { let sum = 0; for (let i = 0; i < a.length; i++) sum += a[i] * b[i]; return sum; };
  const fitted = (load, name, of) => dot(of, numbers(data.models[load][name].coefficients));
  const predict = (load, name, places) => fitted(load, name, row(places));

  function leverage(load, of) {
    const inverse = numbers(data.inverses[data.inverse_of[load]]), p = of.length;
    let sum = 0;
    for (let i = 0; i < p; i++) {
      let inner = 0;
      for (let j = 0; j < p; j++) inner += inverse[i * p + j] * of[j];
      sum += of[i] * inner;
    }
    return Math.max(0, sum);
  }

  const halfWidth = (load, name, h) => (data.models[load][name].spread ?? NaN) * Math.sqrt(1 + h);

  // ---- values of factors -----------------------------------------------------------------------
  function valueAt(factor, place) {
    const [low, middle, high] = factor.numbers;
    return place < 0 ? middle + (middle - low) * place : middle + (high - middle) * place;
  }
  function placeOf(factor, value) {
    const [low, middle, high] = factor.numbers;
    const place = value < middle ? (value - middle) / (middle - low) : (value - middle) / (high - middle);
    return Math.min(1, Math.max(-1, place));
  }
  const short = Pictures.short;

  // ---- elements --------------------------------------------------------------------------------
  function make(tag, attributes = {}, ...children) {
    const node = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
      else if (value !== null) node.setAttribute(name, value);
    }
    node.append(...children);
    return node;
  }
  function draw(tag, attributes) {
    const node = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    return node;
  }
  function choice(label, options, chosen, change) {
    const select = make("select", { onchange: () => change(select.value) },
      ...options.map(([value, text]) => make("option", { value }, text)));
    select.value = chosen;
    return make("label", {}, `${label} `, select);
  }

  // ---- profiler --------------------------------------------------------------------------------
  const cells = new Map(), sliders = [];

  function profiler() {
    const grid = box.querySelector(".profiler");
    grid.style.setProperty("--factors", factors.length);
    grid.append(make("div", { class: "corner" }));
    factors.forEach((factor, k) => {
      const number = make("input", { type: "number", step: "any", "aria-label": `${factor.title}, ${factor.unit}` });
      number.addEventListener("change", () => { if (number.value !== "") move(k, placeOf(factor, Number(number.value))); });
      const slider = make("input", { type: "range", min: -1, max: 1, step: 0.02, "aria-label": factor.title, id: `factor-${k}` });
      slider.addEventListener("input", () => move(k, Number(slider.value)));
      sliders.push({ number, slider });
      grid.append(make("div", { class: "factor" }, make("b", { title: factor.title }, factor.name), number, make("small", {}, factor.unit || "\u00a0"), slider));
    });
    for (const response of responses) {
      const words = make("div", { class: "response" }, make("b", { title: response.title }, `${response.name}, ${response.unit}`), make("output"), make("small"));
      grid.append(words);
      const plots = factors.map((factor, k) => {
        const svg = draw("svg", { viewBox: "0 0 100 60", preserveAspectRatio: "none", role: "img" });
        svg.setAttribute("aria-label", `${response.name} over ${factor.name}`);
        const parts = { band: draw("path", { class: "band" }), line: draw("path", { class: "line" }), at: draw("path", { class: "at" }) };
        svg.append(parts.band, parts.line, parts.at);
        svg.addEventListener("click", event => {
          const frame = svg.getBoundingClientRect();
          move(k, Math.min(1, Math.max(-1, 2 * (event.clientX - frame.left) / frame.width - 1)));
        });
        grid.append(svg);
        return parts;
      });
      cells.set(response.name, { words, plots });
    }
  }

  function move(k, place) {
    state.places[k] = place;
    update();
  }

  function set(places) {
    state.places = places.slice();
    update();
  }

  /* Rows of the model and their leverages along each factor; all responses share them. */
  function traces() {
    return factors.map((_, k) => {
      const found = [];
      for (let i = 0; i <= STEPS; i++) {
        const places = state.places.slice();
        places[k] = -1 + 2 * i / STEPS;
        const of = row(places);
        found.push({ of, h: leverage(state.load, of) });
      }
      return found;
    });
  }

  function updateProfiler() {
    sliders.forEach(({ number, slider }, k) => {
      slider.value = state.places[k];
      if (document.activeElement !== number) number.value = Number(valueAt(factors[k], state.places[k]).toPrecision(4));
    });
    const along = traces(), here = row(state.places), h = leverage(state.load, here);
    for (const response of responses) {
      const { words, plots } = cells.get(response.name), name = response.name;
      const value = fitted(state.load, name, here), half = halfWidth(state.load, name, h);
      words.querySelector("output").textContent = short(value);
      words.querySelector("small").textContent = Number.isFinite(half) ? `\u00b1 ${short(Number(half.toPrecision(2)))}` : "";
      const curves = along.map(points => points.map(({ of, h: own }) => {
        const middle = fitted(state.load, name, of), width = halfWidth(state.load, name, own);
        return { middle, width: Number.isFinite(width) ? width : 0 };
      }));
      const low = Math.min(...curves.flat().map(p => p.middle - p.width)), high = Math.max(...curves.flat().map(p => p.middle + p.width));
      const y = v => (57 - 54 * (v - low) / (high - low || 1)).toFixed(2), x = i => (100 * i / STEPS).toFixed(2);
      plots.forEach((parts, k) => {
        const points = curves[k];
        parts.line.setAttribute("d", `M${points.map((p, i) => `${x(i)} ${y(p.middle)}`).join("L")}`);
        const upper = points.map((p, i) => `${x(i)} ${y(p.middle + p.width)}`);
        const lower = points.map((p, i) => `${x(i)} ${y(p.middle - p.width)}`).reverse();
        parts.band.setAttribute("d", `M${[...upper, ...lower].join("L")}Z`);
        const at = (50 * (state.places[k] + 1)).toFixed(2);
        parts.at.setAttribute("d", `M${at} 0V60M0 ${y(value)}H100`);
      });
    }
    box.querySelector(".setting code").textContent = checkText();
  }

  /* Option that runs this setting. */
  function checkText() {
    const text = (factor, value) => `${factor.name}=${Number(value.toPrecision(5))}${factor.written ? ` ${factor.written}` : ""}`;
    const moved = factors.map((factor, k) => [factor, state.places[k]]).filter(([, place]) => place !== 0);
    const parts = moved.length ? moved : [[factors[0], 0]];
    return `--check '${parts.map(([factor, place]) => text(factor, valueAt(factor, place))).join(", ")}'`;
  }

  // ---- matrix of interactions --------------------------------------------------------------------
  function matrix() {
    const grid = box.querySelector(".matrix");
    if (!data.interactions || !grid) return;
    grid.style.setProperty("--factors", factors.length);
    grid.replaceChildren();
    const model = data.models[state.load][state.response];
    const mean = (i, u, j, v) => {
      const places = factors.map(() => null);
      places[i] = u; places[j] = v;
      return predict(state.load, state.response, places);
    };
    const all = [];
    for (let i = 0; i < factors.length; i++) for (let j = 0; j < factors.length; j++)
      if (i !== j) for (const u of [-1, 0, 1]) for (const v of [-1, 0, 1]) all.push(mean(i, u, j, v));
    const low = Math.min(...all), high = Math.max(...all);
    for (let i = 0; i < factors.length; i++) for (let j = 0; j < factors.length; j++) {
      if (i === j) {
        grid.append(make("div", { class: "name", title: factors[i].title }, make("b", {}, factors[i].name)));
        continue;
      }
      const percent = model.percents[`${factors[Math.min(i, j)].name}:${factors[Math.max(i, j)].name}`];
      const cell = make("div", { class: "cell", title: `${factors[j].name} across, ${factors[i].name} by colour` });
      const svg = draw("svg", { viewBox: "0 0 100 60", preserveAspectRatio: "none" });
      [-1, 0, 1].forEach((v, k) => {
        const points = [-1, -0.5, 0, 0.5, 1].map(u => `${50 * (u + 1)} ${(55 - 50 * (mean(j, u, i, v) - low) / (high - low || 1)).toFixed(2)}`);
        svg.append(draw("path", { d: `M${points.join("L")}`, stroke: Pictures.hue(HUES[k]), class: "level" }));
      });
      cell.append(svg, make("small", {}, percent === null || percent === undefined ? "" : `${percent.toFixed(1)} %`));
      grid.append(cell);
    }
  }

  // ---- contours ----------------------------------------------------------------------------------
  function contour() {
    const target = box.querySelector(".contour"), Plotly = Pictures.library();
    if (!Plotly || !target || factors.length < 2) return;
    const [fx, fy] = [factors[state.x], factors[state.y]], count = 41, look = Pictures.theme();
    const places = Array.from({ length: count }, (_, i) => -1 + 2 * i / (count - 1));
    const z = places.map(v => places.map(u => {
      const at = state.places.slice();
      at[state.x] = u; at[state.y] = v;
      return predict(state.load, state.response, at);
    }));
    const response = responses.find(r => r.name === state.response);
    const title = factor => Pictures.escaped([factor.title, factor.unit].filter(Boolean).join(", "));
    const font = { color: look.quiet, size: 12 };
    const axis = factor => ({ title: { text: title(factor), font: { size: 13, color: look.ink }, standoff: 8 }, tickfont: font, linecolor: look.line, showline: true, showgrid: false, zeroline: false, automargin: true });
    Plotly.react(target, [
      {
        type: "contour", x: places.map(u => valueAt(fx, u)), y: places.map(v => valueAt(fy, v)), z, colorscale: [[0, "#f7fbff"], [0.5, "#6baed6"], [1, "#08306b"]],
        contours: { coloring: "heatmap", showlabels: true, labelfont: { size: 11, color: "#1a1a1a" } }, line: { width: 0.8, color: "#33475b" },
        colorbar: { thickness: 12, outlinewidth: 0, tickfont: font, title: { text: Pictures.escaped(`${response.name}, ${response.unit}`), font, side: "right" } },
        hovertemplate: "%{x:.4~g}, %{y:.4~g}<br><b>%{z:.4~g}</b><extra></extra>",
      },
      { type: "scatter", mode: "markers", x: [valueAt(fx, state.places[state.x])], y: [valueAt(fy, state.places[state.y])], marker: { symbol: "x", size: 11, color: "#b34700" }, hoverinfo: "skip" },
    ], {
      width: Math.max(320, Math.min(760, target.parentElement.clientWidth)), height: 430, margin: { l: 70, r: 20, t: 28, b: 60 }, showlegend: false,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { family: Pictures.font, color: look.ink }, xaxis: axis(fx), yaxis: axis(fy),
    }, { displaylogo: false, displayModeBar: false, responsive: false });
  }

  // ---- all together --------------------------------------------------------------------------------
  let waiting = 0;
  function update() {
    updateProfiler();
    clearTimeout(waiting);
    waiting = setTimeout(contour, 60);
  }

  function controls() {
    const names = responses.map(r => [r.name, `${r.title}, ${r.unit}`]), own = factors.map((f, k) => [String(k), f.title]);
    box.querySelector(".choose-load").append(
      choice("Load", loads.map(load => [load, load]), state.load, value => { state.load = value; update(); matrix(); }),
      make("button", { type: "button", onclick: () => set(middle) }, "all factors to the middle"),
      ...(data.proposed ? [make("button", { type: "button", onclick: () => set(data.proposed) }, "proposed setting")] : []));
    const response = () => choice("Response", names, state.response, value => {
      state.response = value;
      box.querySelectorAll("select.response-choice").forEach(select => { select.value = value; });
      matrix(); contour();
    });
    for (const place of box.querySelectorAll(".choose-response")) {
      const label = response();
      label.querySelector("select").className = "response-choice";
      place.append(label);
    }
    if (factors.length > 1) box.querySelector(".choose-axes").append(
      choice("across", own, String(state.x), value => { state.x = Number(value); contour(); }),
      choice("up", own, String(state.y), value => { state.y = Number(value); contour(); }));
  }

  profiler();
  controls();
  updateProfiler();
  matrix();
  Pictures.started.then(contour);
  const again = () => { updateProfiler(); matrix(); contour(); };
  addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(contour, 150); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  return {
    predict, move, state,
    halfWidth: (load, name, places) => halfWidth(load, name, leverage(load, row(places))),
  };
})();
