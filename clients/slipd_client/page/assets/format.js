// Values of messages as text. What is not known is "unknown": never 0, never empty.

export const UNKNOWN = "unknown";

export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

export const isVector = (value) => Array.isArray(value) && value.length > 0 && value.every(isNumber);

/** A number with its unit; `factor` turns the unit of the wire into the one shown. */
export function quantity(value, digits, unit = "", factor = 1) {
  if (!isNumber(value)) return UNKNOWN;
  const text = (value * factor).toFixed(digits).replace(/^-(?=[0.]*$)/, "");
  return (unit ? `${text} ${unit}` : text).replace("-", "−");
}

/** The length of a vector. */
export const length = (vector) => (isVector(vector) ? Math.hypot(...vector) : null);

/** The parts of a vector in brackets. */
export function parts(vector, digits, unit, factor = 1) {
  if (!isVector(vector)) return UNKNOWN;
  return `(${vector.map((each) => quantity(each, digits, "", factor)).join(", ")}) ${unit}`;
}

/** A value, and what it may not exceed where that is known. */
export function ofLimit(value, limit, digits, unit) {
  if (!isNumber(value)) return UNKNOWN;
  return isNumber(limit)
    ? `${quantity(value, digits)} of ${quantity(limit, digits, unit)}`
    : `${quantity(value, digits, unit)} of an unknown limit`;
}

/** A value with its standard deviation, where that is known. */
export function withSpread(value, spread, digits, unit = "", factor = 1) {
  if (!isNumber(value)) return UNKNOWN;
  const more = isNumber(spread) ? ` ± ${quantity(spread, digits, "", factor)}` : "";
  const text = quantity(value, digits, "", factor) + more;
  return unit ? `${text} ${unit}` : text;
}

/** An interval; an end that is not known is open. */
export function interval(low, high, digits) {
  if (!isNumber(low) && !isNumber(high)) return "";
  return `${isNumber(low) ? quantity(low, digits) : "?"} to ${isNumber(high) ? quantity(high, digits) : "?"}`;
}

/** Words that explain words of the wire; a word without an explanation is shown as it is. */
export function explained(words, meanings) {
  if (!Array.isArray(words)) return "";
  return words.map((word) => (Object.hasOwn(meanings, word) ? `${word}: ${plain(meanings[word])}` : String(word))).join("; ");
}

const plain = (text) => text.replaceAll("`", "").replaceAll("**", "");

/** Time of day of a message. */
export function timeOfDay(timestamp) {
  if (!isNumber(timestamp) || timestamp <= 0) return UNKNOWN;
  const date = new Date(timestamp * 1000);
  const two = (number) => String(number).padStart(2, "0");
  const seconds = `${two(date.getSeconds())}.${String(date.getMilliseconds()).padStart(3, "0")}`;
  return `${two(date.getHours())}:${two(date.getMinutes())}:${seconds}`;
}

/** Set the text of an element where it differs. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Rows of a list of names and values, made once and then filled. */
export class Rows {
  constructor(list, prefix) {
    this.list = list;
    this.prefix = prefix;
    this.values = new Map();
  }

  /** Show a value; `why` explains it under the mouse. */
  set(name, text, field = name, why = "") {
    let value = this.values.get(name);
    if (!value) {
      const row = document.createElement("div");
      const term = document.createElement("dt");
      term.textContent = name;
      value = document.createElement("dd");
      value.dataset.field = `${this.prefix}.${field}`;
      row.append(term, value);
      this.list.append(row);
      this.values.set(name, value);
    }
    setText(value, text);
    value.classList.toggle("unknown", text === UNKNOWN);
    if (value.title !== (why ?? "")) value.title = why ?? "";
  }
}
