// Studies: start, progress, cancel, continue, report.

import {byId, make} from './dom.js';
import {get, post} from './server.js';

const PERIOD = 1000;

export class Studies {
  /**
   * `forms` has the fields of each study; `state()` returns the state of the page; `goTo(what,
   * state)` shows another one.
   */
  constructor(forms, state, goTo) {
    Object.assign(this, {forms, state, goTo, all: [], mark: ''});
    byId('study').replaceChildren(...Object.keys(forms).map((name) => make('option', {value: name}, name)));
    byId('study').addEventListener('change', () => this.choose());
    byId('start').addEventListener('click', () => this.start());
    byId('ask-next').addEventListener('click', () => this.askNext());
    this.choose();
    this.update();
  }

  choose() {
    byId('study-options').replaceChildren(...this.forms[byId('study').value].map((field) =>
      make('label', {title: field.description}, ` ${field.name.replaceAll('_', ' ')} `, input(field))));
  }

  async start() {
    const options = {};
    for (const input of byId('study-options').querySelectorAll('input')) {
      const text = input.type === 'checkbox' ? (input.checked ? 'true' : '') : input.value.trim();
      if (text) options[input.dataset.option] = text;
    }
    await this.act(() => post('studies', {state: this.state(), study: byId('study').value, options}));
  }

  /** Start the study of what to measure next with few samples; its answer stands beside the sliders. */
  async askNext() {
    await this.act(() => post('studies', {state: this.state(), study: 'next', options: {quick: 'true'}}));
  }

  /** Show studies of another machine than the one that is drawn, which has this mark, paler. */
  showWhetherOld(mark = '') {
    this.mark = mark;
    for (const row of byId('studies').children) row.classList.toggle('old', !this.isOf(row.dataset.mark));
    this.showNext();
  }

  isOf(mark) { return Boolean(mark) && mark === this.mark; }

  /** Show what to measure next: of the machine that is drawn, or the latest, paler, with its date. */
  showNext() {
    const asked = this.all.filter(({study}) => study === 'next');
    const shown = asked.find(({mark}) => this.isOf(mark)) ?? asked[0];
    const isOld = Boolean(shown) && !this.isOf(shown.mark);
    byId('next').classList.toggle('old', isOld);
    const other = shown?.machine === this.state().machine ? ' with other numbers' : '';
    byId('next').replaceChildren(...(shown ? [isOld ? `${shown.machine}${other}, ${shown.started}: ` : '',
      isUnderWay(shown) ? `${shown.state} …` : `${shown.answer || shown.state} `, shown.report ? reportLink(shown, shown.id) : ''] : []));
  }

  async act(request) {
    byId('study-problem').textContent = '';
    try {
      await request();
    } catch (error) {
      byId('study-problem').textContent = error.message;
    }
    await this.update();
  }

  async update() {
    clearTimeout(this.timer);
    let studies = [];
    try {
      ({studies} = await get('studies'));
    } catch (error) {
      byId('study-problem').textContent = error.message;
      return;
    }
    this.all = studies;
    byId('studies').replaceChildren(...studies.map((study) => this.row(study)));
    this.showWhetherOld(this.mark);
    if (studies.some(isUnderWay)) this.timer = setTimeout(() => this.update(), PERIOD);
  }

  row(study) {
    const path = `studies/${study.id}`;
    const running = study.state === 'running';
    const [done, all] = study.progress ?? [0, 0];
    return make('div', {class: 'study', 'data-study': study.id, 'data-mark': study.mark},
      make('strong', {}, study.id), ` · ${study.state}${study.place ? `, place ${study.place} of the queue` : ''} · ${study.machine} · started ${study.started} `,
      running ? make('progress', all ? {max: String(all), value: String(done)} : {}) : null,
      running && all ? ` ${done} of ${all} ` : null,
      isUnderWay(study) ? make('button', {onclick: () => this.act(() => post(`${path}/cancel`, {}))}, 'cancel') : null,
      study.state === 'not finished' ? make('button', {onclick: () => this.act(() => post(`${path}/resume`, {}))}, 'continue') : null,
      study.report ? reportLink(study, 'report') : null,
      study.chosen ? make('button', {onclick: () => this.goTo(`machine of ${study.id}`, study.chosen)}, 'show its machine') : null,
      make('div', {}, make('code', {}, study.command)),
      study.answer ? make('p', {}, study.answer) : null,
      study.output ? make('pre', {}, study.output.trim()) : null);
  }
}

const reportLink = ({id}, words) =>
  make('a', {href: `reports/${id}/report.html`, target: '_blank', rel: 'noopener'}, words);

/** Return whether a study runs or waits for its turn. */
function isUnderWay(study) {
  return study.state === 'running' || study.state === 'waiting';
}

/** Return the input of a field of a form. */
function input(field) {
  const size = Math.max(8, field.default.length);
  const shown = {'data-option': field.name, placeholder: field.default, autocomplete: 'off', size: String(size)};
  if (field.kind === 'boolean') return make('input', {type: 'checkbox', 'data-option': field.name});
  if (field.kind === 'text') return make('input', shown);
  const limits = Object.fromEntries([['min', field.ge], ['max', field.le]].filter(([, limit]) => limit !== undefined).map(([name, limit]) => [name, String(limit)]));
  const {autocomplete, ...others} = shown;  // only for texts
  return make('input', {type: 'number', step: field.kind === 'integer' ? '1' : 'any', ...others, ...limits});
}
