"use strict";
/* Draws the pictures of a page from their descriptions (describing.py) with Plotly.

   A picture is drawn when it comes into view, again when the width or the colour scheme changes,
   and before printing. Sizes of texts are measured, so that no label lies over another. Every text
   is escaped here: in a description nothing is markup. */
const Pictures = (() => {
  const DESIGN_WIDTH = 1060, INCH = 100, GAP = 16, BAR = 20, PRINT_WIDTH = 686, MINUS = "\u2212";
  const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Liberation Sans", Arial, sans-serif';
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const pen = document.createElement("canvas").getContext("2d");
  const drawn = new Map();
  let isPrinting = false, plotly = null;

  const isDark = () => dark.matches && !isPrinting;
  const escaped = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;")
    .replace(/>/g, "&gt;").replace(/%\{/g, "%&#123;");
  const lines = list => list.map(escaped).join("<br>");

  function numbers(packed) {
    if (!packed || packed.f4 === undefined) return packed;
    if (!packed.array) {
      const bytes = Uint8Array.from(atob(packed.f4), c => c.charCodeAt(0));
      packed.array = new Float32Array(bytes.buffer);
    }
    return packed.array;
  }

  /* Values of coloured cells from their levels on the colour scale, in 65534 steps. */
  function cellValues(part) {
    if (part.decoded) return part.decoded;
    const bytes = Uint8Array.from(atob(part.levels), c => c.charCodeAt(0));
    const { low, high, kind, gamma } = part.norm;
    return (part.decoded = Array.from(new Uint16Array(bytes.buffer), step => {
      if (step === 65535) return NaN;
      const level = step / 65534;
      if (kind === "log") return low * (high / low) ** level;
      return low + (high - low) * (kind === "power" ? level ** (1 / gamma) : level);
    }));
  }

  // ---- texts -------------------------------------------------------------------------------
  /* A text may be broken after a blank, a dash, a slash and, as names of responses, at _ and dots. */
  const BREAK = /(?<=[\s/\u2013_-]|\.(?=[a-z]))/;

  function width(text, size, bold) {
    pen.font = `${bold ? "bold " : ""}${size}px ${FONT}`;
    return Math.max(0, ...String(text).split("\n").map(line => pen.measureText(line).width));
  }

  function wrapped(text, size, room, bold) {
    const found = [];
    for (const line of String(text).split("\n")) {
      let now = "";
      for (const word of line.split(BREAK)) {
        if (now && width((now + word).trimEnd(), size, bold) > room) {
          found.push(now.trimEnd());
          now = word;
        } else now += word;
      }
      found.push(now.trimEnd());
    }
    return found;
  }

  // ---- colours -----------------------------------------------------------------------------
  function channels(hex) {
    return [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16) / 255);
  }

  /* Colour for the scheme: on dark ground greys are turned over, and dark hues made light. */
  function hue(color, alpha = 1) {
    const hex = typeof color === "string" ? color : color.hex;
    const opacity = typeof color === "string" ? alpha : color.alpha;
    let [r, g, b] = channels(hex);
    if (isDark()) {
      const high = Math.max(r, g, b), low = Math.min(r, g, b), light = (high + low) / 2;
      if (high - low < 0.12) {
        const turned = 0.09 + 0.86 * (1 - light);
        [r, g, b] = [turned, turned, turned];
      } else if (light < 0.6) {
        const part = (0.62 - light) / (1 - light);
        [r, g, b] = [r, g, b].map(value => value + part * (1 - value));
      }
    }
    return `rgba(${[r, g, b].map(v => Math.round(255 * v)).join(",")},${opacity})`;
  }

  const theme = () => isDark()
    ? { ink: "#d8dde3", quiet: "#9aa5b1", grid: "#313a44", line: "#5a6673", paper: "#14181d" }
    : { ink: "#1f2933", quiet: "#52606d", grid: "#e2e5ea", line: "#9aa5b1", paper: "#ffffff" };

  // ---- ticks -------------------------------------------------------------------------------
  function niceStep(span, most) {
    const raw = span / most, power = 10 ** Math.floor(Math.log10(raw));
    return power * [1, 2, 5, 10].find(factor => factor * power >= raw * 0.999);
  }

  const upCount = height => Math.max(3, Math.round(height / 34));

  /* First and last tick that a plain axis is likely to show, [place, text]: they need room. */
  function likelyTicks(axis, most) {
    if (axis.ticks) return axis.ticks;
    const [a, b] = axis.range, low = Math.min(a, b), high = Math.max(a, b);
    if (axis.is_log) return [[low, "10\u221288"]];
    if (!(high > low)) return [[low, String(low)]];
    const step = niceStep(high - low, most), decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return [Math.ceil(low / step) * step, Math.floor(high / step) * step]
      .map(value => [value, value.toFixed(Math.min(8, decimals)).replace("-", MINUS)]);
  }

  const likelyTexts = (axis, most) => likelyTicks(axis, most).map(([, text]) => text);

  // ---- room around a panel -----------------------------------------------------------------
  const size = (points, factor) => Math.max(9.5, points * (INCH / 72) * factor);
  const HEIGHT = 1.25;

  /* Texts of the ticks across: in lines under each other, or upright, so that they fit. */
  function acrossTicks(axis, room, factor) {
    const px = size(axis.tick_size, factor);
    if (!axis.is_labelled || (axis.ticks && !axis.ticks.length)) return { px, height: 0, angle: 0 };
    if (!axis.ticks) return { px, height: px * HEIGHT + 5, angle: 0 };
    const places = axis.ticks.map(([place]) => place);
    const span = Math.abs(axis.range[1] - axis.range[0]) || 1;
    let cell = room;
    for (let i = 1; i < places.length; i++)
      cell = Math.min(cell, room * Math.abs(places[i] - places[i - 1]) / span);
    const words = axis.ticks.flatMap(([, text]) => text.split(BREAK).map(word => word.trimEnd()));
    if (Math.max(0, ...words.map(word => width(word, px))) <= cell - 4) {
      const texts = axis.ticks.map(([, text]) => wrapped(text, px, cell - 4));
      return { px, texts, angle: 0, height: Math.max(...texts.map(t => t.length)) * px * HEIGHT + 5 };
    }
    const longest = Math.min(190, Math.max(...axis.ticks.map(([, text]) => width(text, px))));
    const texts = axis.ticks.map(([, text]) => wrapped(text, px, 195));
    return { px, texts, angle: -90, height: longest + 9 };
  }

  /* Texts of the ticks upwards: in lines as long as needed, so that they lie above each other. */
  function upTicks(axis, room, height, factor, total) {
    const px = size(axis.tick_size, factor);
    if (!axis.is_labelled || (axis.ticks && !axis.ticks.length)) return { px, width: 0 };
    if (!axis.ticks) return { px, width: Math.max(0, ...likelyTexts(axis, upCount(height)).map(text => width(text, px))) + 8 };
    const span = Math.abs(axis.range[1] - axis.range[0]) || 1;
    const places = axis.ticks.map(([place]) => place).sort((u, v) => u - v);
    const cell = Math.min(height, ...places.slice(1).map((place, i) => height * (place - places[i]) / span));
    let texts;
    for (const most of [0.32 * room, 0.45 * room, 0.3 * total, 0.42 * total]) {
      texts = axis.ticks.map(([, text]) => wrapped(text, px, Math.max(90, most)));
      if (Math.max(...texts.map(t => t.length)) * px * HEIGHT <= cell) break;
    }
    return { px, texts, width: Math.max(0, ...texts.flat().map(text => width(text, px))) + 8 };
  }

  /* How far the first and the last tick across reach beyond the axes. [px] */
  function overhang(axis, { px, height, texts, angle }, room) {
    const found = { left: 0, right: 0 };
    if (!height) return found;
    const scale = axis.is_log ? Math.log10 : value => value, [a, b] = axis.range.map(scale);
    likelyTicks(axis, Math.max(3, Math.round(room / 62))).forEach(([place, text], i) => {
      const at = room * (scale(place) - a) / (b - a || 1), own = texts ? texts[i] : [text];
      const half = angle ? 0.5 * own.length * px * HEIGHT : 0.5 * Math.max(...own.map(line => width(line, px)));
      if (at < -1 || at > room + 1) return;
      found.left = Math.max(found.left, half - at);
      found.right = Math.max(found.right, at + half - room);
    });
    return found;
  }

  /* Room that a panel needs outside its axes. [px] */
  function around(panel, twin, room, height, factor, isSolo, total) {
    const need = { left: 0, right: 4, top: 6, bottom: 4 };
    const x = { ...panel.x, is_labelled: panel.x.is_labelled || (isSolo && panel.x.ticks === null) };
    const y = { ...panel.y, is_labelled: panel.y.is_labelled || (isSolo && panel.y.ticks === null) };
    need.upTicks = upTicks(y, room, height, factor, total);
    const label = size(y.label_size, factor);
    need.upLabel = y.label ? wrapped(y.label, label, Math.max(60, height)) : [];
    need.left = need.upTicks.width + (need.upLabel.length ? need.upLabel.length * label * HEIGHT + 6 : 0);
    need.acrossTicks = acrossTicks(x, room, factor);
    const beyond = overhang(x, need.acrossTicks, room);
    need.left = Math.max(need.left, beyond.left + 2);
    need.right = Math.max(need.right, beyond.right + 4);
    const under = size(x.label_size, factor);
    need.acrossLabel = x.label ? wrapped(x.label, under, Math.max(80, room)) : [];
    const outside = need.acrossTicks.height
      + (need.acrossLabel.length ? need.acrossLabel.length * under * HEIGHT + 6 : 0);
    need[x.is_far ? "top" : "bottom"] += outside;
    if (!x.is_far) need.bottom = Math.max(need.bottom, 6);
    if (panel.top) {
      const px = size(panel.top.tick_size, factor), upper = size(panel.top.label_size, factor);
      need.topAxis = px * HEIGHT + 6 + (panel.top.label ? upper * HEIGHT + 4 : 0);
      need.top += need.topAxis;
    }
    need.inner = need.top;
    need.titles = panel.titles.map(title => {
      const px = size(title.size, factor);
      const shared = panel.titles.length > 1 ? 0.48 : 1;
      const texts = wrapped(title.text, px, Math.max(70, (room + 10) * shared), title.is_bold);
      need.top = Math.max(need.top, need.inner + texts.length * px * HEIGHT + 4);
      return { ...title, px, texts };
    });
    for (const part of panel.parts) {  // texts above the panel
      if (part.kind !== "text" || part.in_data[1] || part.y < 1 || part.shift[1] <= 0) continue;
      need.top = Math.max(need.top, part.shift[1] * (INCH / 72) * factor + size(part.size, factor) * HEIGHT + 4);
    }
    if (twin) {
      const ticks = upTicks(twin.y, room, height, factor, total);
      const far = size(twin.y.label_size, factor);
      need.right += ticks.width + (twin.y.label ? far * HEIGHT + 6 : 0);
    }
    need.right = Math.max(need.right, outer(panel, room, factor));
    return need;
  }

  /* Room for texts that stand at the right of the axes. */
  function outer(panel, room, factor) {
    const [a, b] = panel.x.range, span = b - a || 1;
    let need = 4;
    for (const part of panel.parts) {
      if (part.kind !== "text" || !part.in_data[0] || part.across !== "left") continue;
      const at = ((part.x - a) / span) * room + part.shift[0];
      if (at < 0.6 * room) continue;
      need = Math.max(need, at + width(part.text, size(part.size, factor), part.is_bold) - room + 6);
    }
    return Math.min(need, 0.4 * room);
  }

  // ---- places of panels --------------------------------------------------------------------
  function arranged(d, state, total) {
    const factor = Math.min(1, Math.max(0.82, total / DESIGN_WIDTH));
    const solo = state.solo;
    const shown = d.panels.map((panel, index) => ({ panel, index }))
      .filter(({ panel, index }) => solo === null ? panel.twin === null : index === solo);
    const twins = new Map();
    d.panels.forEach((panel, index) => {
      if (panel.twin !== null) twins.set(panel.twin, { panel, index });
    });
    const cell = panel => solo === null
      ? { r0: panel.rows[0], r1: panel.rows[1] - 1, c0: panel.columns[0], c1: panel.columns[1] - 1 }
      : { r0: 0, r1: 0, c0: 0, c1: 0 };
    const first = shown[0].panel;
    const columns = solo === null ? first.widths.length : 1, rows = solo === null ? first.heights.length : 1;
    const used = { c: new Set(), r: new Set() };
    for (const { panel } of shown) {
      const at = cell(panel);
      for (let c = at.c0; c <= at.c1; c++) used.c.add(c);
      for (let r = at.r0; r <= at.r1; r++) used.r.add(r);
    }
    const widths = Array.from({ length: columns }, (_, c) =>
      used.c.has(c) ? (solo === null ? first.widths[c] : 1) : 0);
    const heights = Array.from({ length: rows }, (_, r) =>
      used.r.has(r) ? (solo === null ? first.heights[r] : 1) : 0);
    const sum = list => list.reduce((a, b) => a + b, 0);
    const scales = d.scales.filter(scale => solo === null || scale.panel === solo);
    const barsOf = scale => 52 + Math.max(0, ...(scale.ticks || [[0, "0.000"]])
      .map(([, text]) => width(text, size(8.5, factor))));
    const room = {
      left: d.up ? size(9.5, factor) * HEIGHT + 8 : 0,
      right: Math.max(0, ...scales.filter(s => s.is_common).map(barsOf)),
      bottom: d.across ? size(9.5, factor) * HEIGHT + 8 : 0,
      top: BAR + (d.title ? size(11, factor) * HEIGHT + 10 : 0),
    };

    function fit(pixels, plotHeight) {
      const left = Array(columns).fill(0), right = Array(columns).fill(0);
      const top = Array(rows).fill(0), bottom = Array(rows).fill(0);
      let x = widths.map(w => (pixels * w) / sum(widths)), y = heights.map(h => (plotHeight * h) / sum(heights));
      let needs;
      for (let round = 0; round < 3; round++) {
        needs = shown.map(({ panel, index }) => {
          const at = cell(panel);
          const across = sum(x.slice(at.c0, at.c1 + 1)), up = sum(y.slice(at.r0, at.r1 + 1));
          return around(panel, twins.get(index)?.panel, across, up, factor, solo !== null, pixels);
        });
        left.fill(0); right.fill(0); top.fill(0); bottom.fill(0);
        shown.forEach(({ panel, index }, k) => {
          const at = cell(panel), need = needs[k];
          const bars = scales.filter(s => !s.is_common && s.panel === index).map(barsOf);
          left[at.c0] = Math.max(left[at.c0], need.left);
          right[at.c1] = Math.max(right[at.c1], need.right + Math.max(0, ...bars));
          top[at.r0] = Math.max(top[at.r0], need.top);
          bottom[at.r1] = Math.max(bottom[at.r1], need.bottom);
        });
        const gaps = GAP * Math.max(0, used.c.size - 1);
        const free = Math.max(60 * used.c.size, pixels - sum(left) - sum(right) - gaps - room.left - room.right);
        x = widths.map(w => (free * w) / sum(widths));
      }
      return { left, right, top, bottom, x, needs };
    }

    const goal = BAR + (solo === null ? d.height * INCH - (d.legends.length ? 26 : 0) : 430);
    const design = fit(DESIGN_WIDTH, goal * 0.75);
    const extra = side => sum(side.top) + sum(side.bottom) + GAP * 0.6 * Math.max(0, used.r.size - 1)
      + room.top + room.bottom;
    const isSquare = shown.some(({ panel }) => panel.is_square);
    const least = isSquare ? 100 : 64;
    let plot = Math.max(least * used.r.size, goal - extra(design));
    if (isSquare) plot *= Math.min(1, total / DESIGN_WIDTH);
    const found = fit(total, plot);
    const y = heights.map(h => (plot * h) / sum(heights));
    const height = plot + extra(found);
    // edges of the columns and rows, in pixels from the left and from the top
    const begins = [], tops = [];
    let at = room.left;
    for (let c = 0; c < columns; c++) {
      begins.push(at + found.left[c]);
      at += found.left[c] + found.x[c] + found.right[c] + (used.c.has(c) ? GAP : 0);
    }
    at = room.top;
    for (let r = 0; r < rows; r++) {
      tops.push(at + found.top[r]);
      at += found.top[r] + y[r] + found.bottom[r] + (used.r.has(r) ? 0.6 * GAP : 0);
    }
    const panels = shown.map(({ panel, index }, k) => {
      const place = cell(panel);
      return {
        panel, index, need: found.needs[k], twin: twins.get(index),
        x0: begins[place.c0], x1: begins[place.c1] + found.x[place.c1],
        y0: tops[place.r0], y1: tops[place.r1] + y[place.r1],
      };
    });
    return { panels, scales, height, width: total, factor, room };
  }

  // ---- from a description to Plotly ----------------------------------------------------------
  const MARKS = {
    o: "circle", ".": "circle", s: "square", D: "diamond", d: "diamond-tall", v: "triangle-down",
    "^": "triangle-up", "<": "triangle-left", ">": "triangle-right", "+": "cross-thin", x: "x-thin",
    "*": "star", "|": "line-ns", _: "line-ew", X: "x", P: "cross", h: "hexagon",
  };
  const THIN = new Set(["+", "x", "|", "_"]);

  function marker(part, factor) {
    const thin = THIN.has(part.mark), color = hue(part.mark_color);
    const px = part.mark_size * (INCH / 72) * (part.mark === "." ? 0.55 : 0.9) * factor;
    return {
      symbol: (MARKS[part.mark] || "circle") + (part.is_open ? "-open" : ""),
      size: Math.max(2.5, px), color, line: { color, width: thin || part.is_open ? 1.6 : 0 },
    };
  }

  function level(values, norm) {
    const { low, high, gamma, kind } = norm;
    if (kind === "log") {
      const scale = 1 / (Math.log(high) - Math.log(low) || 1);
      return Array.from(values, v => v > 0 ? Math.min(1, Math.max(0, (Math.log(v) - Math.log(low)) * scale)) : NaN);
    }
    const scale = 1 / (high - low || 1), power = kind === "power" ? gamma : 1;
    return Array.from(values, v => Math.min(1, Math.max(0, (v - low) * scale)) ** power);
  }

  function short(value) {
    if (!Number.isFinite(value)) return "\u2013";
    const text = Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-4)
      ? value.toExponential(3) : String(Number(value.toPrecision(4)));
    return text.replace(/-/g, MINUS);
  }

  const dashes = dash => dash === "solid" ? dash : dash.split(",").map(length => `${length}px`).join(",");
  const colorscale = shades => shades.map((shade, i) => [i / (shades.length - 1), shade]);

  function hovered(part, panel, label) {
    const head = label ? `<b>${escaped(label)}</b><br>` : "";
    const across = escaped(panel.x.label || "x"), up = escaped(panel.y.label || panel.name || "y");
    return `${head}${across.replace(/\n/g, " ")}: %{x:.5~g}<br>${up.replace(/\n/g, " ")}: %{y:.5~g}<extra></extra>`;
  }

  function curves(part, panel, label, factor) {
    const area = part.color ? hue(part.color) : null;
    switch (part.kind) {
      case "line": {
        const x = numbers(part.x), y = numbers(part.y);
        const mode = [part.dash ? "lines" : null, part.mark ? "markers" : null].filter(Boolean).join("+");
        const trace = { type: "scatter", mode: mode || "lines", x, y, hovertemplate: hovered(part, panel, label) };
        if (part.dash) trace.line = { color: area, width: Math.max(0.8, part.width * 1.15), dash: dashes(part.dash) };
        if (part.mark) trace.marker = marker(part, factor);
        return [trace];
      }
      case "area": {
        const white = part.color.hex === "#ffffff";
        const trace = {
          type: "scatter", mode: "lines", x: numbers(part.x), y: numbers(part.y), fill: "toself",
          fillcolor: white ? hue(part.color) : area, hoverinfo: "skip",
          line: part.edge
            ? { color: hue(part.edge.color), width: part.edge.width * 1.15 } : { width: 0, color: "rgba(0,0,0,0)" },
        };
        return [trace];
      }
      case "points": {
        const mark = { size: part.mark_size * (INCH / 72) * factor };
        const trace = { type: "scatter", mode: "markers", x: numbers(part.x), y: numbers(part.y), marker: mark };
        trace.hovertemplate = hovered(part, panel, label);
        if (part.values) {
          const values = numbers(part.values);
          Object.assign(mark, { color: level(values, part.norm), cmin: 0, cmax: 1, colorscale: colorscale(part.shades) });
          trace.customdata = Array.from(values, short);
          trace.hovertemplate = trace.hovertemplate.replace("<extra>", "<br>%{customdata}<extra>");
        } else mark.color = part.own_colors ? part.own_colors.map(c => hue(c, part.color.alpha)) : area;
        return [trace];
      }
      case "bars": {
        const places = numbers(part.places), sizes = numbers(part.sizes), wide = numbers(part.wide);
        const trace = {
          type: "bar", orientation: part.is_across ? "h" : "v", base: numbers(part.begins), width: wide,
          x: part.is_across ? sizes : places, y: part.is_across ? places : sizes,
          marker: { color: part.colors.map(c => hue(c, part.alpha)), line: { width: 0 } },
          customdata: Array.from(sizes, short),
          hovertemplate: `${label ? `<b>${escaped(label)}</b><br>` : ""}%{customdata}<extra></extra>`,
        };
        return [trace];
      }
      case "cells": {
        const x = numbers(part.x), y = numbers(part.y), values = cellValues(part);
        const scaled = level(values, part.norm), z = [], shown = [], columns = values.length / rowsOf(part, y);
        for (let at = 0; at < values.length; at += columns) {
          z.push(scaled.slice(at, at + columns));
          shown.push(Array.from(values.slice(at, at + columns), short));
        }
        return [{
          type: "heatmap", x, y, z, customdata: shown, zmin: 0, zmax: 1, zsmooth: false, showscale: false,
          colorscale: colorscale(part.shades), hoverongaps: false, opacity: part.alpha,
          hovertemplate: "%{x}, %{y}<br>%{customdata}<extra></extra>",
        }];
      }
      default: return [];
    }
  }

  function rowsOf(part, y) {
    const x = numbers(part.x), count = cellValues(part).length;
    return count === x.length * y.length ? y.length : y.length - 1;
  }

  function anchor(part) {
    const up = { top: "top", bottom: "bottom", baseline: "bottom", center: "middle", center_baseline: "middle" };
    return { xanchor: part.across, yanchor: up[part.up] || "middle" };
  }

  function note(part, names, factor, overCells) {
    const px = size(part.size, factor), [inX, inY] = part.in_data;
    const found = {
      ...anchor(part), text: lines(part.text.split("\n")), align: part.across, showarrow: false,
      x: part.x, y: part.y, xref: inX ? names.x : `${names.x} domain`, yref: inY ? names.y : `${names.y} domain`,
      xshift: part.shift[0] * (INCH / 72) * factor, yshift: part.shift[1] * (INCH / 72) * factor,
      textangle: -part.angle, borderpad: 0,
      font: { size: px, color: overCells ? part.color.hex : hue(part.color), weight: part.is_bold ? 700 : 400 },
    };
    if (part.arrow) Object.assign(found, {
      showarrow: true, arrowhead: 2, arrowsize: 0.8, arrowwidth: 1, arrowcolor: hue(part.color), axref: names.x, ayref: names.y,
      ax: part.x, ay: part.y, x: part.arrow[0], y: part.arrow[1],
    });
    return found;
  }

  /* Texts at places in data coordinates as one curve: many texts are drawn fast, and are clipped. */
  function textCurves(parts, factor, overCells) {
    const up = { top: "bottom", bottom: "top", baseline: "top", center: "middle", center_baseline: "middle" };
    const side = { left: "right", right: "left", center: "center" };
    return [{
      type: "scatter", mode: "text", x: parts.map(p => p.x), y: parts.map(p => p.y), hoverinfo: "skip",
      text: parts.map(p => lines(p.text.split("\n"))), cliponaxis: parts.every(p => p.is_clipped && overCells),
      textposition: parts.map(p => `${up[p.up] || "middle"} ${side[p.across]}`),
      textfont: {
        size: parts.map(p => size(p.size, factor)), weight: parts.map(p => p.is_bold ? 700 : 400),
        color: parts.map(p => overCells ? p.color.hex : hue(p.color)),
      },
    }];
  }

  function plainAxis(axis, panel, look) {
    const log = v => axis.is_log ? Math.log10(v) : v;
    const found = {
      type: axis.is_log ? "log" : "linear", range: axis.range.map(log), zeroline: false, fixedrange: false,
      showgrid: axis.has_grid, gridcolor: look.grid, showline: axis.has_line, linecolor: look.line,
      mirror: axis.has_frame, ticks: axis.is_labelled && axis.has_line ? "outside" : "", ticklen: 4,
      tickcolor: look.line, exponentformat: "power", minexponent: 5, separatethousands: false,
      hoverformat: ".5~g", automargin: false,
    };
    if (axis.is_log) found.dtick = Math.abs(log(axis.range[1]) - log(axis.range[0])) > 1 ? 1 : undefined;
    return found;
  }

  /* Axes of a panel; `names` are those of Plotly, such as x3 and y3. */
  function axesOf(place, names, byShare, layout, look, factor, arrangement) {
    const { panel, need } = place, isSolo = arrangement.panels.length === 1;
    const across = plainAxis(panel.x, panel, look), up = plainAxis(panel.y, panel, look);
    const ticks = need.acrossTicks;
    Object.assign(across, {
      domain: [place.x0 / arrangement.width, place.x1 / arrangement.width], anchor: names.y,
      side: panel.x.is_far ? "top" : "bottom", showticklabels: ticks.height > 0,
      tickfont: { size: ticks.px, color: look.quiet }, tickangle: ticks.angle || 0,
      nticks: Math.max(3, Math.round((place.x1 - place.x0) / 62)),
      title: {
        text: lines(need.acrossLabel), standoff: 4,
        font: { size: size(panel.x.label_size, factor), color: hue(panel.x.color) },
      },
    });
    if (panel.x.ticks) {
      across.ticklabeloverflow = "allow";
      across.tickvals = panel.x.ticks.map(([at]) => at);
      across.ticktext = panel.x.ticks.map(([, text], i) => lines(ticks.texts ? ticks.texts[i] : [text]));
    }
    Object.assign(up, {
      domain: [1 - place.y1 / arrangement.height, 1 - place.y0 / arrangement.height], anchor: names.x,
      showticklabels: need.upTicks.width > 0, tickfont: { size: need.upTicks.px, color: look.quiet },
      nticks: upCount(place.y1 - place.y0),
      title: {
        text: lines(need.upLabel), standoff: 5,
        font: { size: size(panel.y.label_size, factor), color: hue(panel.y.color) },
      },
    });
    if (panel.y.ticks) {
      up.tickvals = panel.y.ticks.map(([at]) => at);
      up.ticktext = panel.y.ticks.map(([, text], i) => lines(need.upTicks.texts ? need.upTicks.texts[i] : [text]));
    }
    if (panel.is_square) Object.assign(up, { scaleanchor: names.x, scaleratio: 1, constrain: "domain" }), across.constrain = "domain";
    else if (!isSolo) {
      share(across, `x${panel.x.shared}`, names.x, byShare);
      share(up, `y${panel.y.shared}`, names.y, byShare);
    }
    layout[key("xaxis", names.x)] = across;
    layout[key("yaxis", names.y)] = up;
  }

  const key = (word, name) => word + name.slice(1);

  function share(axis, group, name, byShare) {
    if (byShare.has(group)) axis.matches = byShare.get(group);
    else byShare.set(group, name);
  }

  function topAxis(place, names, number, layout, traces, look, factor) {
    const top = place.panel.top, base = layout[key("xaxis", names.x)];
    const name = `x${number}`;
    layout[`xaxis${number}`] = {
      overlaying: names.x, side: "top", anchor: names.y, range: base.range, matches: base.matches || names.x,
      tickvals: top.ticks.map(([at]) => at), ticktext: top.ticks.map(([, text]) => escaped(text)),
      showgrid: false, zeroline: false, showline: true, linecolor: look.line, ticks: "outside", ticklen: 4,
      tickcolor: look.line, tickfont: { size: size(top.tick_size, factor), color: look.quiet },
      title: { text: escaped(top.label), standoff: 3, font: { size: size(top.label_size, factor), color: look.quiet } },
    };
    traces.push({ type: "scatter", x: base.range, y: [null, null], xaxis: name, yaxis: names.y, hoverinfo: "skip" });
  }

  function built(d, state, total) {
    const arrangement = arranged(d, state, total), { factor } = arrangement, look = theme();
    const traces = [], shapes = [], annotations = [], byShare = new Map();
    const layout = {
      width: Math.round(total), height: Math.round(arrangement.height), margin: { l: 0, r: 0, t: 0, b: 0, pad: 0 },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, hovermode: "closest",
      barmode: "overlay", font: { family: FONT, size: size(9, factor), color: look.ink }, dragmode: "zoom",
      hoverlabel: { font: { family: FONT, size: 13 }, bgcolor: look.paper, bordercolor: look.line, font_color: look.ink },
      shapes, annotations, uirevision: String(state.solo), modebar: { bgcolor: "rgba(0,0,0,0)", color: look.quiet },
    };
    layout.hoverlabel.font.color = look.ink;
    arrangement.panels.forEach((place, k) => {
      const names = { x: `x${k + 1}`.replace(/^x1$/, "x"), y: `y${k + 1}`.replace(/^y1$/, "y") };
      axesOf(place, names, byShare, layout, look, factor, arrangement);
      contents(d, place.panel, names, state, traces, shapes, annotations, factor, place.x1 - place.x0);
      titles(place, names, annotations);
      if (place.panel.top) topAxis(place, names, 100 + k, layout, traces, look, factor);
      if (place.twin) {
        const other = { x: names.x, y: `y${200 + k}` }, axis = place.twin.panel.y;
        layout[`yaxis${200 + k}`] = {
          ...plainAxis(axis, place.twin.panel, look), overlaying: names.y, side: "right", anchor: names.x, tickmode: "auto", nticks: upCount(place.y1 - place.y0),
          showgrid: false, showline: true,
          tickfont: { size: size(axis.tick_size, factor), color: look.quiet },
          title: { text: escaped(axis.label), standoff: 5, font: { size: size(axis.label_size, factor), color: hue(axis.color) } },
        };
        contents(d, place.twin.panel, other, state, traces, shapes, annotations, factor, place.x1 - place.x0);
      }
    });
    scalesOf(d, arrangement, traces, look);
    outerTexts(d, arrangement, annotations, look);
    return { traces, layout };
  }

  function titles(place, names, annotations) {
    for (const title of place.need.titles) {
      annotations.push({
        text: lines(title.texts), showarrow: false, xref: `${names.x} domain`, yref: `${names.y} domain`,
        x: { left: 0, center: 0.5, right: 1 }[title.side], xanchor: title.side, align: title.side, y: 1, yanchor: "bottom",
        yshift: place.need.inner - 4, borderpad: 0,
        font: { size: title.px, color: hue(title.color), weight: title.is_bold ? 700 : 400 },
      });
    }
  }

  function contents(d, panel, names, state, traces, shapes, annotations, factor, room) {
    const overCells = panel.parts.some(part => part.kind === "cells");
    const texts = [], notes = [];
    panel.parts.forEach(part => {
      const entry = entryOf(d, part), hidden = entry !== null && state.hidden.has(entry);
      const label = part.label || (entry !== null ? entries(d)[entry].label : null);
      if (part.kind === "rule" || part.kind === "span") {
        if (hidden) return;
        const { along } = part, other = along === "x" ? "y" : "x", isRule = part.kind === "rule";
        const [begin, end] = isRule ? [part.at, part.at] : part.range;
        shapes.push({
          type: isRule ? "line" : "rect", layer: isRule ? "above" : "below",
          [`${other}ref`]: names[other], [`${other}0`]: begin, [`${other}1`]: end,
          [`${along}ref`]: `${names[along]} domain`, [`${along}0`]: 0, [`${along}1`]: 1,
          ...(isRule ? { line: { color: hue(part.color), width: Math.max(1, part.width), dash: dashes(part.dash) } }
            : { fillcolor: hue(part.color), line: { width: 0 } }),
        });
      } else if (part.kind === "text") {
        const isPlain = part.in_data.every(Boolean) && !part.arrow && !part.shift.some(Boolean) && !part.angle;
        if (isPlain) texts.push(part);
        else notes.push([part, note(part, names, factor, overCells)]);
      } else {
        for (const trace of curves(part, panel, label, factor))
          traces.push({ ...trace, xaxis: names.x, yaxis: names.y, visible: !hidden, showlegend: false, meta: part.label });
      }
    });
    lowered(notes, room, factor);
    annotations.push(...notes.map(([, found]) => found));
    if (texts.length)
      for (const trace of textCurves(texts, factor, overCells)) traces.push({ ...trace, xaxis: names.x, yaxis: names.y });
  }

  /* Lowers the texts at the top right of a panel if they would meet those at its top left. */
  function lowered(notes, room, factor) {
    const atTop = side => notes.filter(([part]) => !part.in_data[0] && !part.in_data[1] && part.up === "top" && part.across === side);
    const wide = list => Math.max(0, ...list.map(([part]) => width(part.text, size(part.size, factor), part.is_bold)));
    const left = atTop("left"), right = atTop("right");
    if (!left.length || wide(left) + wide(right) < 0.93 * room) return;
    const down = Math.max(...left.map(([part]) => size(part.size, factor) * HEIGHT * part.text.split("\n").length));
    for (const [, found] of right) found.yshift -= down;
  }

  function scalesOf(d, arrangement, traces, look) {
    for (const scale of arrangement.scales) {
      const place = arrangement.panels.find(p => p.index === scale.panel) || arrangement.panels[0];
      const all = scale.is_common ? arrangement.panels : [place];
      const top = Math.min(...all.map(p => p.y0)), bottom = Math.max(...all.map(p => p.y1)), right = Math.max(...all.map(p => p.x1 + p.need.right));
      const ticks = scale.ticks || barTicks(scale.norm);
      traces.push({
        type: "scatter", mode: "markers", x: [null], y: [null], hoverinfo: "skip", xaxis: "x", yaxis: "y",
        marker: {
          color: [0], cmin: 0, cmax: 1, colorscale: colorscale(scale.shades), showscale: true,
          colorbar: {
            x: (right + 4) / arrangement.width, xanchor: "left", xpad: 0, ypad: 0, thickness: 12, outlinewidth: 0,
            y: 1 - (top + bottom) / 2 / arrangement.height, yanchor: "middle", len: bottom - top, lenmode: "pixels",
            tickvals: level(ticks.map(([at]) => at), scale.norm), ticktext: ticks.map(([, text]) => escaped(text)),
            tickfont: { size: size(8.5, arrangement.factor), color: look.quiet },
            title: { text: escaped(scale.label), side: "right", font: { size: size(9, arrangement.factor), color: look.ink } },
          },
        },
      });
    }
  }

  function barTicks(norm) {
    const { low, high, kind } = norm, found = [];
    if (kind === "log") {
      for (let power = Math.ceil(Math.log10(low) - 1e-9); power <= Math.log10(high) + 1e-9; power++)
        found.push([10 ** power, short(10 ** power)]);
      if (found.length > 1) return found;
    }
    const step = niceStep(high - low || 1, 6);
    for (let at = Math.ceil(low / step - 1e-9) * step; at <= high + 1e-9 * step; at += step)
      found.push([at, short(Number(at.toPrecision(10)))]);
    return found;
  }

  function outerTexts(d, arrangement, annotations, look) {
    const px = size(9.5, arrangement.factor), base = { showarrow: false, xref: "paper", yref: "paper", font: { size: px, color: look.ink } };
    if (d.up) annotations.push({ ...base, text: lines(wrapped(d.up, px, arrangement.height - 8)), textangle: -90, x: 0, xanchor: "left", y: 0.5, yanchor: "middle" });
    if (d.across) annotations.push({ ...base, text: escaped(d.across), x: 0.5, xanchor: "center", y: 0, yanchor: "bottom" });
    if (d.title) annotations.push({ ...base, text: escaped(d.title), x: 0.5, xanchor: "center", y: 1, yanchor: "top" });
    for (const part of d.notes) annotations.push({ ...base, ...anchor(part), text: lines(part.text.split("\n")), x: part.x, y: part.y });
  }

  // ---- legend and buttons ----------------------------------------------------------------------
  const entries = d => d.entries || (d.entries = d.legends.flatMap(legend => legend.entries));

  /* Number of the entry of the legend that a curve belongs to: by its label, or by its style. */
  function entryOf(d, part) {
    if (part.entry !== undefined) return part.entry;
    const all = entries(d);
    let found = part.label ? all.findIndex(entry => entry.own === part.label) : -1;
    if (found < 0) found = all.findIndex(entry => (part.keys || []).length && part.keys.some(k => entry.keys.includes(k)));
    return (part.entry = found < 0 ? null : found);
  }

  function sample(entry) {
    const ns = "http://www.w3.org/2000/svg", svg = document.createElementNS(ns, "svg");
    svg.setAttribute("viewBox", "0 0 26 12");
    svg.setAttribute("width", 26);
    svg.setAttribute("height", 12);
    svg.setAttribute("aria-hidden", "true");
    const add = (name, attributes) => {
      const node = document.createElementNS(ns, name);
      for (const [word, value] of Object.entries(attributes)) node.setAttribute(word, value);
      svg.append(node);
    };
    if (entry.area) add("rect", { x: 2, y: 1.5, width: 22, height: 9, fill: hue(entry.area.color), stroke: entry.area.edge ? hue(entry.area.edge) : "none" });
    if (entry.line && entry.line.dash) {
      const pattern = entry.line.dash === "solid" ? "" : entry.line.dash;
      add("line", { x1: 0, x2: 26, y1: 6, y2: 6, stroke: hue(entry.line.color), "stroke-width": Math.max(1.4, entry.line.width), "stroke-dasharray": pattern });
    }
    if (entry.line && entry.line.mark) {
      const fill = entry.line.is_open ? "none" : hue(entry.line.mark_color), stroke = hue(entry.line.mark_color);
      const paths = {
        "+": "M8 6h10M13 1v10", x: "M9 2l8 8M17 2l-8 8", "|": "M13 1v10", _: "M7 6h12", v: "M8 2h10l-5 8z",
        "^": "M8 10h10l-5-8z", s: "M9 2h8v8h-8z", D: "M13 1l5 5-5 5-5-5z",
      };
      if (paths[entry.line.mark]) add("path", { d: paths[entry.line.mark], fill: THIN.has(entry.line.mark) ? "none" : fill, stroke, "stroke-width": 1.6 });
      else add("circle", { cx: 13, cy: 6, r: 3.6, fill, stroke });
    }
    return svg;
  }

  function button(text, pressed, action) {
    const made = document.createElement("button");
    made.type = "button";
    made.setAttribute("aria-pressed", pressed);
    made.textContent = text;
    made.addEventListener("click", action);
    return made;
  }

  function legendOf(picture) {
    const { d, state, legend } = picture, all = entries(d);
    legend.replaceChildren();
    legend.hidden = !all.length;
    const parts = d.panels.flatMap(panel => panel.parts);
    let index = 0;
    for (const { title, entries: own } of d.legends) {
      if (title) {
        const word = document.createElement("span");
        word.className = "legend-title";
        word.textContent = title;
        legend.append(word);
      }
      for (const entry of own) {
        const number = index++;
        const made = button("", !state.hidden.has(number), () => {
          if (state.hidden.has(number)) state.hidden.delete(number);
          else state.hidden.add(number);
          draw(picture);
        });
        made.append(sample(entry), entry.label);
        made.disabled = !parts.some(part => entryOf(d, part) === number);
        if (!made.disabled) made.title = "Show or hide";
        legend.append(made);
      }
    }
  }

  function panelButtons(picture) {
    const { d, state, buttons } = picture;
    const own = d.panels.map((panel, index) => ({ panel, index })).filter(({ panel }) => panel.twin === null && panel.name);
    const names = own.map(({ panel }) => panel.name.split("\n")[0]);
    buttons.hidden = own.length < 2 || own.length > 12 || own.length !== d.panels.filter(p => p.twin === null).length
      || new Set(names).size !== names.length || Math.max(...names.map(name => name.length)) > 48;
    if (buttons.hidden) return;
    const show = solo => () => { state.solo = solo; draw(picture); };
    buttons.replaceChildren(
      button("all", state.solo === null, show(null)),
      ...own.map(({ index }, k) => button(names[k], state.solo === index, show(index))));
  }

  // ---- drawing ---------------------------------------------------------------------------------
  const CONFIG = {
    displaylogo: false, responsive: false, scrollZoom: false, displayModeBar: true,
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
    doubleClick: "reset", showTips: false, plotGlPixelRatio: 1,
  };

  function draw(picture) {
    const { d, state, target } = picture;
    const room = isPrinting ? PRINT_WIDTH : target.parentElement.clientWidth;
    const total = Math.max(isPrinting ? PRINT_WIDTH : 600, room);
    const { traces, layout } = built(d, state, total);
    picture.total = room;
    picture.scheme = isDark();
    plotly.react(target, traces, layout, { ...CONFIG, toImageButtonOptions: { filename: "picture", format: "svg" } });
    target.style.minHeight = "";
    legendOf(picture);
    panelButtons(picture);
    target.closest("figure").dataset.drawn = "yes";
    if (picture.clicked && target.on && !picture.listens) {
      picture.listens = true;
      target.on("plotly_click", ({ points: [point] }) => picture.clicked({ label: point.data.meta, number: point.pointNumber, x: point.x, y: point.y }));
    }
  }

  /* Changes the description of a picture, and draws it again if it is drawn. */
  function change(figure, edit) {
    const picture = drawn.get(figure) || prepare(figure);
    edit(picture.d);
    if (picture.total) draw(picture);
  }

  /* Calls a function with label of the curve, number and place of a point that a reader clicks. */
  function clicked(figure, action) {
    (drawn.get(figure) || prepare(figure)).clicked = action;
  }

  function prepare(figure) {
    const d = JSON.parse(figure.querySelector("script[type='application/json']").textContent);
    const picture = {
      d, state: { solo: null, hidden: new Set() }, target: figure.querySelector(".plot"),
      legend: figure.querySelector(".legend"), buttons: figure.querySelector(".panels"), isDrawn: false,
    };
    drawn.set(figure, picture);
    return picture;
  }

  function show(figure) {
    const picture = drawn.get(figure) || prepare(figure);
    const room = isPrinting ? PRINT_WIDTH : picture.target.parentElement.clientWidth;
    if (!room || (picture.total === room && picture.scheme === isDark() && !isPrinting)) return;
    draw(picture);
  }

  const figures = () => [...document.querySelectorAll("figure[data-picture]")];
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

  async function begin() {
    if (!document.getElementById("plotly")) return;
    await library();
    const watcher = new IntersectionObserver(seen => {
      for (const { target, isIntersecting } of seen) if (isIntersecting) show(target);
    }, { rootMargin: "400px" });
    figures().forEach(figure => watcher.observe(figure));
    let waiting = 0;
    addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(again, 120); });
    dark.addEventListener("change", again);
    const print = () => { isPrinting = true; figures().forEach(show); };
    const back = () => { isPrinting = false; drawn.forEach(picture => { picture.total = null; }); again(); };
    addEventListener("beforeprint", print);
    addEventListener("afterprint", back);
    document.documentElement.dataset.pictures = "ready";
  }

  const started = begin();
  started.catch(error => {
    for (const figure of figures()) figure.querySelector(".plot").textContent = `This picture needs a newer browser: ${error.message}`;
  });

  return {
    draw: show, change, clicked, all: () => figures().forEach(show), hue, theme, escaped, short, niceStep, font: FONT, isDark, started,
    library: () => plotly, ready: () => plotly !== null,
  };
})();
