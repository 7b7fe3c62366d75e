"use strict";
/* Draws the pictures of a page with Plotly from the data and layout that interactive.py makes.

   Here is what Plotly does not do: fit a picture to the width of the page, turn its colours for a
   dark page, draw it when it comes into view and before printing, and a legend and buttons of
   panels that the keyboard reaches. A colour `rgb()` is never turned. */
const Pictures = (() => {
  const PRINT_WIDTH = 1040, LEAST_WIDTH = 600, MINUS = "\u2212";
  const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Liberation Sans", Arial, sans-serif';
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const drawn = new Map();
  let isPrinting = false, plotly = null;

  const isDark = () => dark.matches && !isPrinting;
  const escaped = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;")
    .replace(/>/g, "&gt;").replace(/%\{/g, "%&#123;");

  function short(value) {
    if (!Number.isFinite(value)) return "\u2013";
    const text = Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-4)
      ? value.toExponential(3) : String(Number(value.toPrecision(4)));
    return text.replace(/-/g, MINUS);
  }

  function niceStep(span, most) {
    const raw = span / most, power = 10 ** Math.floor(Math.log10(raw));
    return power * [1, 2, 5, 10].find(factor => factor * power >= raw * 0.999);
  }

  // ---- colours -----------------------------------------------------------------------------
  const theme = () => isDark()
    ? { ink: "#d8dde3", quiet: "#9aa5b1", grid: "#313a44", line: "#5a6673", paper: "#14181d" }
    : { ink: "#1f2933", quiet: "#52606d", grid: "#e2e5ea", line: "#9aa5b1", paper: "#ffffff" };
  const NAMED = { "#1a1a1a": "ink", "#6b7280": "quiet", "#e2e5ea": "grid", "#9aa5b1": "line", "#ffffff": "paper" };

  /* Colour #rrggbb or rgba() for the scheme: on dark ground greys are turned, dark hues made light. */
  function hue(color) {
    if (NAMED[color]) return theme()[NAMED[color]];
    if (!isDark()) return color;
    const parts = color.startsWith("#") ? [1, 3, 5].map(at => parseInt(color.slice(at, at + 2), 16))
      : color.match(/[\d.]+/g).map(Number);
    let [r, g, b] = parts.map(value => value / 255);
    const high = Math.max(r, g, b), low = Math.min(r, g, b), light = (high + low) / 2;
    if (high - low < 0.12) r = g = b = 0.09 + 0.86 * (1 - light);
    else if (light < 0.6) [r, g, b] = [r, g, b].map(v => v + (0.62 - light) / (1 - light) * (1 - v));
    return `rgba(${[r, g, b].map(v => Math.round(255 * v)).join(",")},${parts[3] ?? 1})`;
  }

  const isColor = value => typeof value === "string" && (/^#[0-9a-f]{6}$/.test(value) || value.startsWith("rgba("));

  /* Copy of data of Plotly with the colours of the scheme; packed numbers are not looked at. */
  function themed(value) {
    if (Array.isArray(value)) return value.map(themed);
    if (value && typeof value === "object") {
      if (value.bdata || ArrayBuffer.isView(value)) return value;
      return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, themed(item)]));
    }
    return isColor(value) ? hue(value) : value;
  }

  // ---- width -------------------------------------------------------------------------------
  /* Shortens the panels, not the texts between them, to a width; makes the texts a little smaller. */
  function fitted(layout, columns, total) {
    const full = layout.width, factor = Math.min(1, Math.max(0.82, total / full));
    const panels = columns.reduce((sum, [begin, end]) => sum + end - begin, 0);
    const scale = Math.max(0.1, (total - factor * (full - panels)) / panels);
    const place = part => {
      let at = 0, before = 0;
      for (const [begin, end] of columns) {
        at += factor * (Math.min(part * full, begin) - Math.min(part * full, before))
          + scale * (Math.min(part * full, end) - Math.min(part * full, begin));
        before = end;
      }
      return (at + factor * Math.max(0, part * full - before)) / total;
    };
    layout.width = Math.round(total);
    for (const [key, axis] of Object.entries(layout))
      if (key.startsWith("xaxis") && axis.domain) axis.domain = axis.domain.map(place);
    const smaller = value => {
      if (!value || typeof value !== "object" || value.bdata) return;
      for (const [key, item] of Object.entries(value)) {
        if (/font$/.test(key) && item.size) item.size = Math.max(9.5, item.size * factor);
        if (key === "yshift" || key === "xshift") value[key] = item * factor;
        else smaller(item);
      }
    };
    smaller(layout);
    return place;
  }

  // ---- one panel alone ---------------------------------------------------------------------
  /* Leaves only the panel with a number: `axes` are its names of axes, such as x3 and y3. */
  function alone(index, data, layout) {
    const name = index ? index + 1 : "", x = `x${name}`, y = `y${name}`, second = `y${200 + index}`, top = `x${100 + index}`;
    const isOf = ref => [x, y, second, `${x} domain`, `${y} domain`].includes(ref);
    const full = layout.width, axis = layout[`xaxis${name}`];
    for (const key of Object.keys(layout)) {
      if (!/^[xy]axis/.test(key)) continue;
      const own = key[0] + key.slice(5);
      if (![x, y, second, top].includes(own)) delete layout[key];
      else delete layout[key].matches;
    }
    const old = layout.height, rise = layout[`yaxis${name}`].domain;
    const above = (1 - rise[1]) * old, below = 62;
    layout.height = above > 130 ? 430 + 62 + below : 430 + above + below;
    const upper = layout.height - 430 - below;
    layout[`yaxis${name}`].domain = [below / layout.height, 1 - upper / layout.height];
    const names = (layout[`yaxis${name}`].ticktext || []).flatMap(text => text.split("<br>"));
    axis.domain = [Math.max(84, 7.5 * Math.max(0, ...names.map(text => text.length))) / full, 0.9];
    for (const key of ["xaxis", "yaxis"]) layout[key + name].showticklabels = true;
    layout.shapes = layout.shapes.filter(shape => isOf(shape.xref));
    layout.annotations = layout.annotations.filter(note => isOf(note.xref));
    return data.filter(trace => (trace.xaxis || "x") === x && isOf(trace.yaxis || "y") || trace.xaxis === top);
  }

  // ---- legend and buttons --------------------------------------------------------------------
  function sample(key, data, layout) {
    const ns = "http://www.w3.org/2000/svg", svg = document.createElementNS(ns, "svg");
    for (const [word, value] of Object.entries({ viewBox: "0 0 26 12", width: 26, height: 12, "aria-hidden": "true" }))
      svg.setAttribute(word, value);
    const add = (name, attributes) => {
      const node = svg.appendChild(document.createElementNS(ns, name));
      for (const [word, value] of Object.entries(attributes)) node.setAttribute(word, value);
    };
    const line = ({ color, width, dash }) => add("line", {
      x1: 0, x2: 26, y1: 6, y2: 6, stroke: hue(color), "stroke-width": Math.max(1.4, width),
      "stroke-dasharray": dash === "solid" ? "" : dash.replace(/px/g, ""),
    });
    const traces = data.filter(trace => trace.legendgroup === key), first = type => traces.find(type);
    const area = first(trace => trace.fill || trace.type === "bar");
    if (area) {
      const fill = area.fillcolor || [area.marker.color].flat()[0], edge = area.line && area.line.width ? area.line.color : "none";
      add("rect", { x: 2, y: 1.5, width: 22, height: 9, fill: hue(fill), stroke: edge === "none" ? edge : hue(edge) });
    }
    const curve = first(trace => trace.mode && trace.mode.startsWith("lines") && !trace.fill);
    if (curve) line(curve.line);
    const points = first(trace => trace.mode && trace.mode.endsWith("markers"));
    if (points) {
      const { symbol, color, line: outline } = points.marker, ink = isColor(color) ? hue(color) : theme().ink;
      const paths = {
        cross: "M8 6h10M13 1v10", x: "M9 2l8 8M17 2l-8 8", "line-ns": "M13 1v10", "line-ew": "M7 6h12",
        "triangle-down": "M8 2h10l-5 8z", "triangle-up": "M8 10h10l-5-8z", square: "M9 2h8v8h-8z", diamond: "M13 1l5 5-5 5-5-5z",
      };
      const form = paths[symbol.replace(/-open$/, "").replace(/-thin$/, "")];
      const look = { fill: symbol.endsWith("-open") ? "none" : ink, stroke: ink, "stroke-width": outline && outline.width ? 1.6 : 0.8 };
      if (form) add("path", { d: form, ...look }); else add("circle", { cx: 13, cy: 6, r: 3.6, ...look });
    }
    const rule = !traces.length && layout.shapes.find(shape => shape.legendgroup === key);
    if (rule && rule.type === "line") line(rule.line);
    else if (rule) add("rect", { x: 2, y: 1.5, width: 22, height: 9, fill: hue(rule.fillcolor) });
    return svg;
  }

  function button(text, pressed, action) {
    const made = Object.assign(document.createElement("button"), { type: "button", textContent: text });
    made.setAttribute("aria-pressed", pressed);
    made.addEventListener("click", action);
    return made;
  }

  function legendOf(picture) {
    const { given: { data, layout }, state, legend } = picture, { keys, title } = layout.meta;
    legend.hidden = !keys.length;
    legend.replaceChildren(...title
      ? [Object.assign(document.createElement("span"), { className: "legend-title", textContent: title })] : []);
    for (const key of keys) {
      const made = button("", !state.hidden.has(key), () => {
        if (!state.hidden.delete(key)) state.hidden.add(key);
        draw(picture);
      });
      made.title = "Show or hide";
      made.append(sample(key, data, layout), key);
      legend.append(made);
    }
  }

  function panelButtons(picture) {
    const { given: { layout }, state, buttons } = picture;
    const names = layout.meta.panels.map(name => name.split("\n")[0]);
    buttons.hidden = names.length < 2 || names.length > 12 || names.some(name => !name || name.length > 48)
      || new Set(names).size !== names.length;
    const show = solo => () => { state.solo = solo; draw(picture); };
    if (!buttons.hidden) buttons.replaceChildren(button("all", state.solo === null, show(null)),
      ...names.map((name, index) => button(name, state.solo === index, show(index))));
  }

  // ---- drawing -------------------------------------------------------------------------------
  const CONFIG = {
    displaylogo: false, responsive: false, scrollZoom: false, displayModeBar: true, doubleClick: "reset", showTips: false,
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]], toImageButtonOptions: { filename: "picture", format: "svg" },
  };

  /* Values of cells whose colours are not linear in them, for the text at the pointer. */
  const VALUE = { log: place => 10 ** place, root: place => place * place };

  function withValues(trace) {
    const value = VALUE[trace.meta && trace.meta.kind];
    if (!value) return trace;
    const bytes = Uint8Array.from(atob(trace.z.bdata), c => c.charCodeAt(0));
    const flat = new Float32Array(bytes.buffer), [rows, columns] = trace.z.shape.split(",").map(Number);
    trace.customdata = Array.from({ length: rows }, (_, r) => Array.from(flat.subarray(r * columns, (r + 1) * columns), value));
    return trace;
  }

  function draw(picture) {
    const { given, state, target } = picture;
    const room = isPrinting ? PRINT_WIDTH : target.parentElement.clientWidth, look = theme();
    let data = themed(given.data);
    const layout = structuredClone(themed(given.layout));
    data.forEach(trace => { trace.visible = !state.hidden.has(trace.legendgroup); });
    layout.shapes.forEach(shape => { shape.visible = !state.hidden.has(shape.legendgroup); });
    if (state.solo !== null) data = alone(state.solo, data, layout);
    const place = fitted(layout, state.solo === null ? layout.meta.columns : [[0, layout.width]], Math.max(isPrinting ? PRINT_WIDTH : LEAST_WIDTH, room));
    for (const { marker } of data) if (marker && marker.colorbar) marker.colorbar.x = place(marker.colorbar.x);
    layout.font.family = FONT;
    layout.hoverlabel = { font: { family: FONT, size: 13, color: look.ink }, bgcolor: look.paper, bordercolor: look.line };
    layout.modebar = { bgcolor: "rgba(0,0,0,0)", color: look.quiet };
    layout.uirevision = String(state.solo);
    picture.total = room;
    picture.scheme = isDark();
    plotly.react(target, data, layout, CONFIG);
    target.style.minHeight = "";
    legendOf(picture);
    panelButtons(picture);
    target.closest("figure").dataset.drawn = "yes";
    if (picture.clicked && target.on && !picture.listens) {
      picture.listens = true;
      target.on("plotly_click", ({ points: [point] }) => picture.clicked({ name: point.data.meta.name, number: point.pointNumber, x: point.x, y: point.y }));
    }
  }

  function prepare(figure) {
    const given = JSON.parse(figure.querySelector("script[type='application/json']").textContent);
    given.data.forEach(withValues);
    const [target, legend, buttons] = [".plot", ".legend", ".panels"].map(selector => figure.querySelector(selector));
    const picture = { given, state: { solo: null, hidden: new Set() }, target, legend, buttons };
    drawn.set(figure, picture);
    return picture;
  }

  const pictureOf = figure => drawn.get(figure) || prepare(figure);

  function show(figure) {
    const picture = pictureOf(figure);
    const room = isPrinting ? PRINT_WIDTH : picture.target.parentElement.clientWidth;
    if (room && (picture.total !== room || picture.scheme !== isDark() || isPrinting)) draw(picture);
  }

  /* Changes the curves of a picture, and draws it again if it is drawn. */
  function change(figure, edit) {
    const picture = pictureOf(figure);
    edit(picture.given.data);
    if (picture.total) draw(picture);
  }

  /* Calls a function with name of the curve, number and place of a point that a reader clicks. */
  const clicked = (figure, action) => { pictureOf(figure).clicked = action; };

  const figures = () => [...document.querySelectorAll("figure[data-picture]")];
  const isOpen = figure => !figure.closest("details:not([open])");
  const again = () => figures().filter(figure => drawn.has(figure)).forEach(show);

  /* The library is packed in the page (gzip, Base64); a browser unpacks it once. */
  async function library() {
    const packed = document.getElementById("plotly").textContent.trim();
    const bytes = Uint8Array.from(atob(packed), c => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.src = URL.createObjectURL(new Blob([await new Response(stream).arrayBuffer()], { type: "text/javascript" }));
    await new Promise((resolve, reject) => {
      script.onload = resolve;
      script.onerror = () => reject(new Error("the drawing library could not be loaded"));
      document.head.append(script);
    });
    URL.revokeObjectURL(script.src);
    plotly = window.Plotly;
  }

  /* Opens the section that the address names, or all of them; what is folded is not printed. */
  const unfold = part => part.querySelectorAll("details").forEach(fold => { fold.open = true; });
  function atLink() {
    const name = location.hash.slice(1), part = name === "everything" ? document : document.getElementById(name);
    if (part) unfold(part);
  }

  async function begin() {
    addEventListener("hashchange", atLink);
    atLink();
    if (!document.getElementById("plotly")) return;
    await library();
    const watcher = new IntersectionObserver(seen => {
      for (const { target, isIntersecting } of seen) if (isIntersecting) show(target);
    }, { rootMargin: "400px" });
    figures().forEach(figure => watcher.observe(figure));
    document.querySelectorAll("details").forEach(fold => fold.addEventListener("toggle", () => { if (fold.open) fold.querySelectorAll("figure[data-picture]").forEach(figure => { watcher.unobserve(figure); watcher.observe(figure); }); }));
    let waiting = 0;
    addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(again, 120); });
    dark.addEventListener("change", again);
    addEventListener("beforeprint", () => { isPrinting = true; figures().filter(isOpen).forEach(show); });
    addEventListener("afterprint", () => {
      isPrinting = false;
      drawn.forEach(picture => { picture.total = null; });
      again();
    });
    document.documentElement.dataset.pictures = "ready";
    await drawRest();
  }

  /* Draws what is not in view yet, one picture at a time, so that a saved or printed page is whole. */
  async function drawRest() {
    for (const figure of figures()) {
      if (!drawn.has(figure)) {
        show(figure);
        await new Promise(resolve => setTimeout(resolve, 5));
      }
    }
  }

  /* An open document inside: the page counts as loading, for programs that print it when it is loaded. */
  function held() {
    const frame = document.createElement("iframe");
    frame.hidden = true;
    frame.title = "none";
    document.body.append(frame);
    const inside = frame.contentDocument; // none in a sandbox, as in the studio
    if (!inside) { frame.remove(); return () => {}; }
    inside.open();
    return () => { inside.close(); frame.remove(); };
  }

  const release = held();
  const started = begin();
  started.finally(release).catch(() => {});
  started.catch(error => {
    for (const figure of figures()) figure.querySelector(".plot").textContent = `This picture needs a newer browser: ${error.message}`;
  });

  return {
    draw: show, change, clicked, all: () => figures().forEach(show), hue, theme, escaped, short, niceStep, font: FONT, isDark, started,
    library: () => plotly, ready: () => plotly !== null,
  };
})();
