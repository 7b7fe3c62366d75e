// The engine of a page without a server: it answers what the server answers, from runs in workers.

import {steppingOf} from './machine.js';

const data = JSON.parse(document.getElementById('machine-data').textContent);
const {model, machine} = data;
const NOT_AT_REST = {
  '-1': 'the springs cannot hold the empty machine near its drawn pose',
  '-2': 'a spring would be slack at rest; move its hooks or the centre of mass',
  '-3': 'the machine would rest too far from its drawn pose',
};
const UNBALANCE = ['mass', 'phase', 'y', 'radius']; // in the order of the packed numbers
const RPM = 30 / Math.PI;

/** An answer with problems: what is wrong, each with the key of its value. */
export class Problems extends Error {
  constructor(problems) {
    super(problems.map((problem) => problem.message).join('; '));
    this.problems = problems;
  }
}

const wrong = (key, message) => new Problems([{key, message}]);

/* ---- what is chosen ---- */

const numberOf = new Map(machine.numbers.map((number) => [number.key, number]));

/** Return the SI value of a text such as "3.2 N/mm". `quantity` has units by name, and limits. */
function inSI(key, text, {units, least, most, allowed}) {
  const [, digits, unit] = /^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$/.exec(text) ?? [];
  const names = Object.keys(units);
  if (digits === undefined || !(unit in units)) throw wrong(key, `'${text}' is not a number with one of the units ${names.map((name) => name || 'none').join(', ')}`);
  const value = Number(digits) * units[unit];
  if (!(value >= least && value <= most)) throw wrong(key, `${text} is out of range; allowed is ${allowed}`);
  return value;
}

/** Return the numbers of a state: changes of the machine [place, SI], loads and profile, values shown. */
function chosen(state) {
  const loads = JSON.parse(JSON.stringify(data.loads));
  const profile = {time: [...data.profile.time], speed: [...data.profile.speed]};
  const changes = [];
  const values = {};
  const problems = [];
  for (const [key, text] of Object.entries(state.values)) {
    try {
      const number = numberOf.get(key);
      if (!number) throw wrong(key, `'${key}' is not a number of the machine`);
      if (number.needs) throw wrong(key, number.needs);
      const value = inSI(key, text, number);
      values[key] = value / number.units[number.unit];
      const [section, name, , index, field] = key.split('.');
      if (key in model.places) changes.push([model.places[key], value]);
      else if (section === 'loads') loads[name].unbalances[index][field] = value;
      else profile[name][key.split('.')[2]] = value;
    } catch (error) { problems.push(...error.problems); }
  }
  if (problems.length) throw new Problems(problems);
  if (profile.time.some((t, k) => k > 0 && !(t > profile.time[k - 1]))) throw wrong('profile.time', 'the times must rise');
  const stepping = steppingOf(profile, model, changes);
  if (profile.time.at(-1) / stepping.step > model.mostSteps) throw wrong('profile.time', `the run is too long for this page; allowed are ${model.mostSteps} steps`);
  const fastest = Math.max(...profile.speed.map(Math.abs));
  if (fastest > model.fastest) throw wrong('profile.speed', `samples and filter of this page are for up to ${Math.floor(RPM * model.fastest)} rpm; export the machine with a faster profile`);
  if (!state.gasket && 'gasket' in model.places) changes.push([model.places.gasket, 0]);
  changes.push([model.at.speed, profile.speed[0]]);
  return {changes, loads, profile, values};
}

/** Return the described load of a state, or null. */
function described({masses}) {
  if (!masses.length) return null;
  if (masses.length >= model.count.unbalances) throw wrong('masses', `at most ${model.count.unbalances - 1} masses`);
  return {unbalances: masses.map((mass, k) => Object.fromEntries(UNBALANCE.map((name) => [name, inSI(`masses.${k}.${name}`, mass[name], data.masses[name])]))), harmonics: []};
}

/** Return the changes of the machine that a load makes. */
const ofLoad = ({unbalances, harmonics}) => [
  ...unbalances.flatMap((mass, k) => UNBALANCE.map((name, j) => [model.at.unbalances + UNBALANCE.length * k + j, mass[name]])),
  ...harmonics.map((value, k) => [model.at.of_load + k, value]),
];

/* ---- workers ---- */

