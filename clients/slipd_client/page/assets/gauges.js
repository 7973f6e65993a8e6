// Small pictures of a value and its limit: utilisation with its bounds, force and spin, grip force.

import { arrow, begin, circle, colour, hatch, label, line } from "./canvas.js";
import { isNumber, isVector, quantity } from "./format.js";

/** Utilisation beyond which the bar is full: it slips at 1. */
const FULL_BAR = 1.2;

/** The bar of utilisation: filled up to its value, a bracket from its lower to its upper bound, a mark at 1. */
export function drawUtilisation(canvas, slip) {
  const { context, width, height } = begin(canvas);
  const at = (value) => (Math.min(Math.max(value, 0), FULL_BAR) / FULL_BAR) * width;
  context.fillStyle = colour("--pad");
  context.fillRect(0, 4, width, height - 8);
  const { utilisation: value, utilisation_lower: low, utilisation_upper: high } = slip ?? {};
  if (isNumber(value)) {
    context.fillStyle = colour("--load");
    context.fillRect(0, 4, at(value), height - 8);
  }
  if (isNumber(low) && isNumber(high)) {
    context.strokeStyle = colour("--ink");
    context.lineWidth = 2;
    line(context, [at(low), height / 2], [at(high), height / 2]);
    for (const end of [low, high]) line(context, [at(end), height / 2 - 6], [at(end), height / 2 + 6]);
  }
  context.strokeStyle = colour("--limit");
  context.lineWidth = 3;
  line(context, [at(1), 0], [at(1), height]);
  if (!isNumber(value)) {
    context.textAlign = "center";
    label(context, "utilisation unknown", width / 2, height / 2, colour("--ink"));
    context.textAlign = "left";
  }
  return { value: isNumber(value) ? at(value) : null, one: at(1) };
}

/** The tangential force within the circle of what friction carries without spin; around it the spin within its limit. */
export function drawForce(canvas, slip) {
  const { context, width, height } = begin(canvas);
  const centre = [width / 2, height / 2];
  const ring = Math.min(width, height) / 2 - 6;
  const radius = ring - 12;
  const limit_n = isNumber(slip?.mu) && isNumber(slip?.normal_n) ? slip.mu * slip.normal_n : null;
  context.lineWidth = 1.5;
  context.strokeStyle = colour("--line");
  circle(context, ...centre, radius);
  if (!isNumber(limit_n)) context.setLineDash([4, 4]);
  context.stroke();
  context.setLineDash([]);
  line(context, [centre[0] - radius, centre[1]], [centre[0] + radius, centre[1]]);
  line(context, [centre[0], centre[1] - radius], [centre[0], centre[1] + radius]);
  drawSpin(context, centre, ring, slip);
  if (isVector(slip?.tangential_n) && isNumber(limit_n) && limit_n > 0) {
    const [x, y] = slip.tangential_n.map((part) => (part / limit_n) * radius);
    const cut = Math.min(1, (ring - 2) / Math.max(Math.hypot(x, y), 1e-9));
    context.strokeStyle = context.fillStyle = colour("--centroid");
    context.lineWidth = 4;
    arrow(context, centre, [centre[0] + cut * x, centre[1] - cut * y], 12);
    return { centre, radius, tip: [centre[0] + cut * x, centre[1] - cut * y] };
  }
  context.textAlign = "center";
  label(context, isVector(slip?.tangential_n) ? "limit unknown" : "unknown", ...centre, colour("--ink"));
  context.textAlign = "left";
  return { centre, radius, tip: null };
}

/** An arc from the top, against the clock for a positive spin; a whole half turn is the limit. Unknown: a dashed ring. */
function drawSpin(context, [x, y], radius, slip) {
  context.lineWidth = 6;
  context.strokeStyle = colour("--pad");
  const { spin_nm: spin, torque_limit_nm: limit } = slip ?? {};
  const known = isNumber(spin) && isNumber(limit) && limit !== 0;
  if (!known) context.setLineDash([4, 4]);
  circle(context, x, y, radius);
  context.stroke();
  context.setLineDash([]);
  if (!known) return;
  const share = Math.min(Math.abs(spin / limit), 1) * Math.PI;
  context.strokeStyle = colour("--pole");
  context.beginPath();
  context.arc(x, y, radius, -Math.PI / 2, -Math.PI / 2 - Math.sign(spin) * share, spin > 0);
  context.stroke();
}

/** Grip force now, needed and allowed, on one scale. An unknown force is hatched. */
export function drawGrip(canvas, now_n, needed_n, limit_n) {
  const { context, width, height } = begin(canvas);
  const known = [now_n, needed_n, limit_n].filter(isNumber);
  context.fillStyle = colour("--pad");
  context.fillRect(0, 18, width, height - 36);
  const largest = Math.max(...known, 1) * 1.08;
  const at = (force) => (Math.max(force, 0) / largest) * width;
  if (isNumber(now_n)) {
    context.fillStyle = colour("--load");
    context.fillRect(0, 18, at(now_n), height - 36);
  } else {
    hatch(context, 0, 18, width, height - 36, colour("--unknown"));
    context.textAlign = "center";
    label(context, "grip force unknown", width / 2, height / 2, colour("--ink"));
    context.textAlign = "left";
  }
  const marks = [
    [needed_n, "needed", "--pole", 9],
    [limit_n, "limit", "--limit", height - 9],
  ];
  for (const [force, name, ink, y] of marks) {
    if (!isNumber(force)) continue;
    context.strokeStyle = colour(ink);
    context.lineWidth = 3;
    line(context, [at(force), 16], [at(force), height - 16]);
    context.textAlign = at(force) > width / 2 ? "right" : "left";
    label(context, `${name} ${quantity(force, 1, "N")}`, at(force), y, colour("--ink"));
    context.textAlign = "left";
  }
  return { now: isNumber(now_n) ? at(now_n) : null };
}
