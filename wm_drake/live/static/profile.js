// The spin profile, drawn: a corner is dragged within the sliders of its two numbers.

import {digits, draw} from './dom.js';
import {roundUp, ticks} from './curves.js';

const WIDTH = 740; // texts are then as large as those of the other panels
const HEIGHT = 190;
const LEFT = 46;
const RIGHT = 12;
const TOP = 18;
const BOTTOM = 24;
const APART = 0.1; // least time between two corners [s]

export class ProfilePanel {
  /** `moved(corners, final)` is called with [key, text] of each number of a corner that moves. */
  constructor(parent, moved) {
    this.moved = moved;
    this.corners = [];
    this.dragged = null;
    this.svg = draw('svg', {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', class: 'profile'});
    parent.append(this.svg);
    this.svg.addEventListener('pointerdown', (event) => this.begin(event));
    this.svg.addEventListener('pointermove', (event) => { if (this.dragged !== null) this.drag(event, false); });
    this.svg.addEventListener('pointerup', (event) => { if (this.dragged !== null) { this.drag(event, true); this.dragged = null; } });
    this.svg.addEventListener('pointercancel', () => { this.dragged = null; });
  }

  /** Show the corners of the numbers `profile.time.K` [s] and `profile.speed.K` [rpm] of a machine. */
  show(numbers, values, shown = {}) {
    if (this.dragged !== null) return;
    const of = new Map(numbers.filter(({key}) => key.startsWith('profile.')).map((number) => [number.key, number]));
    const now = (number) => (number.key in values ? shown[number.key] ?? number.value : number.value);
    this.corners = [];
    for (let k = 0; of.has(`profile.time.${k}`) && of.has(`profile.speed.${k}`); k += 1) {
      const [time, speed] = [of.get(`profile.time.${k}`), of.get(`profile.speed.${k}`)];
      this.corners.push({time, speed, t: now(time), rpm: now(speed)});
    }
    this.redraw();
  }

  get end() { return Math.max(1, ...this.corners.flatMap(({t, time}) => [t, time.value])); }

  get top() { return roundUp(1.1 * Math.max(1, ...this.corners.flatMap(({rpm, speed}) => [rpm, speed.value]))); }

  x(t) { return LEFT + (t / this.end) * (WIDTH - LEFT - RIGHT); }

  y(rpm) { return HEIGHT - BOTTOM - (rpm / this.top) * (HEIGHT - TOP - BOTTOM); }

  /** Return time and speed at a place of the pointer, on the scales of when the drag began. */
  at(event) {
    const box = this.svg.getBoundingClientRect();
    const {end, top} = this.scale ?? this;
    const [x, y] = [((event.clientX - box.left) / box.width) * WIDTH, ((event.clientY - box.top) / box.height) * HEIGHT];
    return [((x - LEFT) / (WIDTH - LEFT - RIGHT)) * end, ((HEIGHT - BOTTOM - y) / (HEIGHT - TOP - BOTTOM)) * top, x, y];
  }

  begin(event) {
    const [, , x, y] = this.at(event);
    const away = this.corners.map(({t, rpm}) => Math.hypot(this.x(t) - x, this.y(rpm) - y));
    const nearest = away.indexOf(Math.min(...away));
    if (!(away[nearest] < 30)) return;
    this.dragged = nearest;
    this.scale = {end: this.end, top: this.top};
    this.svg.setPointerCapture(event.pointerId);
  }

  drag(event, final) {
    const corner = this.corners[this.dragged];
    const [t, rpm] = this.at(event);
    const [before, after] = [this.corners[this.dragged - 1], this.corners[this.dragged + 1]];
    const wanted = {
      time: Math.min(Math.max(Math.round(10 * t) / 10, (before?.t ?? 0) + APART), (after?.t ?? Infinity) - APART),
      speed: Math.max(0, Math.round(rpm)),
    };
    const changes = [];
    for (const [name, now] of [['time', 't'], ['speed', 'rpm']]) {
      if (corner[name].needs) continue;
      corner[now] = wanted[name];
      changes.push([corner[name].key, `${Number(wanted[name].toPrecision(6))} ${corner[name].unit}`]);
    }
    this.redraw();
    if (changes.length) this.moved(changes, final);
    if (final) this.scale = null;
  }

  redraw() {
    const path = (points) => points.map(([t, rpm], k) => `${k ? 'L' : 'M'}${this.x(t).toFixed(1)} ${this.y(rpm).toFixed(1)}`).join('');
    const parts = [];
    for (const rpm of ticks(0, this.top, 3)) {
      const y = this.y(rpm).toFixed(1);
      parts.push(draw('path', {class: 'grid', d: `M${LEFT} ${y}H${WIDTH - RIGHT}`}));
      parts.push(draw('text', {x: String(LEFT - 6), y: String(Number(y) + 5), 'text-anchor': 'end'}, digits(rpm, 4)));
    }
    ticks(0, this.end, 6).forEach((t, k, all) => parts.push(draw('text', {x: this.x(t).toFixed(1), y: String(HEIGHT - 6), 'text-anchor': k === all.length - 1 ? 'end' : 'middle'}, `${digits(t, 3)}${k === all.length - 1 ? ' s' : ''}`)));
    parts.push(draw('path', {class: 'ghost-line', fill: 'none', d: path(this.corners.map(({time, speed}) => [time.value, speed.value]))}));
    parts.push(draw('path', {class: 'now-line', d: path(this.corners.map(({t, rpm}) => [t, rpm]))}));
    for (const {t, rpm} of this.corners) parts.push(draw('circle', {class: 'corner', cx: this.x(t).toFixed(1), cy: this.y(rpm).toFixed(1), r: '6'}));
    parts.push(draw('text', {class: 'title', x: String(LEFT), y: '13'}, 'drum speed, rpm'));
    this.svg.setAttribute('aria-label', `spin profile: ${this.corners.map(({t, rpm}) => `${digits(rpm, 4)} rpm at ${digits(t, 4)} s`).join(', ')}`);
    this.svg.replaceChildren(...parts);
  }
}
