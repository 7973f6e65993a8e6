// The hand of `slipd emulate`: mouse and keyboard press the emulated pads. Nothing of it exists where no emulation runs.

import { parts, quantity } from "./format.js";

/** Force of a press where no other is set, N. */
const PRESS_N = 5;

/** Change of the force by one step of the wheel, or by Page Up and Page Down, N. */
const WHEEL_N = 0.5;

/** By one arrow key, and with Shift, m. */
const STEP_M = 0.001;
const FINE_STEP_M = 0.0002;

/** Keys that move along X and Y of the pad, as it is drawn. */
const MOVES = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Keys that change the force. */
const FORCES = { PageUp: WHEEL_N, PageDown: -WHEEL_N };

const UNITS = { force_n: [1, "N"], twist_mnm: [0, "mN·m"], push_x_n: [1, "N"], push_y_n: [1, "N"] };

export class Hand {
  /**
   * @param send sends a touch; returns whether there was a connection for it
   * @param showReply shows (ok, text)
   */
  constructor(send, showReply) {
    this.send = send;
    this.showReply = showReply;
    this.fingers = [];
    this.controls = new Map();
    this.wanted = new Map();
    this.sent = false;
    this.failed = false;
  }

  /** Take the names of the fingers that can be touched now. */
  setFingers(fingers) {
    if (this.fingers.length && !fingers.length) this.#fail("the emulation has ended; start it: slipd emulate CONFIG");
    if (fingers.length) this.#clearError();
    this.fingers = fingers;
    this.wanted.clear();
  }

  /** Forget everything: there is no server. */
  reset() {
    this.fingers = [];
    this.wanted.clear();
    this.sent = false;
  }

  /** Add controls to the cards of these fingers, and take them away from others. */
  draw(cards) {
    for (const [finger, controls] of this.controls) {
      if (this.fingers.includes(finger) && cards.get(finger) === controls.card) continue;
      controls.remove();
      this.controls.delete(finger);
    }
    for (const finger of this.fingers) {
      const card = cards.get(finger);
      if (card && !this.controls.has(finger)) {
        this.controls.set(finger, new HandControls(card, (touch) => this.#want(finger, touch)));
      }
    }
  }

  #want(finger, touch) {
    this.wanted.set(finger, { finger, ...touch });
    this.#sendNext();
  }

  /** Send the newest touch once the one before is carried out: a mouse moves faster than that. */
  #sendNext() {
    const [next] = this.wanted.values();
    if (this.sent || !next) return;
    this.wanted.delete(next.finger);
    this.sent = this.send(next);
    if (!this.sent) this.#fail("no connection to the view's server; nothing was sent");
  }

  /** Take the reply to the last touch. */
  touched(reply) {
    this.sent = false;
    if (reply.ok) this.#clearError();
    else this.#fail(reply.text);
    this.#sendNext();
  }

  #fail(text) {
    this.failed = true;
    this.showReply(false, text);
  }

  #clearError() {
    if (this.failed) this.showReply(true, "");
    this.failed = false;
  }
}

/** The controls of one finger; together they are what the hand does to it. */
class HandControls {
  constructor(card, onTouch) {
    this.card = card;
    this.onTouch = onTouch;
    this.place_m = [0, 0];
    this.element = document.getElementById("hand-controls").content.cloneNode(true).firstElementChild;
    this.inputs = Object.fromEntries([...this.element.querySelectorAll("input")].map((input) => [input.name, input]));
    this.ended = new AbortController();
    card.element.querySelector(".pictures").after(this.element);
    card.pad.classList.add("touchable");
    for (const [name, value] of Object.entries(this.#attributes())) card.pad.setAttribute(name, value);
    this.#listen();
    this.#show();
  }

  remove() {
    this.ended.abort();
    this.element.remove();
    this.card.pad.classList.remove("touchable");
    for (const name of Object.keys(this.#attributes())) this.card.pad.removeAttribute(name);
  }

  #listen() {
    const { pad } = this.card;
    const on = (target, event, act) => target.addEventListener(event, act, { signal: this.ended.signal, passive: false });
    on(this.element, "input", () => this.#touch());
    on(this.element.querySelector("button"), "click", () => this.#release());
    on(pad, "pointerdown", (event) => {
      if (event.button !== 0) return;
      pad.setPointerCapture(event.pointerId);
      if (this.#value("force_n") === 0) this.inputs.force_n.value = PRESS_N;
      this.#moveTo(event);
    });
    on(pad, "pointermove", (event) => {
      if (pad.hasPointerCapture(event.pointerId)) this.#moveTo(event);
    });
    on(pad, "wheel", (event) => {
      event.preventDefault();
      this.#changeForce(-Math.sign(event.deltaY) * WHEEL_N);
    });
    on(pad, "keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || !this.#obey(event)) return;
      event.preventDefault(); // the page would scroll
    });
  }

  /** What a browser must know of a pad that takes keys. */
  #attributes() {
    return {
      tabindex: "0",
      role: "application",
      "aria-label": `emulated pad of finger ${this.card.element.dataset.finger}: Space presses and lets go, arrow keys move`,
    };
  }

  /** Do what a key stands for; return whether it stands for something. */
  #obey({ key, shiftKey, repeat }) {
    if (Object.hasOwn(MOVES, key) && this.card.drawn.pad) {
      const step_m = shiftKey ? FINE_STEP_M : STEP_M;
      this.#place(this.place_m.map((value, axis) => value + step_m * MOVES[key][axis]));
    } else if (Object.hasOwn(FORCES, key)) {
      this.#changeForce(FORCES[key]);
    } else if (key === " ") {
      if (!repeat) this.#pressOrRelease();
    } else {
      return false;
    }
    return true;
  }

  #pressOrRelease() {
    if (this.#value("force_n") !== 0) {
      this.#release();
      return;
    }
    this.inputs.force_n.value = PRESS_N;
    this.#touch();
  }

  #changeForce(by_n) {
    this.inputs.force_n.value = this.#value("force_n") + by_n;
    this.#touch();
  }

  #value(name) {
    return Number(this.inputs[name].value);
  }

  #moveTo(event) {
    const { scale, origin } = this.card.drawn.pad;
    this.#place([(event.offsetX - origin[0]) / scale, (origin[1] - event.offsetY) / scale]);
  }

  /** Go to a place of the pad, or to its edge. */
  #place(at_m) {
    const { half } = this.card.drawn.pad;
    this.place_m = at_m.map((value, axis) => Math.min(Math.max(value, -half[axis]), half[axis]));
    this.#touch();
  }

  #release() {
    for (const input of Object.values(this.inputs)) input.value = 0;
    this.#touch();
  }

  #touch() {
    this.#show();
    this.onTouch({
      place_mm: this.place_m.map((value) => 1000 * value),
      force_n: this.#value("force_n"),
      push_n: [this.#value("push_x_n"), this.#value("push_y_n")],
      twist_mnm: this.#value("twist_mnm"),
    });
  }

  #show() {
    for (const [name, [digits, unit]] of Object.entries(UNITS)) {
      this.inputs[name].nextElementSibling.textContent = quantity(this.#value(name), digits, unit);
    }
    this.element.querySelector("[name=place]").textContent = parts(this.place_m, 1, "mm", 1000);
  }
}
