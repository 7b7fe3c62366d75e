// States of this page: undo and redo, kept in the tab; the permanent link is the address itself.

const KEY = `wm-drake studio history ${location.pathname}`;
const LONGEST = 200;

export const copyOf = (value) => JSON.parse(JSON.stringify(value));

/** Return what the address holds after its '#', or null. */
export function fromLink() {
  const text = location.hash.slice(1);
  if (!text) return null;
  try {
    const {state, variants = []} = JSON.parse(decodeURIComponent(text));
    return typeof state?.machine === 'string' && Array.isArray(variants)
      ? {state, variants: variants.slice(0, 4)} : null;
  } catch {
    return null;
  }
}

export function intoLink(state, variants) {
  const kept = variants.map(({name, state: of}) => ({name, state: of}));
  try {
    history.replaceState(null, '', `#${encodeURIComponent(JSON.stringify({state, variants: kept}))}`);
  } catch { /* a page in a frame may have no address of its own */ }
}

export class History {
  constructor() {
    this.entries = [];
    this.place = -1;
    this.control = null; // what was moved last by keys
    try {
      const kept = JSON.parse(sessionStorage.getItem(KEY));
      if (Array.isArray(kept?.entries) && kept.entries.length) Object.assign(this, kept);
    } catch { /* another page wrote it: begin anew */ }
  }

  get state() { return copyOf(this.entries[this.place].state); }

  /** Add an entry; presses of a key that go on moving one `control` are one entry. */
  add(what, state, control = null) {
    const goesOn = control !== null && control === this.control;
    this.control = control;
    if (this.place >= 0 && JSON.stringify(this.entries[this.place].state) === JSON.stringify(state)) return;
    const kept = this.entries.slice(0, this.place + (goesOn ? 0 : 1));
    this.entries = [...kept, {what, state: copyOf(state)}].slice(-LONGEST);
    this.place = this.entries.length - 1;
    this.keep();
  }

  go(place) {
    this.control = null;
    this.place = Math.min(this.entries.length - 1, Math.max(0, place));
    this.keep();
    return this.state;
  }

  keep() {
    try {
      sessionStorage.setItem(KEY, JSON.stringify({entries: this.entries, place: this.place}));
    } catch { /* storage is full or forbidden: undo works until the page is closed */ }
  }
}
