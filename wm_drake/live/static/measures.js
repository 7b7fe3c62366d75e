// The table of measures: now, as it was, measured, and the arrows of the seven numbers.

import {digits, fixed, make} from './dom.js';

function arrow(change, largest, step) {
  if (change === null || change === undefined) return make('td', {class: 'none'}, '–');
  const share = largest > 0 ? Math.abs(change) / largest : 0;
  const count = share > 0.5 ? 3 : share > 0.15 ? 2 : share > 0.02 ? 1 : 0;
  const glyph = make('span', {class: `size${count}`}, count === 0 ? '·' : change > 0 ? '▲' : '▼');
  const sign = change > 0 ? '+' : '';
  return make('td', {class: count === 0 ? 'none' : change > 0 ? 'up' : 'down', title: `${sign}${digits(change, 3)} for +${step}`}, glyph, ` ${sign}${digits(change, 2)}`);
}

export function showMeasures(table, answer, ghost, label) {
  const measured = answer.measured;
  const head = make('tr', {},
    make('th', {}), make('th', {}, 'now'), make('th', {}, 'as it was'), make('th', {}, 'change'),
    ...measured.map(({source}) => make('th', {class: 'source'}, source)),
    ...answer.arrows.map(({key, step}) => make('th', {class: 'turned', title: key}, `${label(key).name}, +${digits(step, 3)} ${label(key).unit}`)));
  const before = ghost ? ghost.rows : [];
  const body = answer.rows.map((row, place) => {
    const was = before[place]?.value ?? null;
    const change = was && row.value !== null ? `${row.value >= was ? '+' : '−'}${fixed(Math.abs((100 * (row.value - was)) / was), 0)} %` : '–';
    const changes = answer.arrows.map((of) => of.changes[place]);
    const largest = Math.max(0, ...changes.map((value) => Math.abs(value ?? 0)));
    return make('tr', {'data-row': row.title},
      make('th', {}, row.title),
      make('td', {class: row.alarm ? 'now alarm' : 'now'}, row.value === null ? row.missing ?? '–' : fixed(row.value, row.decimals)),
      make('td', {}, was === null ? '–' : fixed(was, row.decimals)),
      make('td', {}, change),
      ...measured.map(({amplitude}) => make('td', {}, row.sensor ? fixed(amplitude[row.sensor], 1) : '')),
      ...answer.arrows.map((of, number) => arrow(changes[number], largest, `${digits(of.step, 3)} ${label(of.key).unit}`)));
  });
  table.replaceChildren(make('thead', {}, head), make('tbody', {}, ...body));
}
