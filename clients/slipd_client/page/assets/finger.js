// The card of one finger.

import { Chart } from "./chart.js";
import {
  UNKNOWN, Rows, explained, interval, isNumber, isVector, length, ofLimit, parts, quantity, setText, withSpread,
} from "./format.js";
import { drawForce, drawUtilisation } from "./gauges.js";
import { showLevel, word } from "./levels.js";
import { drawPad } from "./pad.js";

export class FingerCard {
  constructor(finger, words, onTare) {
    this.finger = finger;
    this.words = words;
    const card = document.getElementById("finger-card").content.cloneNode(true).firstElementChild;
    this.element = card;
    card.dataset.finger = finger;
    const find = (selector) => card.querySelector(selector);
    setText(find("h2"), finger);
    this.banner = find(".banner");
    this.level = find(".level");
    this.utilisation = find(".utilisation");
    this.utilisation.dataset.field = `${finger}.utilisation`;
    this.why = find(".why");
    this.bar = find(".bar");
    this.pad = find(".pad");
    this.caption = find("figcaption");
    this.dial = find(".dial");
    this.rows = new Rows(find(".values"), finger);
    this.chart = new Chart(find(".chart"));
    this.buttons = find(".buttons");
    find(".tare").addEventListener("click", () => onTare(finger));
    this.drawn = {};
  }

  /** Note the newest verdict for the chart; `draw` shows it. */
  note(state) {
    const slip = state.last(`slip.${this.finger}`);
    if (slip) this.chart.add(slip.t_ns / 1e9, slip);
  }

  draw(state) {
    const topic = `slip.${this.finger}`;
    const slip = state.fresh(topic);
    const tactile = state.fresh(`tactile.${this.finger}`);
    const stream = state.last("status")?.streams?.[`${this.finger}.pad`];
    Object.assign(this.drawn, { slip, tactile });
    this.#drawLevel(state, slip, topic);
    this.#drawValues(slip);
    this.#drawImage(state, tactile, slip, stream);
    this.drawn.bar = drawUtilisation(this.bar, slip);
    this.drawn.dial = drawForce(this.dial, slip);
    const last = state.last(topic);
    if (last) this.chart.draw(this.#now(state, last), state.recorded);
  }

  #now(state, last) {
    const age = state.age(`slip.${this.finger}`) ?? 0;
    return last.t_ns / 1e9 + age;
  }