class Pool {
  constructor(size) {
    this.idle = [];
    this.jobs = [];
    this.later = [];   // jobs of the background: one at a time, when nothing else runs or waits
    this.urgent = 0;   // how many others run
    const url = URL.createObjectURL(new Blob([data.worker], {type: 'text/javascript'}));
    const bytes = Uint8Array.from(atob(data.wasm), (letter) => letter.charCodeAt(0));
    this.ready = WebAssembly.compile(bytes).then((module) => {
      for (let k = 0; k < size; k += 1) {
        const worker = new Worker(url);
        worker.postMessage({module, model});
        this.idle.push(worker);
      }
      this.start();
    });
  }

  run(job, isUrgent = true) {
    return new Promise((resolve, reject) => { (isUrgent ? this.jobs : this.later).push({job, resolve, reject}); this.start(); });
  }

  start() {
    while (this.idle.length) {
      const isUrgent = this.jobs.length > 0;
      if (!isUrgent && (this.urgent || this.isBusy || !this.later.length)) return;
      const {job, resolve, reject} = (isUrgent ? this.jobs : this.later).shift();
      // a worker keeps the samples of its last run; the background takes the one that it had
      const load = isUrgent ? job.load : 'in the background';
      const kept = this.idle.findIndex((one) => one.load === load);
      const [worker] = this.idle.splice(kept < 0 && isUrgent ? 0 : kept, 1);
      worker.load = load;
      if (isUrgent) this.urgent += 1; else this.isBusy = true;
      const done = (act) => (event) => {
        this.idle.push(worker);
        if (isUrgent) this.urgent -= 1; else this.isBusy = false;
        act(event);
        this.start();
      };
      worker.onmessage = done(({data: found}) => resolve(found));
      worker.onerror = done((event) => { event.preventDefault(); reject(new Error(`the run failed: ${event.message}`)); });
      worker.postMessage(job);
    }
  }
}

const pool = new Pool(Math.max(1, Math.min(navigator.hardwareConcurrency || 2, Object.keys(data.loads).length + 1)));

/* ---- answers, as the server gives them ---- */

function gapOf({gap, diverged, accuracy}, profile) {
  if (!accuracy.isConverged) return {gap: null, diverged: unconverged(accuracy)};
  const text = diverged === null ? '' : `the run diverged at ${diverged.toFixed(3)} s, with the steps of this page`;
  if (!gap) return {gap: null, diverged: text};
  const [moving, fixed] = data.pairs[gap.pair];
  return {
    gap: {distance: 1e3 * gap.distance, time: gap.time, rpm: RPM * speedAt(profile, gap.time), moving, fixed},
    diverged: text,
  };
}

/** Return why the numbers of a run are not shown. */
const unconverged = ({error, step}) => `not converged: with steps of ${inMs(step)} an error of up to ${Number((100 * error).toPrecision(2))} % remains; the command 'spin' takes shorter ones`;
const inMs = (step) => `${Number((1e3 * step).toPrecision(6))} ms`;

function speedAt({time, speed}, t) {
  const k = Math.max(0, Math.min(time.length - 2, time.findIndex((corner) => corner > t) - 1));
  return t >= time.at(-1) ? speed.at(-1) : speed[k] + ((speed[k + 1] - speed[k]) * (t - time[k])) / (time[k + 1] - time[k]);
}

/** Return the corners of an envelope: straight lines from peak to peak. [ms, µm] */
function corners(time, values, sign) {
  const found = [[], []];
  let rise = 0;
  for (let k = 1; k < values.length; k += 1) {
    const step = sign * (values[k] - values[k - 1]);
    if (step > 0) rise = k;
    else if (step < 0 && rise) {
      const at = (rise + k - 1) >> 1;
      found[0].push(1e3 * time[at]);
      found[1].push(1e6 * values[at]);
      rise = 0;
    }
  }
  return found;
}

