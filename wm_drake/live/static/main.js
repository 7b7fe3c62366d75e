// The page: one state, one answer drawn, the machine as it was behind it.

import {BandPanel, OrbitPanel, TimeRange, roundUp} from './curves.js';
import {byId, digits, fixed, make} from './dom.js';
import {History, copyOf, fromLink, intoLink} from './history.js';
import {showMeasures} from './measures.js';
import {NumberList} from './numbers.js';
import {SceneView} from './scene.js';
import {ProfilePanel} from './profile.js';
import {Problems, get, post, take} from './server.js';
import {Studies} from './studies.js';
import {showVerdict, smallestGap, worstFirst} from './verdict.js';

const PAGE = crypto.randomUUID?.() ?? `page ${Math.random()}`; // a frame from a file has no UUIDs
const MASS = {mass: '0.5 kg', radius: '235 mm', y: '0 mm', phase: '0 deg'};
const MOST_VARIANTS = 4;
const DESCRIBED = '— described —';
const QUIET = 80;      // ms without a move after which the numbers to a picture are asked for

const history_ = new History();
const list = new NumberList(byId('numbers'), move);
const scene = new SceneView(byId('scene'));
const profile = new ProfilePanel(byId('profile'), moveProfile);
const times = {envelopes: new TimeRange(), forces: new TimeRange()};
const panels = {envelopes: new Map(), forces: new Map(), orbits: []};

let state = null;      // what is chosen, as the server reads it
let machine = null;    // the opened machine
let answer = null;     // the answer that is drawn: a picture, and the latest numbers
let ghost = null;      // the answer of the machine as it was, with the same load
let variants = [];     // {name, state, answer}
let turned = [];       // keys of the seven numbers
let ranking = [];      // arrows of all numbers
let rankedOf = '';     // the state for which they were computed, as JSON
let studies = null;    // the studies of the server, null without one
let asked = 0;         // number of the latest request
let settled = 0;       // number of the latest request that has a picture or a problem
let drawn = 0;         // number of the request whose picture is drawn
let numbered = 0;      // number of the request whose numbers are shown
let pending = 0;       // how many requests wait for an answer
let opening = false;   // whether another machine is being opened
let refused = '';      // why the machine as it is now has not run, '' if it has
let notice = '';       // what a link has that is not here
let keyed = null;      // the slider or the choice that keys move, until something else is used

/* ---- what is chosen ---- */

function move(key, text, final) {
  if (text === null) delete state.values[key];
  else state.values[key] = text;
  changed(final ? (text === null ? `${list.nameOf(key)} as it was` : `${list.nameOf(key)} ${text}`) : null);
}

/** Move corners of the spin profile, which are numbers of the list too: [key, text] of each. */
function moveProfile(corners, final) {
  for (const [key, text] of corners) state.values[key] = text;
  changed(final ? 'spin profile' : null);
}

/** Run the new state; `what` names it in the history, null while a slider moves. */
function changed(what) {
  if (what !== null) {
    history_.add(what, state, keyed);
    intoLink(state, variants);
    showHistory();
  }
  list.show(state.values, answer?.values);
  showLoad();
  run();
}

async function setState(wanted) {
  const other = !state || wanted.machine !== state.machine;
  const loads = JSON.stringify([wanted.load, wanted.masses, wanted.gasket]);
  const before = state && JSON.stringify([state.load, state.masses, state.gasket]);
  const next = copyOf(wanted);
  if (other) await openMachine(next);
  else state = next;
  intoLink(state, variants);
  showHistory();
  list.forget();
  list.show(state.values, answer?.values);
  showLoad();
  if (other || loads !== before) { runGhost(); rank(); }
  await run();
}

/** Open the machine of a state, which then is that of the page; until then the one before is pale. */
async function openMachine(next) {
  status('opening …');
  opening = true;
  showWhetherOld();
  const opened = await get(`machine?id=${encodeURIComponent(next.machine)}`);
  if (!next.masses.length && !opened.loads.includes(next.load)) {
    if (next.load) notice = `the machine has no load '${next.load}'; the load with the smallest gap is opened`;
    next.load = await loadThatDecides(opened.loads[0], next);
  }
  machine = opened;
  state = next;
  opening = false;
  list.fill(machine.numbers, machine.parts);
  scene.shapes(machine.shapes);
  turned = [];
  ranking = [];
  byId('machine').value = state.machine;
  byId('about').textContent = `${machine.name}: ${machine.about}`;
  byId('load').replaceChildren(...[...machine.loads, DESCRIBED].map((name) => make('option', {value: name}, name)));
  byId('gasket').disabled = !machine.gasket;
  byId('rings').hidden = !machine.rings.length;
  document.title = `${machine.name} – wm-drake`;
  makePanels();
  search();
}

