// What stands beside the sliders: contact and gap with every load, and whether this is up to date.

import {fixed, make} from './dom.js';

const touches = ({gap, diverged}) => Boolean(diverged || (gap && gap.distance <= 0));

const sizeOf = ({gap, diverged}) => (diverged ? -Infinity : gap?.distance ?? Infinity);

/** Return the gaps with all loads of an answer, the smallest first; a run that diverged leads. */
export const worstFirst = ({loads}) => [...loads].sort((a, b) => sizeOf(a) - sizeOf(b));

const gapText = ({gap, diverged}) => (diverged ? FAILED(diverged) : fixed(gap?.distance));
const FAILED = (why) => (why.startsWith('not converged') ? 'not converged' : 'diverged');

/** Return the smallest gap of all loads in words, and whether the tub touches with that load. */
export function smallestGap(answer) {
  const [first] = worstFirst(answer);
  return {text: first.gap || first.diverged ? `${gapText(first)} (${first.load})` : '–', alarm: touches(first)};
}

/**
 * Say whether the tub touches the housing: the load that decides comes first.
 *
 * `refused` says why the machine as it is now has not run, '' if it has; `show(load)` shows a load.
 */
export function showVerdict(box, answer, ghost, refused, show) {
  const parts = refused ? [make('p', {class: 'refused'}, make('strong', {}, 'Not run'), refused)] : [];
  if (refused && answer) parts.push('The last machine that ran: ');
  if (answer) parts.push(...contact(answer, ghost, show));
  box.classList.toggle('alarm', Boolean(answer) && worstFirst(answer).some(touches));
  box.replaceChildren(...parts);
}

function contact(answer, ghost, show) {
  const [chosen] = answer.loads;
  const all = worstFirst(answer);
  const [first] = all;
  if (first.diverged) return [`The run with load ${first.load} ${FAILED(first.diverged) === 'diverged' ? 'diverged' : 'is not converged'}: no answer.`];
  if (!first.gap) return ['The machine has no shapes: no gap is known.'];
  const distance = fixed(first.gap.distance);
  const which = all.length > 1 ? ` with load ${first.load}` : '';
  return [
    make('strong', {}, touches(first) ? `The tub touches${which}: ${distance} mm` : `No contact: gap ${distance} mm${which}`),
    `${first.gap.moving} to ${first.gap.fixed} at ${fixed(first.gap.rpm, 0)} rpm`,
    make('span', {class: 'loads'}, ...(all.length > 1 ? all : []).map((of) => gapOfLoad(of, of === chosen, ghost, show))),
  ];
}

/** Return a button with the gap of a load, which shows that load. */
function gapOfLoad(of, isChosen, ghost, show) {
  const before = ghost?.loads.find(({load}) => load === of.load);
  const change = before && gapText(before) !== gapText(of) ? `, was ${gapText(before)}` : '';
  return make('button', {
    class: touches(of) ? 'alarm' : '', 'aria-pressed': String(isChosen),
    title: `show load ${of.load}`, onclick: () => { if (!isChosen) show(of.load); },
  }, `${of.load} ${gapText(of)}${change}`);
}
