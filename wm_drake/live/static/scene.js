// The tub in the housing: outlines of the shapes in parallel projection, to scale.

import {draw, fixed} from './dom.js';

const SIZE = 460;
const ROUND = 36;

const times = (matrix, p) => matrix.map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
const plus = (a, b) => a.map((value, index) => value + b[index]);
const along = (axis, length) => axis.map((value) => value * length);

/** Return the rotation of roll, pitch, yaw: Rz(yaw) Ry(pitch) Rx(roll). */
export function rotation(roll, pitch, yaw) {
  const [a, b, c] = [Math.cos(roll), Math.cos(pitch), Math.cos(yaw)];
  const [d, e, f] = [Math.sin(roll), Math.sin(pitch), Math.sin(yaw)];
  return [
    [c * b, c * e * d - f * a, c * e * a + f * d],
    [f * b, f * e * d + c * a, f * e * a - c * d],
    [-e, b * d, b * a],
  ];
}

/** Return faces (closed lines of points) of a shape in the frame of its body. */
function faces(shape) {
  const [u, v, w] = shape.axes;
  const [a, b, c] = shape.half;
  const point = (x, y, z) => plus(shape.centre, plus(along(u, x), plus(along(v, y), along(w, z))));
  if (shape.round) {
    const circle = (z) => Array.from({length: ROUND}, (_, k) => {
      const angle = (2 * Math.PI * k) / ROUND;
      return point(a * Math.cos(angle), a * Math.sin(angle), z);
    });
    const [front, rear] = [circle(-c), circle(c)];
    const sides = [];
    for (let k = 0; k < ROUND; k += 6) sides.push([front[k], rear[k]]);
    return [front, rear, ...sides];
  }
  const corner = (i, j, k) => point(i * a, j * b, k * c);
  const found = [];
  for (const s of [-1, 1]) {
    found.push([[s, -1, -1], [s, 1, -1], [s, 1, 1], [s, -1, 1]].map((k) => corner(...k)));
    found.push([[-1, s, -1], [1, s, -1], [1, s, 1], [-1, s, 1]].map((k) => corner(...k)));
  }
  return found;
}

/**
 * Return the balls and circles of what turns with the drum, in the frame of the tub.
 *
 * `drum` has origin and axes of the drum at angle 0; `masses` of the load become balls of `density`.
 * `balls` has the places of the balls of each ring from the drum axis, not turned. [m]
 */
export function inDrum({drum: {origin, axes}, masses, rings, density}, {angle, balls}) {
  const inTub = (p) => plus(origin, times(axes, p));
  const around = (radius, y, phase) => inTub([radius * Math.sin(phase), y, radius * Math.cos(phase)]);
  return {
    balls: [
      ...masses.map(({mass, radius, y, phase, wet = 0}) => ({
        kind: 'mass', wet, place: around(radius, y, phase + angle), radius: Math.cbrt((0.75 * mass) / (Math.PI * density)),
      })),
      ...rings.flatMap(({y, across, isLiquid}, k) => balls[k].map((place) => ({
        kind: isLiquid ? 'water' : 'ball', wet: 0, place: plus(inTub([0, y, 0]), place), radius: 0.5 * across,
      }))),
    ],
    circles: rings.flatMap(({y, radii}) => radii.map((radius) => Array.from({length: 2 * ROUND}, (_, k) => around(radius, y, (Math.PI * k) / ROUND)))),
  };
}

export class SceneView {
  constructor(parent) {
    this.turn = -0.55;
    this.tilt = 0.3;
    this.svg = draw('svg', {viewBox: `0 0 ${SIZE} ${SIZE}`, role: 'img', 'aria-label': 'tub in the housing'});
    parent.append(this.svg);
    let last = null;
    this.svg.addEventListener('pointerdown', (event) => {
      last = [event.clientX, event.clientY];
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener('pointermove', (event) => {
      if (!last) return;
      this.turn += (event.clientX - last[0]) * 0.01;
      this.tilt = Math.min(1.57, Math.max(-1.57, this.tilt + (event.clientY - last[1]) * 0.01));
      last = [event.clientX, event.clientY];
      this.redraw();
    });
    this.svg.addEventListener('pointerup', () => { last = null; });
  }

  /** Show shapes of tub and housing; the faces are computed once. */
  shapes({tub, housing}) {
    this.tub = tub.map(faces);
    this.housing = housing.map(faces);
    const points = this.housing.length ? this.housing.flat(2) : this.tub.flat(2);
    this.reach = Math.max(0.1, ...points.map((p) => Math.hypot(...p)));
  }

  /** Draw nothing until the next frame: the machine has not run yet. */
  clear() {
    this.pose = null;
    this.svg.replaceChildren();
  }

  /**
   * Show a frame: pose of the tub (roll, pitch, yaw, x, y, z), angle of the drum and balls of each
   * ring; what turns with the drum, as for `inDrum`; the nearest points [m] if given; `words` say
   * when it is.
   */
  show(frame, turning, gap, words) {
    this.pose = frame.pose;
    this.drum = inDrum(turning, frame);
    this.gap = gap;
    const which = gap ? `, smallest gap ${fixed(gap.distance)} mm` : '';
    this.svg.setAttribute('aria-label', `tub in the housing${which}, at ${words}`);
    this.redraw();
  }

  redraw() {
    if (!this.pose || !this.tub) return;
    const [cosine, sine] = [Math.cos(this.turn), Math.sin(this.turn)];
    const [up, down] = [Math.cos(this.tilt), Math.sin(this.tilt)];
    const scale = (0.5 * SIZE - 8) / this.reach;
    const seen = (p) => {
      const right = cosine * p[0] - sine * p[1];
      const away = sine * p[0] + cosine * p[1];
      return [0.5 * SIZE + scale * right, 0.5 * SIZE - scale * (up * p[2] + down * away)];
    };
    const path = (points) => points.map((p, k) => {
      const [x, y] = seen(p);
      return `${k ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`;
    }).join('');
    const matrix = rotation(...this.pose.slice(0, 3));
    const moved = (p) => plus(this.pose.slice(3), times(matrix, p));
    const closed = (face) => `${path(face)}${face.length > 2 ? 'Z' : ''}`;
    const parts = [
      draw('path', {class: 'housing', d: this.housing.flat().map(closed).join('')}),
      ...this.tub.map((shape) => draw('path', {class: 'tub', d: shape.map((face) => closed(face.map(moved))).join('')})),
    ];
    parts.push(draw('path', {class: 'ring', d: this.drum.circles.map((circle) => closed(circle.map(moved))).join('')}));
    for (const {place, radius, kind, wet} of this.drum.balls) {
      const [cx, cy] = seen(moved(place)).map((value) => value.toFixed(1));
      const ball = {cx, cy, r: (scale * radius).toFixed(1)};
      parts.push(draw('circle', {class: kind, ...ball}));
      if (wet) parts.push(draw('circle', {class: 'water', 'fill-opacity': String(wet), ...ball}));
    }
    if (this.gap) {
      const [x, y] = seen(this.gap.points[0]);
      const left = x > 0.6 * SIZE;
      parts.push(draw('path', {class: 'gap-line', d: path(this.gap.points)}));
      parts.push(draw('text', {class: 'gap-text', x: String(x + (left ? -8 : 8)), y: String(Math.max(14, y - 6)), 'text-anchor': left ? 'end' : 'start'}, `${fixed(this.gap.distance)} mm`));
    }
    this.svg.replaceChildren(...parts);
  }
}