/** Return the load with the smallest gap; the first one if the machine does not run. */
async function loadThatDecides(first, next) {
  try {
    return worstFirst(await post('run', {page: `${PAGE} loads`, state: {...next, load: first}}))[0].load;
  } catch { return first; } // the run itself shows the problem
}

/** Say in words which load curves and tables have. */
const loadWords = (of) => (of.masses.length ? 'the described load' : `load ${of.load}`);

function showLoad() {
  for (const place of document.querySelectorAll('.with-load')) place.textContent = ` with ${loadWords(state)}`;
  byId('load').value = state.masses.length ? DESCRIBED : state.load;
  byId('gasket').checked = state.gasket && machine.gasket;
  byId('described').hidden = !state.masses.length;
  const shown = JSON.stringify(state.masses);
  if (byId('masses').dataset.shown !== shown) {
    byId('masses').dataset.shown = shown;
    byId('masses').replaceChildren(...state.masses.map(massRow));
  }
  byId('undo').disabled = history_.place <= 0;
  byId('redo').disabled = history_.place >= history_.entries.length - 1;
}

function massRow(mass, index) {
  const fields = Object.keys(MASS).flatMap((name) => [
    make('span', {}, name),
    make('input', {value: mass[name], 'data-mass': `${index}.${name}`, spellcheck: 'false', 'aria-label': `${name} of mass ${index + 1}`, onchange: (event) => {
      state.masses[index][name] = event.target.value;
      chooseLoad(`mass ${index + 1}: ${name} ${event.target.value}`);
    }}),
  ]);
  const remove = make('button', {onclick: () => {
    state.masses.splice(index, 1);
    chooseLoad('a mass less');
  }}, 'remove');
  return make('div', {class: 'mass'}, ...fields, remove, make('div', {class: 'problem', role: 'alert', 'data-problem': `masses.${index}`}));
}

function chooseLoad(what) {
  changed(what);
  runGhost();
  rank();
}

/* ---- running ---- */

async function run() {
  const number = ++asked;
  for (const id of ['save-result', 'taken', 'command']) byId(id).textContent = ''; // of the state before
  byId('replace').hidden = true;
  showWhetherOld();
  showPlace(number);
  await busyWith(async () => {
    await runPicture(number);
    await runNumbers(number);
  });
}

async function runPicture(number) {
  const begin = performance.now();
  try {
    const found = await post('run', {page: PAGE, state});
    if (found.overtaken || number < drawn) return;
    drawn = number;
    answer = {...answer, ...found};
    refused = '';
    showPicture();
    requestAnimationFrame(() => performance.mark('picture')); // read by analyses/time_page.py
    showProblems([], found.warnings);
    status(`${fixed(performance.now() - begin, 0)} ms · ${found.stepping.integrator}, steps of ${found.stepping.step}${machine.fastest && `, short for ${machine.fastest}`}`);
  } catch (error) {
    if (number === asked) showRefusal(error);
  } finally {
    settled = Math.max(settled, number);
  }
}

/** Ask for the numbers to a picture, unless a later one is asked for meanwhile. */
async function runNumbers(number) {
  if (number === drawn) await new Promise((resolve) => setTimeout(resolve, QUIET));
  if (number !== asked || number !== drawn) return;
  try {
    const found = await post('numbers', {page: PAGE, state, keys: turned});
    if (found.overtaken || number !== asked) return;
    numbered = number;
    answer = {...answer, ...found, arrows: found.arrows ?? []};
    showNumbers();
    if (!found.arrows && turned.length) await runArrows(number);
  } catch { /* what is wrong is shown by the run itself */ }
}

/** Ask for the arrows of the seven numbers, which an engine may answer behind the numbers. */
async function runArrows(number) {
  const found = await post('arrows', {page: PAGE, state, keys: turned});
  if (found.overtaken || number !== asked) return;
  answer.arrows = found.arrows;
  showNumbers();
}

