// Studies: start, progress, cancel, continue, report.

import {byId, make} from './dom.js';
import {get, post} from './server.js';

const HINTS = {
  '--trials': 'all', '--design': 'd-optimal', '--model': 'main+2fi', '--load': 'middle and counter', '--samples': '4096',
  '--sensitivity': '512', '--subset': '1000', '--case': 'all',
};
const PERIOD = 1000;

export class Studies {
  /** `state()` returns the state of the page; `show(error)` shows an error. */
  constructor(options, state) {
    this.options = options;
    this.state = state;
    byId('study').replaceChildren(...Object.keys(options).map((name) => make('option', {value: name}, name)));
    byId('study').addEventListener('change', () => this.choose());
    byId('start').addEventListener('click', () => this.start());
    this.choose();
    this.update();
  }

  choose() {
    const names = this.options[byId('study').value];
    byId('study-options').replaceChildren(...names.map((name) =>
      make('label', {}, ` ${name.slice(2)} `, make('input', {size: Math.max(8, (HINTS[name] ?? '').length), placeholder: HINTS[name] ?? '', 'data-option': name, autocomplete: 'off'}))));
  }

  async start() {
    const options = {};
    for (const input of byId('study-options').querySelectorAll('input')) {
      if (input.value.trim()) options[input.dataset.option] = input.value.trim();
    }
    await this.act(() => post('studies', {state: this.state(), study: byId('study').value, options}));
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
    byId('studies').replaceChildren(...studies.map((study) => this.row(study)));
    if (studies.some((study) => study.state === 'running')) this.timer = setTimeout(() => this.update(), PERIOD);
  }

  row(study) {
    const path = `studies/${study.id}`;
    const running = study.state === 'running';
    const [done, all] = study.progress ?? [0, 0];
    return make('div', {class: 'study', 'data-study': study.id},
      make('strong', {}, study.id), ` · ${study.state} · ${study.machine} · started ${study.started} `,
      running ? make('progress', all ? {max: String(all), value: String(done)} : {}) : null,
      running && all ? ` ${done} of ${all} ` : null,
      running ? make('button', {onclick: () => this.act(() => post(`${path}/cancel`, {}))}, 'cancel') : null,
      study.state === 'not finished' ? make('button', {onclick: () => this.act(() => post(`${path}/resume`, {}))}, 'continue') : null,
      study.report ? make('a', {href: `reports/${study.id}/report.html`, target: '_blank', rel: 'noopener'}, 'report') : null,
      make('div', {}, make('code', {}, study.command)),
      study.output ? make('pre', {}, study.output.trim()) : null);
  }
}