async function run({state}) {
  const {changes, loads, profile, values} = chosen(state);
  const own = described(state);
  const all = own ? {described: own, ...loads} : loads;
  const first = own ? 'described' : state.load;
  const names = [first, ...Object.keys(loads).filter((name) => name !== first)];
  const found = await Promise.all(names.map((load) => pool.run({
    load, profile, changes: [...changes, ...ofLoad(all[load])], kind: load === first ? 'picture' : 'gap', ...data.drawing,
  })));
  const bad = found.find(({status}) => status < 0);
  if (bad) throw wrong('', NOT_AT_REST[bad.status]);
  const [main] = found;
  const {sensors} = model.count;
  const column = (k) => main.filtered.subarray(k * main.rows, k * main.rows + main.good);
  const isFiltered = main.filtered && !Number.isNaN(main.filtered[0]);
  return {
    envelopes: Array.from({length: sensors}, (_, k) => (isFiltered
      ? {upper: corners(main.time, column(k), 1), lower: corners(main.time, column(k), -1)} : {upper: [[], []], lower: [[], []]})),
    orbits: main.paths ? data.depths.map((y, k) => ({y: 1e3 * y, x: Array.from(main.paths[2 * k], (d) => 1e6 * d), z: Array.from(main.paths[2 * k + 1], (d) => 1e6 * d)})) : [],
    motion: main.motion ? {...main.motion, masses: all[first].unbalances, drum: data.drum} : null,
    duration: profile.time.at(-1),
    profile: {time: profile.time, rpm: profile.speed.map((w) => RPM * w)},
    values, ...gapOf(main, profile),
    gap_points: main.accuracy.isConverged && main.gap && {points: main.gap.points, frame: main.gap.frame},
    loads: names.map((load, k) => ({load, ...gapOf(found[k], profile)})),
    measured: own ? [] : data.measured[state.load][state.gasket ? 'yes' : 'no'] ?? [],
    warnings: [], band: data.band,
    stepping: {integrator: main.accuracy.integrator, step: inMs(main.accuracy.step)},
  };
}

/** Return the job that measures the run of a state. */
function measuringJob(state, kind) {
  const {changes, loads, profile} = chosen(state);
  const own = described(state);
  const load = own ? 'described' : state.load;
  return {load, profile, changes: [...changes, ...ofLoad(own ?? loads[load])], kind};
}

/** Return the rows of the table of measures. */
function rowsOf(found) {
  const value = ({from: [name, index], factor}) => {
    const number = name === 'gap' ? found.gap?.distance : found[name]?.[index];
    return Number.isFinite(number) && found.accuracy.isConverged ? factor * number : null;
  };
  const rows = data.rows.map((row) => ({...row, value: value(row)}));
  for (const row of rows) {
    row.alarm = row.touches && row.value !== null && row.value <= 0;
    if (!found.accuracy.isConverged) row.missing = 'not converged';
  }
  return rows;
}

async function numbers({state}) {
  const found = await pool.run(measuringJob(state, 'numbers'));
  return {rows: rowsOf(found), forces: found.bands ? forces(found) : null, arrows: null};
}

/** Return what each number does when it is moved by a hundredth of its slider, up if it can be. */
async function arrows({state, keys}, isOvertaken) {
  const job = measuringJob(state, 'measures');
  const {values} = chosen(state);
  const before = rowsOf(await pool.run(job, false));
  const found = [];
  for (const key of keys.filter((one) => one in model.places)) {
    const {low, high, value, units, unit} = numberOf.get(key);
    const step = (high - low) / 100;
    for (const sign of [1, -1]) {
      if (isOvertaken()) return {overtaken: true};
      const moved = [model.places[key], ((values[key] ?? value) + sign * step) * units[unit]];
      const answer = await pool.run({...job, changes: [...job.changes, moved]}, false);
      if (answer.status < 0) continue;
      const changes = rowsOf(answer).map((row, k) => (row.value === null || before[k].value === null ? null : sign * (row.value - before[k].value)));
      found.push({key, step, changes});
      break;
    }
  }
  return {arrows: found};
}

function forces({bands, good, time}) {
  const signals = 6 + model.count.mounts + model.count.feet;
  const parts = bands.length / (2 * signals);
  const at = (k) => Math.ceil((k * good) / parts);
  return {
    time: Array.from({length: parts}, (_, k) => 1e3 * time[at(k)]),
    bands: Object.fromEntries(data.forces.map(([name, signal]) => [name, [0, 1].map((side) =>
      Array.from({length: parts}, (_, k) => bands[2 * (signals * k + signal) + side]))])),
  };
}

/** Of each page one request runs and one waits; a new one takes the place of the one that waits. */
const turns = new Map();

function inTurn(page, calculate) {
  const turn = turns.get(page) ?? {running: false, waiting: null};
  turns.set(page, turn);
  const next = async () => {
    if (turn.running || !turn.waiting) return;
    const {work, resolve, reject} = turn.waiting;
    [turn.running, turn.waiting] = [true, null];
    try { resolve(await work(() => Boolean(turn.waiting))); } catch (error) { reject(error); }
    turn.running = false;
    next();
  };
  return new Promise((resolve, reject) => {
    turn.waiting?.resolve({overtaken: true});
    turn.waiting = {work: calculate, resolve, reject};
    next();
  });
}

