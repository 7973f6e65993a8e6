// The changes of level, and the health of the streams.

import { UNKNOWN, explained, isNumber, quantity, setText, timeOfDay } from "./format.js";
import { known, word } from "./levels.js";

/** Changes that are shown; older ones are left out. */
const SHOWN = 50;

function note(text) {
  const item = document.createElement("li");
  item.textContent = text;
  return item;
}

export class ChangeList {
  constructor(words) {
    this.words = words;
    this.list = document.getElementById("change-list");
    this.none = document.getElementById("no-changes");
    this.newest = "";
    this.count = 0;
  }

  draw(state) {
    const first = state.changes[0];
    const newest = first ? `${first.boot} ${first.seq}` : "";
    if (newest === this.newest && state.changes.length === this.count) return;
    this.newest = newest;
    this.count = state.changes.length;
    const items = state.changes.slice(0, SHOWN).flatMap((change, index) => {
      const older = state.changes[index + 1];
      const missed = older && older.boot === change.boot ? change.seq - older.seq - 1 : 0;
      return missed > 0 ? [this.#item(change), note(`${missed} changes before this one were not received`)] : [this.#item(change)];
    });
    this.list.replaceChildren(...items);
    this.none.hidden = state.changes.length > 0;
  }

  #item(change) {
    const item = document.createElement("li");
    item.dataset.level = known(change.level);
    const time = document.createElement("time");
    time.textContent = timeOfDay(change.timestamp);
    const levels = document.createElement("strong");
    levels.textContent = `${change.finger}: ${word(change.previous)} → ${word(change.level)}`;
    const why = document.createElement("span");
    const used = isNumber(change.utilisation) ? `utilisation ${quantity(change.utilisation, 2)}` : "";
    why.textContent = [used, explained(change.reasons, this.words.reasons), explained(change.evidence, this.words.evidence)]
      .filter(Boolean).join("; ");
    item.append(time, levels, why);
    return item;
  }
}

const MARKS = ["✓", "!", "✕", "…"];

export class StreamTable {
  constructor(words) {
    this.words = words;
    this.body = document.getElementById("stream-rows");
    this.rows = new Map();
  }

  draw(state) {
    const status = state.fresh("status");
    const streams = (status ?? state.last("status"))?.streams ?? {};
    for (const gone of [...this.rows.keys()].filter((name) => !(name in streams))) {
      this.rows.get(gone)[0].parentElement.remove();
      this.rows.delete(gone);
    }
    for (const [name, stream] of Object.entries(streams)) this.#row(name, status ? stream : null);
  }

  #row(name, stream) {
    if (!this.rows.has(name)) {
      const row = this.body.insertRow();
      row.dataset.stream = name;
      this.rows.set(name, Array.from({ length: 7 }, () => row.insertCell()));
    }
    const cells = this.rows.get(name);
    const code = stream?.health;
    const health = this.words.health[code];
    const texts = [
      name,
      health ? `${MARKS[code] ?? ""} ${health}` : UNKNOWN,
      stream ? `${quantity(stream.rate_hz, 0)} of ${quantity(stream.expected_hz, 0, "Hz")}` : UNKNOWN,
      quantity(stream?.age_s, 0, "ms", 1000),
      quantity(stream?.bad, 0),
      quantity(stream?.lost, 0),
      stream ? stream.message || "" : "",
    ];
    texts.forEach((text, index) => setText(cells[index], text));
    cells[0].parentElement.dataset.health = health ?? UNKNOWN;
  }
}
