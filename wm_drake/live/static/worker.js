// A worker of a page without a server: it runs one load at a time and keeps the samples of the last.

import {Machine} from './machine.js';

const FRAMES = 300;   // most frames of the motion around the largest amplitude
const BINS = 350;     // parts of a run of which forces have a smallest and a largest value
const DRUM_ANGLE = 6; // index in a sample

let machine = null;
let last = '';        // changes and profile of the run whose samples are kept
let status = 0;

const sampleAt = (row, size) => Array.from(machine.view(machine.samples + 8 * row * machine.model.sample, size));

/** Return pose of the tub, angle of the drum, and balls of each ring, in a sample. */
function frameAt(row) {
  const {sample, balls} = machine.model;
  const x = sampleAt(row, sample);
  return {pose: x.slice(0, DRUM_ANGLE), angle: x[DRUM_ANGLE], balls: balls.map((ring) => ring.map((k) => x.slice(k, k + 3)))};
}

function prepare({changes, profile}) {
  const wanted = JSON.stringify([changes, profile]);
  if (wanted === last) return;
  last = wanted;
  status = machine.setUp(changes);
  if (status === 0) machine.run(profile);
}

/** Return times and frames around a sample. */
function motionAround(largest, {span, rate}) {
  const {time} = machine.schedule;
  const period = time[1] - time[0];
  const half = Math.floor((0.5 * span) / period + 1e-9);
  const stride = Math.max(1, Math.round(1 / (rate * period)));
  const found = {time: [], frames: []};
  for (let row = Math.max(0, largest - half); row < machine.good && row <= largest + half && found.time.length < FRAMES; row += stride) {
    found.time.push(time[row]);
    found.frames.push(frameAt(row));
  }
  return found;
}

/** Return the first sample of an orbit around a sample, and the one behind its last. */
function orbitAround(largest, {revolutions, longest}) {
  const {time} = machine.schedule;
  const angle = (row) => sampleAt(row, DRUM_ANGLE + 1)[DRUM_ANGLE];
  const middle = angle(largest);
  const isShown = (row) => row >= 0 && row < machine.good
    && Math.abs(angle(row) - middle) <= Math.PI * revolutions && Math.abs(time[row] - time[largest]) <= 0.5 * longest;
  let [begin, end] = [largest, largest + 1];
  while (isShown(begin - 1)) begin -= 1;
  while (isShown(end)) end += 1;
  return [begin, end];
}

function picture({orbits, replay}) {
  const {rows, good, model: {count}} = machine;
  const {filtered, sizes, places} = machine.amplitudes();
  const first = sizes.reduce((best, size, k) => (size > sizes[best] ? k : best), 0);
  const largest = Number.isNaN(sizes[first]) ? good - 1 : places[first];
  const window = orbitAround(largest, orbits);
  const paths = [];
  for (let k = count.sensors + 3; k < count.points; k += 1) {
    paths.push(machine.view(machine.moved + 8 * k * rows, rows).slice(...window));
  }
  return {filtered, paths, largest, motion: motionAround(largest, replay)};
}

function measures() {
  const {model: {at, count}} = machine;
  return {
    sizes: machine.amplitudes().sizes,
    extremes: machine.view(machine.v + 8 * at.extremes, count.points + 6).slice(),
    mounts: machine.mounts(),
  };
}

/** Return what a job asks for: the gap, and "picture", "measures", "numbers" (with forces) or "samples". */
export function answer(job) {
  prepare(job);
  if (status < 0) return {status};
  const {good, rows, schedule: {time}} = machine;
  const gap = good > 0 ? machine.gap() : null;
  const more = good > 1 && job.kind === 'picture' ? picture(job) : {};
  return {
    status, good, time: job.kind === 'gap' ? [] : Array.from(time.slice(0, good)), rows,
    diverged: good < rows ? time[good] : null,
    accuracy: machine.accuracy,
    gap: gap && {...gap, time: time[gap.row], frame: frameAt(gap.row)},
    ...more, ...(good > 1 && ['numbers', 'measures'].includes(job.kind) ? measures() : {}),
    ...(good > 1 && job.kind === 'numbers' ? {bands: machine.forces(Math.min(BINS, good))} : {}),
    ...(job.kind === 'samples' ? {moved: machine.view(machine.moved, rows * machine.model.count.points).slice()} : {}),
  };
}

export const begin = ({module, model}) => { machine = new Machine(module, model); };