export async function get(path) {
  if (path.startsWith('machine?')) return machine;
  if (path === 'machines') return {machines: [{id: machine.name, kind: 'exported'}], first: machine.name, begin: data.begin, folder: '', program: data.program};
  throw new Error(`this page has no server: ${path}`);
}

export async function post(path, body) {
  await pool.ready;
  const answer = {run, numbers, arrows, ranking: arrows}[path];
  if (!answer) throw new Error(`this page has no server: ${path}`);
  return inTurn(`${path} ${body.page}`, (isOvertaken) => answer(body, isOvertaken));
}

/* ---- back to the command line ---- */

/** Return the changes of a state as texts by key path, as `--set` takes them. */
function changedTexts(state) {
  const {values, profile} = chosen(state);
  const texts = new Map((data.sets ?? []).map((set) => [set.slice(0, set.indexOf('=')).trim(), set.slice(set.indexOf('=') + 1).trim()]));
  for (const [key, value] of Object.entries(values)) {
    const {unit, kind, value: original} = numberOf.get(key);
    const whole = key.slice(0, key.lastIndexOf('.'));
    if (kind === 'table') texts.set(key, `${digits(100 * (value / original))} %`);
    else if (kind === 'entry') {
      const entries = machine.numbers.filter((other) => other.kind === 'entry' && other.key.startsWith(`${whole}.`));
      texts.set(whole, `(${entries.map((other) => digits(values[other.key] ?? other.value)).join(', ')}) ${unit}`);
    } else texts.set(key, `${digits(value)} ${unit}`.trim());
  }
  const isOther = (name) => profile[name].some((value, k) => value !== data.profile[name][k]);
  if (isOther('time') || isOther('speed')) texts.set('profile.band', `(${data.band.map(digits).join(', ')}) Hz`);
  return texts;
}

const digits = (value) => String(Number(value.toPrecision(12)));

/** Return the node of a tree at a path, made of `base` where it is missing. */
function nodeAt(tree, base, path) {
  let [node, origin] = [tree, base];
  for (const name of path) {
    origin = origin?.[name];
    const isWhole = Array.isArray(origin) || ['force', 'torque', 'time', 'steps'].some((part) => origin && part in origin);
    node[name] ??= isWhole ? JSON.parse(JSON.stringify(origin)) : {};
    node = node[name];
  }
  return node;
}

/** Return the ordinates of a table, a text or one with its source, times a factor. */
const scaled = (column, factor) => (column.value ?? column).replace(/[-+]?[\d.]+(?:e[-+]?\d+)?(?=[,)])/gi, (number) => digits(factor * Number(number)));

/** Return the command that runs a state, and a machine file with what differs. */
export function take(state) {
  const texts = changedTexts(state);
  const quoted = (text) => `'${text.replaceAll("'", "'\\''")}'`;
  const sets = [...texts].map(([key, text]) => ` --set ${quoted(`${key}=${text}`)}`);
  const tree = {extends: data.given, name: `${machine.name}_changed`, about: `${machine.name}, changed on its page`.slice(0, 300)};
  for (const [key, text] of texts) {
    const path = key.split('.');
    const last = path.pop();
    const node = nodeAt(tree, data.tree, path);
    if (!text.endsWith('%')) node[last] = text === 'null' ? null : text;
    else {
      const table = nodeAt(node, nodeIn(data.tree, path), [last]);
      for (const name of ['force', 'torque']) if (name in table) table[name] = scaled(table[name], parseFloat(text) / 100);
    }
  }
  if (state.masses.length) tree.loads = {described: {unbalances: state.masses}};
  if (!state.gasket) tree.gasket = null;
  const load = state.masses.length ? '' : ` --load ${quoted(state.load)}`;
  return {
    command: `wm-drake spin --machine ${quoted(data.given)}${load}${state.gasket ? '' : ' --no-gasket'}${sets.join('')}`,
    file: `${JSON.stringify(tree, null, 1)}\n`, name: `${machine.name}_changed.yaml`,
  };
}

const nodeIn = (tree, path) => path.reduce((node, name) => node?.[name], tree);