/** Tell readers of the page, also those of a screen reader, whether an answer is under way. */
async function busyWith(work) {
  const show = () => document.body.setAttribute('aria-busy', String(pending > 0));
  pending += 1;
  show();
  await work();
  pending -= 1;
  show();
}

/** Return a complete answer: its picture and its numbers. */
async function wholeAnswer(page, of) {
  const body = {page: `${PAGE} ${page}`, state: of};
  return {...await post('run', body), ...await post('numbers', body)};
}

/** Show how many runs come before the last one, while it waits. */
async function showPlace(number) {
  await new Promise((resolve) => setTimeout(resolve, 1000));
  if (settled >= number || number !== asked) return;
  try {
    const {place} = await get(`place?page=${encodeURIComponent(PAGE)}`);
    if (place && number === asked && settled < number) status(`${place} runs come first`);
  } catch { return; } // the run itself shows that the server does not answer
  showPlace(number);
}

async function runGhost() {
  const as = {...state, values: {}, gasket: true};
  const wanted = JSON.stringify(as);
  if (runGhost.wanted !== wanted) ghost = null; // that of another load
  runGhost.wanted = wanted;
  try {
    const found = await wholeAnswer('ghost', as);
    if (found.overtaken || runGhost.wanted !== wanted) return;
    ghost = found;
    if (answer) showAnswer();
  } catch { ghost = null; } // the problem is shown by the run itself
}

async function rank() {
  const as = copyOf(state);
  byId('rank').disabled = true;
  try {
    const found = await post('ranking', {page: PAGE, state: as, keys: machine.numbers.filter((of) => isDesigned(of, as)).map(({key}) => key)});
    if (found.overtaken) return;
    if (as.machine === state.machine) {
      ranking = found.arrows;
      rankedOf = JSON.stringify(as);
    }
    chooseTurned();
  } catch { /* a wrong number is shown by the run itself */ }
  byId('rank').disabled = false;
}

/** Keys of numbers that a design does not choose: no influence is ranked for them. */
const NOT_DESIGNED = /^(loads|profile|sensors|imperfections|measured|step|output_period|cabinet)\b|^bodies\.(?!\w*counterweight)|^frames\.\w*_(child|parent)\./;

const isDesigned = ({key, needs}, {gasket}) => !needs && !NOT_DESIGNED.test(key) && (gasket || !key.startsWith('gasket.'));

/** Take the seven numbers of the design that change the chosen measure most. */
function chooseTurned() {
  if (!answer?.rows) return;
  const kind = byId('rank-by').value;
  const size = (of) => Math.max(0, ...of.changes.map((value, place) => (answer.rows[place]?.kind === kind ? Math.abs(value ?? 0) : 0)));
  const influences = ranking.map((of) => ({key: of.key, size: size(of)})).filter((of) => of.size > 0);
  influences.sort((a, b) => b.size - a.size);
  turned = influences.slice(0, 7).map((of) => of.key);
  busyWith(() => runNumbers(asked));
}

/** Offer every kind of measure of the machine for the choice of the seven numbers. */
function offerKinds() {
  const choice = byId('rank-by');
  const kinds = [...new Set(answer.rows.map((row) => row.kind))];
  if (kinds.join() === [...choice.options].map((one) => one.value).join()) return;
  choice.replaceChildren(...kinds.map((kind) => make('option', {value: kind}, kind)));
  if (ranking.length) chooseTurned();
}

/* ---- drawing ---- */

function makePanels() {
  for (const kind of ['envelopes', 'forces', 'orbits', 'measures', 'variants']) byId(kind).replaceChildren();
  for (const range of Object.values(times)) { range.panels.clear(); range.range = null; }
  panels.envelopes = new Map(Object.keys(machine.sensors).map((name) => [name, new BandPanel(byId('envelopes'), name, 'mm', times.envelopes)]));
  panels.forces = new Map();
  panels.orbits = ['front', 'rear'].map((name) => new OrbitPanel(byId('orbits'), name));
  scene.clear();
  byId('frame-time').textContent = '';
  profile.show(machine.numbers, {});
  answer = ghost = null;
  drawn = ++asked; // answers of the machine before are overtaken
  refused = '';
  verdict();
}

