// The compiled machine: memory, steps of a spin profile, and a run. It needs no document, so that
// workers and tests use it.

const PAGE = 65536;
const TOP = 2 << 20;      // where the stack begins, downwards to the constants of the module

/** Return cosine and sine, as `wm_drake.compiler.elementary`: with the same bits in each browser. */
function cosineSine(x) {
  const turns = Math.floor(x * (2 / Math.PI) + 0.5);
  const r = ((x - turns * 1.57079625129699707031) - turns * 7.54978941586159635336e-8) - turns * 5.39030285815811905290e-15;
  const z = r * r;
  const inS = ((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z + 2.75573136213857245213e-6) * z - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z - 1.66666666666666307295e-1;
  const inC = ((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z + 4.16666666666665929218e-2;
  const [s, c] = [r + r * z * inS, 1 - 0.5 * z + z * z * inC];
  return [[c, s], [-s, c], [-c, -s], [s, -c]][turns - 4 * Math.floor(0.25 * turns)];
}

/** Return lengths, accelerations and drum motion of the steps through a profile, and their samples. */
export function scheduleOf({time: corners, speed}, {step, period, control, stepsBefore}) {
  const end = corners[corners.length - 1];
  const multiples = (of) => Array.from({length: Math.floor((end / of) * (1 + 1e-12)) + 1}, (_, k) => of * k);
  const every = [...multiples(period), ...corners, ...(control ? multiples(control) : [])].sort((a, b) => a - b);
  const marks = every.filter((t, k) => k === 0 || !(t - every[k - 1] < 1e-9 * period));
  const pieces = marks.map((t, k) => (k + 1 < marks.length ? Math.ceil(((marks[k + 1] - t) / step) * (1 - 1e-9)) : 1));
  const count = pieces.reduce((sum, n) => sum + n, 0);
  const rates = speed.slice(1).map((w, k) => (w - speed[k]) / (corners[k + 1] - corners[k]));
  const angles = [0];
  rates.forEach((_, k) => angles.push(angles[k] + 0.5 * (speed[k + 1] + speed[k]) * (corners[k + 1] - corners[k])));
  const schedule = {
    count, time: multiples(period),
    motion: new Float64Array(2 * count + 4 * (2 * count + 1)), marks: new Int32Array(3 * count),
  };
  const [lengths, accelerations, drum] = [schedule.motion.subarray(0, count), schedule.motion.subarray(count, 2 * count), schedule.motion.subarray(2 * count)];
  const [row, controls, one] = [0, 1, 2].map((k) => schedule.marks.subarray(k * count, (k + 1) * count));
  row.fill(-1);
  const nearest = (t, of) => (Math.abs(t - of * Math.round(t / of)) < 1e-9 * of ? Math.round(t / of) : -1);
  let piece = 0;
  const pieceAt = (t) => {
    while (piece < rates.length - 1 && t >= corners[piece + 1]) piece += 1;
    while (piece > 0 && t < corners[piece]) piece -= 1;
    return piece;
  };
  const putDrum = (node, t) => {
    const k = pieceAt(t);
    const since = t - corners[k];
    const angle = angles[k] + (speed[k] + 0.5 * rates[k] * since) * since;
    drum.set([speed[k] + rates[k] * since, ...cosineSine(angle), angle], 4 * node);
  };
  let at = 0;
  let alike = 0;
  marks.forEach((mark, k) => {
    const length = ((k + 1 < marks.length ? marks[k + 1] : mark) - mark) / pieces[k];
    row[at] = nearest(mark, period);
    controls[at] = control && nearest(mark, control) >= 0 ? 1 : 0;
    for (let j = 0; j < pieces[k]; j += 1, at += 1) {
      const begin = mark + j * length;
      const middle = begin + 0.5 * length;
      lengths[at] = length;
      accelerations[at] = Math.min(middle, end) > end ? 0 : rates[pieceAt(Math.min(middle, end))];
      putDrum(2 * at, begin);
      putDrum(2 * at + 1, middle);
      const goesOn = at > 0 && Math.abs(length - lengths[at - 1]) <= 1e-9 * lengths[at - 1] && accelerations[at] === accelerations[at - 1];
      alike = goesOn ? alike + 1 : 0;
      one[at] = stepsBefore >= 0 && alike >= stepsBefore ? 1 : 0;
    }
  });
  putDrum(2 * count, end);
  return schedule;
}

/** Return how a profile is stepped: as exported, or as the moved numbers need it, [place, value] each; shorter for a faster drum. */
export function steppingOf({speed}, {at, stepping: {largestTurns, moved, ...exported}}, changes) {
  const cost = ({integrator, step}) => (integrator === 'runge_kutta' ? 4 : 1) / step;
  const needed = changes.filter(([place]) => place >= at.parameters) // before them are those of the load
    .map(([place, value]) => moved.find((one) => one.place === place && one.low <= value && value <= one.high) ?? exported);
  let {integrator, step} = needed.length ? needed.reduce((most, one) => (cost(one) > cost(most) ? one : most)) : exported;
  const fastest = Math.max(...speed.map(Math.abs));
  while (fastest * step > largestTurns[integrator]) step *= 0.5;
  return {...exported, integrator, step, stepsBefore: integrator === 'multistep' ? exported.stepsBefore : -1};
}

/** A machine in WebAssembly. `model` has the places of its numbers. */
export class Machine {
  constructor(module, model) {
    this.model = model;
    this.memory = new WebAssembly.Memory({initial: 64});
    this.free = TOP;
    const known = {
      __linear_memory: this.memory,
      __stack_pointer: new WebAssembly.Global({value: 'i32', mutable: true}, TOP),
      __indirect_function_table: new WebAssembly.Table({initial: 64, element: 'anyfunc'}),
      __multi3: (at, a, aHigh, b, bHigh) => this.putProduct(at, (aHigh << 64n) + BigInt.asUintN(64, a), (bHigh << 64n) + BigInt.asUintN(64, b)),
    };
    const env = {};
    for (const {name} of WebAssembly.Module.imports(module)) env[name] = known[name] ?? Math[name];
    this.functions = new WebAssembly.Instance(module, {env}).exports;
    this.result = this.floats(2);
    this.v = this.floats(model.at.size);
    this.c = this.floats(model.constants.length);
    this.view(this.c, model.constants.length).set(model.constants);
    this.kept = this.free;
  }

  /** Return the address of new memory; it is free again after the next `run`. */
  allocate(bytes) {
    const begin = (this.free + 15) & ~15;
    this.free = begin + bytes;
    const missing = this.free - this.memory.buffer.byteLength;
    if (missing > 0) this.memory.grow(Math.ceil(missing / PAGE));
    return begin;
  }

  /** Write a product of 128 bits, with which LLVM checks the sizes of arrays. */
  putProduct(at, a, b) {
    const product = a * b;
    new BigInt64Array(this.memory.buffer, at, 2).set([BigInt.asIntN(64, product), BigInt.asIntN(64, product >> 64n)]);
  }

  floats(count) { return this.allocate(8 * count); }

  view(at, count) { return new Float64Array(this.memory.buffer, at, count); }

  put(values) {
    const at = this.allocate(values.byteLength);
    new values.constructor(this.memory.buffer, at, values.length).set(values);
    return at;
  }

  /** Return the result of a function. numba's functions write it, and errors, to the first addresses. */
  call(name, ...values) {
    this.functions[name](this.result, this.result + 8, ...values);
    return this.view(this.result, 1)[0];
  }

  /** Change numbers, [place, value] each, and put the machine to rest; return 0, or why it is not. */
  setUp(changes) {
    const v = this.view(this.v, this.model.at.size);
    v.set(this.model.numbers);
    for (const [place, value] of changes) v[place] = value;
    this.changes = changes;
    return this.call('wm_set_up', this.v, this.c);
  }

  /** Run a machine that is set up through a profile, with steps that are halved until it is accurate; keep its samples. */
  run(profile) {
    const {accuracy, mostHalvings, sliderSteps} = this.model;
    const stepping = steppingOf(profile, this.model, this.changes);
    for (let halvings = 0; ; halvings += 1) {
      if (halvings) this.setUp(this.changes);   // a run ends where it ends: begin at rest again
      this.runWith(profile, stepping);
      const error = this.error();
      const next = 0.5 * stepping.step;
      this.accuracy = {error, isConverged: error <= accuracy, step: stepping.step, integrator: stepping.integrator};
      if (error <= accuracy || halvings === mostHalvings || profile.time.at(-1) / next > sliderSteps) return;
      stepping.step = next;
    }
  }

  /** Return the error of the steps of the last run, as `estimates_of` of local_error.py. */
  error() {
    const [, worst, speed] = this.view(this.v + 8 * this.model.at.errors, 3);
    return speed > 0 ? Math.sqrt(worst / speed) : 0;
  }

  runWith(profile, stepping) {
    const {model} = this;
    this.free = this.kept;
    const key = JSON.stringify([profile, stepping]);
    if (key !== this.scheduled) {
      this.schedule = scheduleOf(profile, stepping);
      this.scheduled = key;
    }
    this.view(this.v, model.at.size)[model.at.length] = stepping.step;
    const s = this.schedule;
    const rows = s.time.length;
    const [motion, marks] = [this.put(s.motion), this.put(s.marks)];
    this.rows = rows;
    this.samples = this.floats(rows * model.sample);
    this.call('wm_integrate', this.v, this.c, motion, marks, s.count, this.samples, rows);
    this.moved = this.floats(rows * model.count.points);
    this.call('wm_measure', this.v, this.samples, rows, this.moved);
    this.good = this.answer()[9];
  }

  answer() { return this.view(this.v + 8 * this.model.at.answer, 10 + this.model.count.mounts); }

  /** Return the smallest gap: distance, sample, number of the pair, nearest points [m]. */
  gap() {
    this.call('wm_find_gap', this.v, this.c, this.samples, this.good, this.floats(this.rows));
    const [distance, row, pair, ...points] = this.answer();
    return Number.isFinite(distance) ? {distance, row, pair, points: [points.slice(0, 3), points.slice(3, 6)]} : null;
  }

  /** Return the filtered displacements of the sensors, one after the other, and their largest peaks. */
  amplitudes() {
    const {rows, model: {count: {sensors}}} = this;
    const most = Math.min(this.model.padding, rows - 1);
    const padding = most > this.model.leastPadding ? most : 0;
    const filtered = this.floats(rows * sensors);
    const sizes = this.floats(sensors);
    const places = this.allocate(8 * sensors);
    const isComplete = this.good === rows && padding > 0;
    if (!isComplete) this.view(filtered, rows * sensors).fill(NaN);
    this.call('wm_smooth', this.c, this.moved, rows, isComplete ? padding : 0, this.floats(rows + 2 * padding), filtered, sizes, places);
    return {
      filtered: this.view(filtered, rows * sensors).slice(), sizes: this.view(sizes, sensors).slice(),
      places: Array.from(new BigInt64Array(this.memory.buffer, places, sensors), Number),
    };
  }

  /** Return the largest force of each mount. */
  mounts() {
    this.call('wm_measure_mounts', this.v, this.samples, this.rows);
    return this.answer().slice(10);
  }

  /** Return the smallest and largest forces in parts of the run: [part][signal][least, largest], flat. */
  forces(parts) {
    const {mounts, feet} = this.model.count;
    const size = 2 * parts * (6 + mounts + feet);
    const bands = this.floats(size);
    this.call('wm_bin_forces', this.v, this.samples, this.good, parts, bands);
    return this.view(bands, size).slice();
  }
}
