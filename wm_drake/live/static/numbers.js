// The list of all numbers: search, groups, a slider and a text for each, problems at the value.

import {digits, make} from './dom.js';

const STEPS = 1000;
const EMPTY = 'The field is empty: the last value stays in use. Type a value, or press ↺.';

export class NumberList {
  /** `moved(key, text, final)` is called with a text, or null for "as it was". */
  constructor(parent, moved) {
    this.parent = parent;
    this.moved = moved;
    this.rows = new Map();
  }

  /** List the numbers of a machine, folded by parts of the machine and by groups within. */
  fill(numbers, order) {
    this.rows.clear();
    const parts = new Map(order.map((name) => [name, new Map()]));
    for (const number of numbers) {
      const groups = parts.get(number.part);
      if (!groups.has(number.group)) groups.set(number.group, []);
      groups.get(number.group).push(this.row(number));
    }
    const fold = (name, kind, content) => make('details', {class: kind}, make('summary', {}, name), ...content);
    const inside = (groups) => (groups.size === 1 ? [...groups.values()][0]
      : [...groups].map(([name, rows]) => fold(name, 'group', rows)));
    this.parent.replaceChildren(...[...parts].filter(([, groups]) => groups.size)
      .map(([name, groups]) => fold(name, 'part', inside(groups))));
    this.folds = [...this.parent.querySelectorAll('details')];
  }

  row(number) {
    const text = make('input', {class: 'text', spellcheck: 'false', autocomplete: 'off', 'aria-label': `${number.group} ${number.label}`});
    const slider = make('input', {type: 'range', min: '0', max: String(STEPS), 'aria-label': `slider of ${number.group} ${number.label}`});
    const back = make('button', {class: 'back', title: 'as it was', 'aria-label': `${number.label} as it was`}, '↺');
    const ranges = [
      number.needs ? `${number.fixed ? 'fixed on this page' : 'cannot be moved alone'}: ${number.needs}` : `slider ${digits(number.low, 3)} to ${digits(number.high, 3)}`,
      number.allowed && `allowed ${number.allowed}`,
      number.usual && `usual ${number.usual}`,
    ].filter(Boolean).join(' · ');
    const problem = make('div', {class: 'problem', role: 'alert', hidden: true});
    const warning = make('div', {class: 'warning', hidden: true});
    const element = make('div', {class: 'number', 'data-key': number.key},
      make('span', {class: 'label', title: number.source ? `${number.key}\n${number.source}` : number.key}, number.label),
      slider, text, back, make('div', {class: 'range'}, `${number.unit ? `${number.unit} · ` : ''}${ranges}`), problem, warning);
    const row = {number, element, text, slider, problem, warning, low: number.low, high: number.high};
    const sliderText = () => {
      const value = row.low + ((row.high - row.low) * Number(slider.value)) / STEPS;
      return `${Number(value.toPrecision(5))} ${number.unit}`.trim();
    };
    slider.addEventListener('input', () => {
      row.isEmpty = false;
      text.value = sliderText();
      this.moved(number.key, text.value, false);
    });
    slider.addEventListener('change', () => this.moved(number.key, sliderText(), true));
    text.addEventListener('input', () => { row.isTyping = true; });
    text.addEventListener('blur', () => { row.isTyping = false; });
    text.addEventListener('change', () => {
      row.isTyping = false;
      row.isEmpty = !text.value.trim();
      if (row.isEmpty) this.refuse(row, EMPTY);
      else this.moved(number.key, text.value.trim(), true);
    });
    back.addEventListener('click', () => {
      row.isEmpty = false;
      this.moved(number.key, null, true);
    });
    this.rows.set(number.key, row);
    return element;
  }

  /** Show the chosen texts; `shown` has the values in display units that the server read. */
  show(values, shown = {}) {
    for (const [key, row] of this.rows) {
      const isMoved = key in values;
      row.element.classList.toggle('moved', isMoved);
      const value = isMoved && key in shown ? shown[key] : row.number.value;
      // an answer that comes while the user types leaves the text alone
      if (!row.isTyping && !row.isEmpty && (document.activeElement !== row.text || isMoved)) {
        row.text.value = isMoved ? values[key] : `${digits(row.number.value, 6).replace('−', '-')} ${row.number.unit}`.trim();
      }
      if (document.activeElement !== row.slider && (key in shown || !isMoved)) {
        row.low = Math.min(row.number.low, value);
        row.high = Math.max(row.number.high, value);
        row.slider.hidden = row.high === row.low;
        row.slider.value = String((STEPS * (value - row.low)) / (row.high - row.low || 1));
      }
    }
  }

  /** Show problems and warnings at their values; return those that stand at no moved number. */
  problems(problems, warnings = []) {
    for (const row of this.rows.values()) {
      row.warning.hidden = true;
      if (row.isEmpty) continue;
      row.problem.hidden = true;
      row.element.classList.remove('wrong');
      row.text.removeAttribute('aria-invalid');
    }
    const left = problems.filter(({key, message}) => {
      const row = this.nearest(key);
      if (!row) return true;
      this.refuse(row, message);
      return false;
    });
    const others = warnings.filter(({key, message}) => {
      const row = this.nearest(key);
      if (!row?.element.classList.contains('moved')) return true;
      row.warning.textContent = message;
      row.warning.hidden = false;
      this.reveal(row);
      return false;
    });
    return [...left, ...others];
  }

  /** Forget which fields were left empty, because another state is shown. */
  forget() {
    for (const row of this.rows.values()) row.isEmpty = false;
  }

  /** Say at a value what is wrong with it. */
  refuse(row, message) {
    row.problem.textContent = message;
    row.problem.hidden = false;
    row.element.classList.add('wrong');
    row.text.setAttribute('aria-invalid', 'true');
    this.reveal(row);
  }

  /** Return the name of a number elsewhere on the page. */
  nameOf(key) { return this.nearest(key)?.number.short ?? key; }

  nearest(key) {
    return this.rows.get(key) ?? this.rows.get(`${key}.0`);
  }

  /**
   * Show only numbers whose key path has all words, and only moved ones if wanted. A number with a
   * problem, or with a warning, is shown always.
   */
  search(words, onlyMoved) {
    const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
    for (const {number, element, problem, warning} of this.rows.values()) {
      const name = `${number.key} ${number.part} ${number.group} ${number.label}`.toLowerCase();
      const fits = wanted.every((word) => name.includes(word)) && (!onlyMoved || element.classList.contains('moved'));
      element.hidden = !fits && problem.hidden && warning.hidden;
    }
    const isMostlyZero = (found) => 2 * found.filter(({dataset}) => this.rows.get(dataset.key).number.value === 0).length >= found.length;
    for (const fold of this.folds) {
      const found = [...fold.querySelectorAll('.number:not([hidden])')];
      fold.hidden = !found.length;
      fold.style.order = wanted.length && isMostlyZero(found) ? '1' : ''; // what the machine has comes first
      if (wanted.length || onlyMoved) fold.open = !fold.hidden;
    }
  }

  /** Show a row, whatever is searched for, and open its groups. */
  reveal({element}) {
    element.hidden = false;
    for (let fold = element.closest('details'); fold; fold = fold.parentElement.closest('details')) {
      fold.hidden = false;
      fold.open = true;
    }
  }
}