const envelopeBand = (sides) => ({
  upper: [sides.upper[0].map((t) => t / 1000), sides.upper[1].map((v) => v / 1000)],
  lower: [sides.lower[0].map((t) => t / 1000), sides.lower[1].map((v) => v / 1000)],
});

const sizeOf = (bands) => Math.max(0, ...bands.map((band) => band
  ? Math.max(...band.upper[1].map(Math.abs), ...band.lower[1].map(Math.abs), 0) : 0));

function showAnswer() {
  if (!answer) return;
  showPicture();
  showNumbers();
}

function showPicture() {
  verdict();
  list.show(state.values, answer.values);
  profile.show(machine.numbers, {...state.values}, answer.values);
  showEnvelopes();
  showOrbits();
  showMotion();
  showWhetherOld();
}

function showNumbers() {
  if (!answer.rows) return;
  offerKinds();
  showMeasures(byId('measures'), answer, ghost, labelOf);
  showForces();
  showVariants();
  showWhetherOld();
}

/** Show what is not that of the machine as it is now paler: table and forces follow the picture. */
function showWhetherOld() {
  const isOld = opening || Boolean(refused) || drawn < asked;
  for (const id of ['measures', 'forces', 'variants']) byId(id).classList.toggle('old', isOld || numbered < asked);
  for (const id of ['envelopes', 'profile', 'orbits', 'scene', 'frame-time']) byId(id).classList.toggle('old', isOld);
  byId('numbers').classList.toggle('old', opening);
  byId('verdict').classList.toggle('old', opening || (isOld && !refused)); // a refusal says what its numbers are of
  byId('ranked').hidden = !ranking.length || rankedOf === JSON.stringify(state);
  studies?.showWhetherOld(isOld ? '' : answer?.mark);
}

const verdict = () => showVerdict(byId('verdict'), answer, ghost, refused, showOtherLoad);

function showOtherLoad(name) {
  byId('load').value = name;
  byId('load').dispatchEvent(new Event('change'));
}

function showEnvelopes() {
  byId('band').textContent = `, ${answer.band.map((end) => digits(end, 3)).join('–')} Hz`;
  const names = [...panels.envelopes.keys()];
  const bands = (of) => (of?.envelopes?.length ? of.envelopes.map(envelopeBand) : []);
  const now = bands(answer);
  const was = bands(ghost);
  const others = variants.map((variant, index) => ({index, bands: bands(variant.answer)})).filter((of) => of.bands.length);
  const experiments = answer.measured.filter(({source}) => source === 'experiment');
  const measured = (name) => experiments.map((of) => of.amplitude[name]);
  const size = sizeOf([...now, ...was, ...others.flatMap((of) => of.bands)]);
  const limit = roundUp(Math.max(size, ...names.flatMap(measured)));
  times.envelopes.end = answer.duration || 1;
  names.forEach((name, index) => {
    const panel = panels.envelopes.get(name);
    panel.show({
      now: now[index] ?? {upper: [[], []], lower: [[], []]},
      ghost: was[index],
      variants: others.map((of) => ({index: of.index, band: of.bands[index]})),
      measured: measured(name), low: -limit, high: limit,
      rpm: [answer.profile.time, answer.profile.rpm],
    });
  });
}

function showForces() {
  if (!answer.forces) return;
  times.forces.end = answer.duration || 1;
  const names = Object.keys(answer.forces.bands);
  if (names.join() !== [...panels.forces.keys()].join()) {
    byId('forces').replaceChildren();
    times.forces.panels.clear();
    panels.forces = new Map(names.map((name) => [name, new BandPanel(byId('forces'), name, name.startsWith('gasket M') ? 'N m' : 'N', times.forces)]));
  }
  const band = (of, name) => {
    const found = of?.forces?.bands[name];
    const time = found && of.forces.time.map((t) => t / 1000);
    return found ? {lower: [time, found[0]], upper: [time, found[1]]} : null;
  };
  for (const name of names) {
    const now = band(answer, name);
    const was = band(ghost, name);
    const limit = roundUp(sizeOf([now, was]));
    const isSize = /^(mount|foot)/.test(name);
    panels.forces.get(name).show({now, ghost: was, low: isSize ? 0 : -limit, high: limit, rpm: [answer.profile.time, answer.profile.rpm]});
  }
}

