// Plays a recording: the blocks of the server as frames, at the speed and from the time that people choose.

import { begin, colour } from "./canvas.js";
import { SECONDS } from "./chart.js";
import { WRONG_TOKEN, fetchPrivate } from "./connection.js";
import { quantity, setText } from "./format.js";
import { known } from "./levels.js";

/** How often the server is asked how much of the recording is replayed, ms. */
const ASK_MS = 500;

/** Blocks that are kept, s of the recording. */
const KEPT = 90;

/** A change of level is in a frame that ends at most so long after it. */
const FRAME_S = 0.04;

/** Height of each level in the strip, as a part of a row: so that no level is known by its colour alone. */
const HEIGHTS = { no_contact: 0.12, stable: 0.3, unknown: 0.45, caution: 0.6, warning: 0.8, slipping: 1 };
const COLOURS = { no_contact: "--none" };

export class Player {
  constructor(handlers) {
    this.handlers = handlers;
    this.blocks = new Map();
    this.changes = [];
    this.gaps = [];
    this.begin_ns = null;
    this.seconds = 0;
    this.position = 0;
    this.speed = 1;
    this.playing = true;
    this.shown_ns = null;
    this.seeking = null;
    this.lastMs = performance.now();
    this.#controls();
    this.#ask();
    this.#step();
  }

  /** A recording takes no requests. */
  request() {
    return false;
  }

  #controls() {
    const find = (id) => document.getElementById(id);
    document.getElementById("player").hidden = false;
    this.elements = { play: find("play"), time: find("time"), position: find("position"), levels: find("levels"), loaded: find("loaded") };
    find("play").addEventListener("click", () => this.#setPlaying(!this.playing));
    find("next").addEventListener("click", () => this.#jump(1));
    find("previous").addEventListener("click", () => this.#jump(-1));
    find("speed").addEventListener("change", (event) => { this.speed = Number(event.target.value); });
    find("position").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    this.#setPlaying(true);
  }

  #setPlaying(playing) {
    if (playing && this.ended && this.position >= this.seconds) this.seek(0);
    this.playing = playing;
    setText(this.elements.play, playing ? "Pause" : "Play");
  }

  /** Go to the next warning or slip after the position, or to the one before it. */
  #jump(direction) {
    const times = this.changes.filter((each) => each.rising && ["warning", "slipping"].includes(each.level))
      .map((each) => (each.t_ns - this.begin_ns) / 1e9);
    const found = direction > 0
      ? times.find((each) => each > this.position + 0.02)
      : times.findLast((each) => each < this.position - 0.25);
    if (found !== undefined) this.seek(found + FRAME_S);
  }