  #drawLevel(state, slip, topic) {
    const age = state.age(topic);
    showLevel(this.banner, slip ? slip.level : "unknown");
    setText(this.level, word(slip ? slip.level : "unknown"));
    setText(this.utilisation, slip && isNumber(slip.utilisation) ? quantity(slip.utilisation, 2) : UNKNOWN);
    this.utilisation.parentElement.classList.toggle("unknown", this.utilisation.textContent === UNKNOWN);
    let why = age === null ? "no verdict yet" : `stale: no verdict for ${quantity(age, 1, "s")}`;
    if (slip) {
      const reasons = explained(slip.reasons, this.words.reasons);
      const evidence = explained(slip.evidence, this.words.evidence);
      why = [reasons || (slip.level === "unknown" ? "no reason is given" : this.words.level_meanings[slip.level] ?? ""),
        evidence && `The object moves, as shown by ${evidence}`].filter(Boolean).join(". ");
    }
    setText(this.why, why.replaceAll("`", "").replaceAll("**", ""));
    this.element.classList.toggle("stale", !slip);
  }

  #drawValues(slip) {
    const { rows } = this;
    const newtons = slip?.force_unit === "N";
    const [force, torque] = newtons || !slip ? ["N", "N·m"] : ["(uncalibrated)", "m (uncalibrated)"];
    const shear = length(slip?.tangential_n);
    const limit = isNumber(slip?.mu) && isNumber(slip?.normal_n) ? slip.mu * slip.normal_n : null;
    rows.set("utilisation", this.#bounds(slip), "bounds");
    rows.set("normal force", quantity(slip?.normal_n, 2, force), "normal_n");
    rows.set("tangential force", ofLimit(shear, limit, 2, force), "tangential_n");
    rows.set("as a vector", parts(slip?.tangential_n, 2, force), "tangential_vector");
    rows.set("spin", ofLimit(slip?.spin_nm, slip?.torque_limit_nm, 4, torque), "spin_nm");
    rows.set("margin to tipping", withSpread(slip?.tipping_margin_m, slip?.tipping_margin_std_m, 1, "mm", 1000), "tipping_margin_m");
    rows.set("friction ratio R", withSpread(slip?.friction_ratio, slip?.friction_ratio_std, 3), "friction_ratio");
    rows.set("friction μ", this.#friction(slip), "mu");
    rows.set("μ that this load requires", quantity(slip?.required_friction, 3), "required_friction");
    rows.set("largest μ carried so far", quantity(slip?.carried_friction, 3), "carried_friction");
    rows.set("centroid C", parts(slip?.centroid_m, 1, "mm", 1000), "centroid_m");
    rows.set("pole P", this.#pole(slip), "pole_m");
    rows.set("grip force needed", quantity(slip?.grip_needed_n, 1, "N"), "grip_needed_n");
  }

  #bounds(slip) {
    if (!slip) return UNKNOWN;
    const { utilisation: value, utilisation_lower: low, utilisation_upper: high } = slip;
    const bounds = interval(low, high, 3);
    if (isNumber(value)) return quantity(value, 3) + (bounds && ` (${bounds})`);
    if (bounds) return `unknown within ${bounds}`;
    const relative = slip.relative_utilisation;
    return isNumber(relative) ? `unknown; ${quantity(relative, 2)} of the largest load carried` : UNKNOWN;
  }

  #friction(slip) {
    if (!isNumber(slip?.mu)) return UNKNOWN;
    const range = interval(slip.mu_low, slip.mu_high, 2);
    const sliding = isNumber(slip.mu_d) ? `, sliding ${quantity(slip.mu_d, 2)}` : "";
    return `${quantity(slip.mu, 2)} (${slip.mu_source}${range && `, expected ${range}`}${sliding})`;
  }

  #pole(slip) {
    if (isVector(slip?.pole_m)) return parts(slip.pole_m, 1, "mm", 1000);
    return isNumber(slip?.utilisation) ? "none: it would slide without turning" : UNKNOWN;
  }

  #drawImage(state, tactile, slip, stream) {
    const masked = Array.isArray(stream?.masked) ? stream.masked : [];
    this.drawn.pad = drawPad(this.pad, tactile, state.last(`tactile.${this.finger}`), slip, masked);
    setText(this.caption, this.#captionOf(state, tactile, masked));
  }

  #captionOf(state, tactile, masked) {
    const { circles, largest, largestLimit } = this.drawn.pad;
    if (!tactile) {
      return state.last(`tactile.${this.finger}`) ? "the image is out of date" : "no image of the pad";
    }
    if (!tactile.image_ok) {
      return `the image cannot be used: ${explained(tactile.image_reasons, this.words.image_reasons) || "no reason is given"}`;
    }
    const facts = [];
    if (!this.drawn.pad.taxels.length) facts.push("the daemon does not send where the taxels are");
    if (largest === 0) {
      facts.push("no taxel is loaded");
    } else {
      facts.push(`darkest taxel: ${quantity(largest, 3, tactile.force_unit === "N" ? "N" : "(uncalibrated)")}`);
      facts.push(circles.length
        ? `circles: friction limit of each taxel, the largest ${quantity(largestLimit, 3, "N")}`
        : "no friction circles: load or μ is unknown, or the taxels are too small");
    }
    if (masked.length) facts.push(`${masked.length} ${masked.length === 1 ? "taxel is" : "taxels are"} not used (×)`);
    return facts.join("; ");
  }
}