function showOrbits() {
  const both = [...answer.orbits, ...(ghost?.orbits ?? [])];
  const limit = roundUp(Math.max(0.1, ...both.flatMap((of) => [...of.x, ...of.z]).map((v) => Math.abs(v) / 1000)));
  const names = answer.orbits.length < 2 ? ['drum axis'] : ['front', 'rear']; // one: all sensors in one plane
  panels.orbits.forEach((panel, index) => {
    panel.title = names[index];
    panel.svg.style.display = answer.orbits[index] ? '' : 'none';
    if (answer.orbits[index]) panel.show(answer.orbits[index], ghost?.orbits?.[index], limit);
  });
}

/* ---- the view of the tub ---- */

let frame = -1; // -1: the pose of the smallest gap
let player = null;

function showMotion() {
  const {motion} = answer;
  if (!motion) return;
  byId('frame').max = String(motion.time.length - 1);
  byId('at-gap').disabled = !answer.gap_points;
  const gap = answer.gap_points && {...answer.gap_points, distance: answer.gap.distance};
  if (frame < 0 && gap) {
    showFrame(gap.frame, gap, `${fixed(answer.gap.time, 2)} s, ${fixed(answer.gap.rpm, 0)} rpm: ${answer.gap.moving} to ${answer.gap.fixed}`);
    return;
  }
  const at = Math.min(Math.max(frame, 0), motion.time.length - 1);
  byId('frame').value = String(at);
  showFrame(motion.frames[at], null, `${fixed(motion.time[at], 2)} s`);
}

function showFrame(frameAt, gap, words) {
  scene.show(frameAt, {...answer.motion, rings: rings(), density: machine.density}, gap, words);
  byId('frame-time').textContent = words;
}

/** Return the rings on the drum of the machine that is drawn, in metres. */
function rings() {
  const number = (key) => {
    const {value, factor} = list.rows.get(key).number;
    return (answer.values[key] ?? value) * factor;
  };
  return machine.rings.map(({y, across, radii, isLiquid}) => ({y: number(y), across: number(across), radii: radii.map(number), isLiquid}));
}

function play() {
  if (player) {
    clearInterval(player);
    player = null;
  } else {
    player = setInterval(() => {
      if (!answer?.motion) return;
      frame = (Math.max(frame, 0) + 1) % answer.motion.time.length;
      showMotion();
    }, 1000 / 32);
  }
  byId('play').textContent = player ? 'stop' : 'play';
}

/* ---- problems, names ---- */

/** Say why the machine as it is now has not run; what is drawn is that of the last one that ran. */
function showRefusal(error) {
  const problems = error instanceof Problems ? error.problems : [{key: '', message: error.message}];
  const more = problems.length > 1 ? ` (and ${problems.length - 1} more)` : '';
  const [{key, message}] = problems;
  refused = `${key ? `${list.nameOf(key)}: ` : ''}${message}${more}`;
  verdict();
  showWhetherOld();
  showProblems(problems);
  status('not run');
}

function showProblems(problems, warnings = []) {
  for (const element of byId('masses').querySelectorAll('.problem')) element.textContent = '';
  const left = list.problems(problems, warnings).filter(({key, message}) => {
    const place = byId('masses').querySelector(`[data-problem="${CSS.escape(key.split('.').slice(0, 2).join('.'))}"]`);
    if (!place) return true;
    place.textContent = `${key.split('.').slice(2).join('.')}: ${message}`;
    return false;
  });
  const texts = left.map(({key, message}) => (key ? `${list.nameOf(key)}: ${message}` : message));
  if (notice) texts.push(notice);
  if (answer?.diverged) texts.push(answer.diverged);
  byId('problems').hidden = texts.length === 0;
  if (byId('problems').dataset.shown === texts.join('\n')) return; // it is not read out once more
  byId('problems').dataset.shown = texts.join('\n');
  byId('problems').replaceChildren(...texts.map((text) => make('div', {}, text)));
}

function labelOf(key) {
  const number = list.rows.get(key)?.number;
  return number ? {name: number.short, unit: number.unit} : {name: key, unit: ''};
}

const status = (text) => { byId('status').textContent = text; };
const search = () => list.search(byId('search').value, byId('only-moved').checked);

/* ---- history, variants, saving ---- */