  async #fetch(path) {
    const answer = await fetchPrivate(`data/${path}`);
    if (answer.status === 401) this.handlers.onState("refused", WRONG_TOKEN);
    else this.handlers.onState("open", "");
    return answer.ok ? answer.json() : null;
  }

  /** Ask how much of the recording there is, until it is replayed to its end. */
  async #ask() {
    try {
      const recording = await this.#fetch(`recording/${this.changes.length}`);
      if (recording) {
        this.begin_ns = recording.begin_ns;
        this.seconds = recording.seconds;
        this.changes.push(...recording.changes);
        this.gaps = recording.gaps;
        this.ended = recording.ended;
        this.elements.position.max = this.seconds.toFixed(2);
        const fault = recording.fault ? `incomplete: ${recording.fault}` : "";
        setText(this.elements.loaded, recording.ended ? fault : `${quantity(this.seconds, 0, "s")} replayed so far`);
      }
    } catch {
      this.handlers.onState("closed", "");
    }
    if (!this.ended) setTimeout(() => this.#ask(), ASK_MS);
  }

  /** The frames of a second; an empty list if it has none, null until they are here. */
  #block(number) {
    if (!this.blocks.has(number)) {
      this.blocks.set(number, null);
      for (const old of this.blocks.keys()) {
        if (this.blocks.size <= KEPT) break;
        this.blocks.delete(old);
      }
      this.#load(number);
    }
    return this.blocks.get(number);
  }

  async #load(number) {
    const { ended } = this;
    let frames;
    try {
      frames = await this.#fetch(`block/${number}`);
    } catch {
      this.handlers.onState("closed", "");
      setTimeout(() => this.blocks.delete(number), ASK_MS); // ask again
      return;
    }
    if (frames || ended || number + 1 < Math.floor(this.seconds)) this.blocks.set(number, frames ?? []);
    else setTimeout(() => this.blocks.delete(number), ASK_MS); // not replayed yet: ask again
  }

  /** Show the recording at a time, s after its begin, with the seconds before it in the charts. */
  seek(position) {
    this.position = Math.min(Math.max(position, 0), this.seconds);
    this.seeking = this.position;
  }

  #finishSeek() {
    const last = Math.floor(this.seeking);
    const first = Math.max(0, last - SECONDS);
    const numbers = Array.from({ length: last - first + 1 }, (_, index) => first + index);
    const blocks = numbers.map((number) => this.#block(number));
    if (blocks.includes(null)) return;
    const now_ns = this.begin_ns + this.seeking * 1e9;
    this.position = this.seeking;
    this.seeking = null;
    this.handlers.onJump();
    const past = this.changes.filter((each) => each.t_ns <= now_ns);
    this.handlers.onFrame({ now_ns, topics: {}, changes: past });
    this.shown_ns = -Infinity;
    this.#show(blocks.flat(), now_ns);
  }

  #show(frames, now_ns) {
    for (const frame of frames) {
      if (frame.now_ns <= this.shown_ns || frame.now_ns > now_ns) continue;
      this.shown_ns = frame.now_ns;
      this.handlers.onFrame(frame);
    }
    this.handlers.onTime(now_ns);
  }

  #step() {
    const nowMs = performance.now();
    const passed_s = Math.min((nowMs - this.lastMs) / 1000, 0.25);
    this.lastMs = nowMs;
    if (this.begin_ns !== null) {
      if (this.seeking !== null) this.#finishSeek();
      else if (this.playing) this.#play(passed_s);
      this.#draw();
    }
    requestAnimationFrame(() => this.#step());
  }

  #play(passed_s) {
    const target = Math.min(this.position + passed_s * this.speed, this.seconds);
    for (let number = Math.floor(this.position); number <= Math.floor(target); number += 1) {
      const frames = this.#block(number);
      if (frames === null) return; // wait for it
      this.#show(frames, this.begin_ns + target * 1e9);
    }
    if (target + 1 < this.seconds) this.#block(Math.floor(target) + 1);
    this.position = target;
    if (this.ended && target >= this.seconds) this.#setPlaying(false);
  }

  #draw() {
    const { time, position, levels } = this.elements;
    setText(time, `${quantity(this.position, 2)} of ${quantity(this.seconds, 2, "s")}`);
    if (document.activeElement !== position || this.playing) position.value = this.position;
    const { context, width, height } = begin(levels);
    const fingers = [...new Set(this.changes.map((each) => each.finger))].sort();
    const at = (t_ns) => ((t_ns - this.begin_ns) / 1e9 / Math.max(this.seconds, 1e-9)) * width;
    fingers.forEach((finger, row) => {
      const [tall, bottom] = [height / fingers.length - 2, ((row + 1) * height) / fingers.length];
      const own = this.changes.filter((each) => each.finger === finger);
      own.forEach((change, index) => {
        const level = known(change.level);
        const end = index + 1 < own.length ? at(own[index + 1].t_ns) : width;
        const high = HEIGHTS[level] * tall;
        context.fillStyle = colour(COLOURS[level] ?? `--${level}`);
        context.fillRect(at(change.t_ns), bottom - high, Math.max(end - at(change.t_ns), 1), high);
      });
      for (const [begin_ns, end_ns] of this.gaps) { // no level holds where nothing was recorded
        const [x, wide] = [at(begin_ns), Math.max(at(end_ns) - at(begin_ns), 1)];
        context.clearRect(x, bottom - tall, wide, tall);
        context.fillStyle = colour("--unknown");
        context.fillRect(x, bottom - HEIGHTS.unknown * tall, wide, HEIGHTS.unknown * tall);
      }
    });
    context.fillStyle = colour("--ink");
    context.fillRect(at(this.begin_ns + this.position * 1e9) - 1, 0, 2, height);
  }
}
