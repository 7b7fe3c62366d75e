// Curves in SVG: a few hundred points are redrawn in some milliseconds, zoomed and hovered.

import {digits, draw, fixed} from './dom.js';

const WIDTH = 400;
const HEIGHT = 200;
const LEFT = 46;
const RIGHT = 6;
const TOP = 20;
const BOTTOM = 24;

/** Return round values between two ends. */
export function ticks(low, high, count) {
  const span = high - low;
  if (!(span > 0)) return [low];
  const raw = span / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) {
    found.push(k * step);
  }
  return found;
}

/** Return the smallest round number not below a size, so that a scale does not jump all the time. */
export function roundUp(size) {
  if (!(size > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(size));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((factor) => factor * power >= size) * power;
}

const line = (xs, ys) => {
  let path = '';
  for (let i = 0; i < xs.length; i += 1) {
    path += `${i ? 'L' : 'M'}${xs[i].toFixed(1)} ${ys[i].toFixed(1)}`;
  }
  return path;
};

/** Return the ends of some numbers in words. */
const ends = (values) => `${digits(Math.min(...values), 3)} to ${digits(Math.max(...values), 3)}`;

/** Return the value of a line through points (xs rising) at x. */
function at(xs, ys, x) {
  if (!xs.length) return NaN;
  let low = 0;
  let high = xs.length - 1;
  if (x <= xs[low]) return ys[low];
  if (x >= xs[high]) return ys[high];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (xs[middle] <= x) low = middle; else high = middle;
  }
  return ys[low] + ((ys[high] - ys[low]) * (x - xs[low])) / (xs[high] - xs[low]);
}

/** Zoom over time that several panels share. */
export class TimeRange {
  constructor() {
    this.panels = new Set();
    this.end = 1;
    this.range = null;
  }

  get low() { return this.range ? this.range[0] : 0; }

  get high() { return this.range ? this.range[1] : this.end; }

  zoom(range) {
    this.range = range && range[1] - range[0] > 1e-3 * this.end ? range : null;
    for (const panel of this.panels) panel.redraw();
  }
}

/**
 * A panel with bands over time. A band is {upper: [times, values], lower: [times, values]}, in
 * seconds and in the unit of the panel.
 */