function showHistory() {
  byId('history').replaceChildren(...history_.entries.map(({what}, index) =>
    make('li', {class: index === history_.place ? 'here' : ''},
      make('button', {onclick: () => setState(history_.go(index))}, what))));
}

/** Show the variants beside the machine as it is now; each column has a load of its own. */
function showVariants() {
  const columns = [{name: 'now', state, answer}, ...variants];
  const largest = (of, group) => (of.answer ? Math.max(...of.answer.rows.filter((row) => row.group === group).map((row) => row.value ?? -Infinity)) : null);
  const cell = (value, decimals) => ({text: Number.isFinite(value) ? fixed(value, decimals) : '–', alarm: false});
  const rows = new Map([
    ['smallest gap of all loads, mm', (of) => (of.answer ? smallestGap(of.answer) : cell(null))],
    ['all below with the load', (of) => ({text: `${of.answer?.loads[0].load ?? '–'}${of.state.gasket ? '' : ', no gasket'}`})],
  ]);
  const found = (of, title) => of.answer?.rows.find((row) => row.title === title);
  answer.rows.forEach((row) => {
    if (!row.group) rows.set(row.title, (of) => ({...cell(found(of, row.title)?.value, row.decimals), alarm: found(of, row.title)?.alarm}));
    else if (!rows.has(row.group)) rows.set(row.group, (of) => cell(largest(of, row.group), row.decimals));
  });
  const what = (of) => [of.state.machine, loadWords(of.state), of.state.gasket ? '' : 'no gasket',
    ...Object.entries(of.state.values).map(([key, text]) => `${key} = ${text}`)].filter(Boolean).join('; ');
  const head = columns.map((of, index) => (index === 0 ? make('th', {}, 'now') : make('th', {title: what(of)},
    make('span', {class: `dot v${index - 1}`}), of.name,
    make('button', {title: 'go back to this variant', onclick: () => goTo(`variant ${of.name}`, of.state)}, 'open'),
    make('button', {'aria-label': `remove ${of.name}`, onclick: () => removeVariant(of)}, '×'))));
  const drawnCell = ({text, alarm}) => make('td', {class: alarm ? 'alarm' : ''}, text);
  byId('variants').replaceChildren(
    make('thead', {}, make('tr', {}, make('th', {}), ...head)),
    make('tbody', {}, ...[...rows].map(([title, value]) => make('tr', {}, make('th', {}, title), ...columns.map((of) => drawnCell(value(of)))))));
  byId('keep').disabled = variants.length >= MOST_VARIANTS || !answer;
}

function goTo(what, wanted) {
  history_.add(what, wanted);
  setState(wanted).catch(fail);
}

function keepVariant() {
  const names = new Set(variants.map((of) => of.name));
  const name = [...'ABCD'].find((letter) => !names.has(letter));
  variants.push({name, state: copyOf(state), answer: numbered === asked ? answer : null});
  intoLink(state, variants);
  runVariants();
}

function removeVariant(variant) {
  variants = variants.filter((of) => of !== variant);
  intoLink(state, variants);
  showAnswer();
}

async function runVariants() {
  for (const variant of variants.filter((of) => !of.answer)) {
    try {
      const found = await wholeAnswer(variant.name, variant.state);
      variant.answer = found.overtaken ? null : found;
    } catch { variant.answer = null; } // its machine is gone: the table shows dashes
  }
  showAnswer();
}

async function save(overwrite) {
  byId('replace').hidden = true;
  try {
    const {saved} = await post('save', {state, name: byId('save-name').value.trim(), overwrite});
    byId('save-result').textContent = `saved as ${saved}`;
    await listMachines();
  } catch (error) {
    byId('save-result').textContent = error.message;
    byId('replace').hidden = error.exists !== true;
  }
}

/* ---- a page without a server ---- */

async function copyCommand() {
  const {command} = take(state);
  byId('command').textContent = command;
  try {
    await navigator.clipboard.writeText(command);
    byId('taken').textContent = 'the command is copied';
  } catch { byId('taken').textContent = 'copy the command below'; }
}

function download() {
  const {file, name} = take(state);
  const url = URL.createObjectURL(new Blob([file], {type: 'text/yaml'}));
  make('a', {href: url, download: name}).click();
  URL.revokeObjectURL(url);
  byId('taken').textContent = `saved as ${name}`;
}

async function listMachines() {
  const found = await get('machines');
  byId('machine').replaceChildren(...found.machines.map(({id, kind}) =>
    make('option', {value: id}, id === 'given' ? 'the given file' : `${id} (${kind})`)));
  if (state) byId('machine').value = state.machine;
  byId('folder').textContent = found.folder;
  byId('program').textContent = found.program;
  return found;
}

/* ---- beginning ---- */

function listen() {
  byId('copy').hidden = location.protocol === 'blob:'; // in a report: no address leads there
  byId('machine').addEventListener('change', (event) => {
    notice = '';
    const next = {machine: event.target.value, values: {}, load: '', masses: state.masses, gasket: true};
    setState(next).then(() => { history_.add(`open ${state.machine}`, state); showHistory(); showLoad(); }, fail);
  });
  byId('load').addEventListener('change', (event) => {
    const described = event.target.value === DESCRIBED;
    state.masses = described ? [{...MASS}] : [];
    if (!described) state.load = event.target.value;
    chooseLoad(described ? 'a described load' : `load ${state.load}`);
  });
  byId('gasket').addEventListener('change', (event) => {
    state.gasket = event.target.checked;
    chooseLoad(state.gasket ? 'gasket in' : 'gasket out');
  });
  byId('add-mass').addEventListener('click', () => {
    state.masses.push({...MASS});
    chooseLoad('one more mass');
  });
  byId('undo').addEventListener('click', () => setState(history_.go(history_.place - 1)));
  byId('redo').addEventListener('click', () => setState(history_.go(history_.place + 1)));
  byId('reset').addEventListener('click', () => { state.values = {}; changed('all as it was'); });
  byId('copy').addEventListener('click', async () => {
    intoLink(state, variants);
    try {
      await navigator.clipboard.writeText(location.href);
      status('the link is copied');
    } catch { status('copy the address of this page: it is the link'); }
  });
  // moves by keys are one entry of the history until something else is used
  document.addEventListener('keydown', ({target}) => { keyed = target.matches('input[type=range], select') ? target : null; });
  for (const kind of ['pointerdown', 'focusout']) document.addEventListener(kind, () => { keyed = null; });
  document.addEventListener('keydown', (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.target.matches('input:not([type=range])')) return;
    if (event.key === 'z' && !event.shiftKey) { event.preventDefault(); byId('undo').click(); }
    if (event.key === 'y' || (event.key.toLowerCase() === 'z' && event.shiftKey)) { event.preventDefault(); byId('redo').click(); }
  });
  byId('search').addEventListener('input', search);
  byId('only-moved').addEventListener('change', search);
  byId('rank-by').addEventListener('change', chooseTurned);
  byId('rank').addEventListener('click', rank);
  byId('keep').addEventListener('click', keepVariant);
  byId('save').addEventListener('click', () => save(false));
  byId('replace').addEventListener('click', () => save(true));
  byId('copy-command').addEventListener('click', copyCommand);
  byId('download').addEventListener('click', download);
  byId('play').addEventListener('click', play);
  byId('frame').addEventListener('input', (event) => { frame = Number(event.target.value); showMotion(); });
  byId('at-gap').addEventListener('click', () => { if (player) play(); frame = -1; showMotion(); });
  window.addEventListener('hashchange', () => {
    const linked = fromLink();
    if (linked) { variants = linked.variants; history_.add('a link', linked.state); setState(linked.state).then(runVariants, fail); }
  });
}

const fail = (error) => {
  opening = false;
  if (state) byId('machine').value = state.machine;
  showRefusal(error);
  status('not opened');
};

async function begin() {
  listen();
  const found = await listMachines();
  const linked = fromLink();
  const fresh = {machine: found.first, values: {}, load: '', masses: [], gasket: true, ...found.begin};
  variants = linked?.variants ?? [];
  const wanted = {...fresh, ...linked?.state};
  if (!found.machines.some(({id}) => id === wanted.machine)) {
    notice = `the machine '${wanted.machine}' of the link is not here; '${found.first}' is opened`;
    wanted.machine = found.first;
  }
  await setState(wanted);
  history_.add('begin', state);
  showHistory();
  showLoad();
  await runVariants();
  if (!found.studies) return;
  studies = new Studies(found.studies, () => state, goTo);
  showWhetherOld();
}

begin().catch(fail);