export class BandPanel {
  constructor(parent, title, unit, time) {
    this.title = title;
    this.unit = unit;
    this.time = time;
    this.data = null;
    this.svg = draw('svg', {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': `${title} in ${unit}`});
    parent.append(this.svg);
    time.panels.add(this);
    this.listen();
  }

  /** Show {now, ghost, variants, measured, low, high, rpm}; ghost, variants, measured may be left out. */
  show(data) {
    this.data = data;
    this.svg.setAttribute('aria-label', this.inWords());
    this.redraw();
  }

  /** Say what the panel shows: ends, the largest value with its time and speed, and the others. */
  inWords() {
    const {now, ghost, measured = [], rpm} = this.data;
    const span = (band) => ends([...band.lower[1], ...band.upper[1]]);
    const name = `${this.title} in ${this.unit} over time`;
    if (!now.upper[1].length) return `${name}: no curve`;
    const [size, time] = [now.lower, now.upper].flatMap(([times, values]) => values.map((value, place) => [Math.abs(value), times[place]]))
      .reduce((best, one) => (one[0] > best[0] ? one : best));
    const texts = [`${span(now)}, largest ${digits(size, 3)} at ${fixed(time, 1)} s and ${fixed(at(rpm[0], rpm[1], time), 0)} rpm`];
    if (ghost?.upper[1].length) texts.push(`as it was ${span(ghost)}`);
    if (measured.length) texts.push(`measured ${measured.map((value) => digits(value, 3)).join(' and ')}`);
    return `${name}: ${texts.join('; ')}`;
  }

  x(time) {
    const {low, high} = this.time;
    return LEFT + ((time - low) / (high - low)) * (WIDTH - LEFT - RIGHT);
  }

  y(value) {
    const {low, high} = this.data;
    return HEIGHT - BOTTOM - ((value - low) / (high - low)) * (HEIGHT - TOP - BOTTOM);
  }

  path([times, values]) {
    return line(times.map((t) => this.x(t)), values.map((v) => this.y(v)));
  }

  area(band) {
    const back = [[...band.lower[0]].reverse(), [...band.lower[1]].reverse()];
    return band.upper[0].length ? `${this.path(band.upper)}${this.path(back).replace('M', 'L')}Z` : '';
  }

  redraw() {
    if (!this.data) return;
    const {low, high} = this.data;
    const id = this.clip ??= `clip-${Math.random().toString(36).slice(2)}`;
    const box = {x: LEFT, y: TOP, width: WIDTH - LEFT - RIGHT, height: HEIGHT - TOP - BOTTOM};
    const parts = [draw('clipPath', {id}, draw('rect', attributes(box)))];
    for (const value of ticks(low, high, 4)) {
      const y = this.y(value).toFixed(1);
      parts.push(draw('path', {class: 'grid', d: `M${LEFT} ${y}H${WIDTH - RIGHT}`}));
      parts.push(draw('text', {x: String(LEFT - 4), y: String(Number(y) + 5), 'text-anchor': 'end'}, digits(value, 3)));
    }
    const marks = ticks(this.time.low, this.time.high, 5);
    marks.forEach((value, index) => {
      const x = this.x(value);
      const anchor = x > WIDTH - 32 ? 'end' : 'middle';
      const text = index === marks.length - 1 ? `${digits(value, 3)} s` : digits(value, 3);
      parts.push(draw('text', {x: x.toFixed(1), y: String(HEIGHT - 7), 'text-anchor': anchor}, text));
    });
    const inside = draw('g', {'clip-path': `url(#${id})`});
    const {now, ghost, variants = [], measured = []} = this.data;
    inside.append(draw('path', {class: 'now-area', d: this.area(now)}));
    if (ghost) inside.append(draw('path', {class: 'ghost-line', d: this.path(ghost.upper) + this.path(ghost.lower)}));
    for (const {index, band} of variants) {
      inside.append(draw('path', {class: `variant v${index}`, d: this.path(band.upper) + this.path(band.lower)}));
    }
    for (const value of measured) {
      inside.append(draw('path', {class: 'measured-line', d: `M${LEFT} ${this.y(value)}H${WIDTH - RIGHT}M${LEFT} ${this.y(-value)}H${WIDTH - RIGHT}`}));
    }
    parts.push(inside, draw('text', {class: 'title', x: String(LEFT), y: '14'}, `${this.title}, ${this.unit}`));
    this.over = draw('g');
    this.svg.replaceChildren(...parts, this.over);
  }

  timeAt(event) {
    const box = this.svg.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * WIDTH;
    const part = Math.min(1, Math.max(0, (x - LEFT) / (WIDTH - LEFT - RIGHT)));
    return this.time.low + part * (this.time.high - this.time.low);
  }

  listen() {
    let begin = null;
    this.svg.addEventListener('pointerdown', (event) => { begin = this.timeAt(event); });
    this.svg.addEventListener('pointermove', (event) => { if (this.data) this.hover(this.timeAt(event), begin); });
    this.svg.addEventListener('pointerleave', () => { begin = null; this.over?.replaceChildren(); });
    this.svg.addEventListener('pointerup', (event) => {
      const end = this.timeAt(event);
      const from = begin;
      begin = null;
      const wide = 0.02 * (this.time.high - this.time.low);
      if (from !== null && Math.abs(end - from) > wide) {
        this.time.zoom([Math.min(from, end), Math.max(from, end)]);
      }
    });
    this.svg.addEventListener('dblclick', () => this.time.zoom(null));
  }

  hover(time, begin) {
    const {now, rpm} = this.data;
    const x = this.x(time);
    const upper = at(...now.upper, time);
    const lower = at(...now.lower, time);
    const text = `${fixed(time, 1)} s, ${fixed(at(rpm[0], rpm[1], time), 0)} rpm: ${digits(lower, 3)} to ${digits(upper, 3)}`;
    const parts = [
      draw('path', {class: 'cursor', d: `M${x} ${TOP}V${HEIGHT - BOTTOM}`}),
      draw('text', {class: 'reading', x: String(WIDTH - RIGHT - 4), y: String(HEIGHT - BOTTOM - 6), 'text-anchor': 'end'}, text),
    ];
    if (begin !== null) {
      const from = this.x(begin);
      parts.unshift(draw('rect', attributes({class: 'selection', x: Math.min(x, from), y: TOP, width: Math.abs(x - from), height: HEIGHT - TOP - BOTTOM})));
    }
    this.over.replaceChildren(...parts);
  }
}

/** A panel with a closed path in a plane with equal scales, in mm. */
export class OrbitPanel {
  constructor(parent, title) {
    this.title = title;
    this.svg = draw('svg', {viewBox: '0 0 300 300', role: 'img', 'aria-label': `orbit, ${title}`});
    parent.append(this.svg);
  }

  show(now, ghost, limit) {
    const size = 300;
    const at = (value, sign) => 0.5 * size + (sign * value * (0.5 * size - 32)) / limit;
    const path = (orbit) => line(orbit.x.map((v) => at(v / 1000, 1)), orbit.z.map((v) => at(v / 1000, -1)));
    const span = (orbit) => ['x', 'z'].map((axis) => `${axis} ${ends(orbit[axis].map((v) => v / 1000))}`).join(', ');
    this.svg.setAttribute('aria-label', `orbit, ${this.title}, in mm: ${span(now)}${ghost ? `; as it was ${span(ghost)}` : ''}`);
    const parts = [];
    for (const value of ticks(-limit, limit, 4)) {
      const x = at(value, 1).toFixed(1);
      const y = at(value, -1).toFixed(1);
      parts.push(draw('path', {class: 'grid', d: `M${x} 32V268M32 ${y}H268`}));
      parts.push(draw('text', {x, y: '286', 'text-anchor': 'middle'}, digits(value, 3)));
      parts.push(draw('text', {x: '29', y: String(Number(y) + 5), 'text-anchor': 'end'}, digits(value, 3)));
    }
    if (ghost) parts.push(draw('path', {class: 'ghost-line', d: path(ghost)}));
    parts.push(draw('path', {class: 'now-line', d: path(now)}));
    parts.push(draw('text', {class: 'title', x: '32', y: '16'}, `${this.title}, x and z in mm`));
    this.svg.replaceChildren(...parts);
  }
}

function attributes(values) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, String(value)]));
}
