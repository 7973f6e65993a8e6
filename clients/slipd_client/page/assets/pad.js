// The picture of one pad: loads, friction circles, outline, contact centroid C, pole P, taxels that are not used.

import { arrow, begin, circle, colour, label, line } from "./canvas.js";
import { isVector, quantity } from "./format.js";
import { edgePoint, frictionLimits, padGeometry } from "./pad_geometry.js";

/** Part of a taxel's half side that the largest friction circle fills. */
const LARGEST_CIRCLE = 0.92;

/** Taxels that are drawn smaller than this, px, get no circles. */
const LEAST_TAXEL_PX = 6;

/**
 * Draw a pad; return where everything was drawn, in CSS pixels, for the caption and for tests.
 *
 * @param canvas where to draw
 * @param tactile the pad's image; null if it is missing or out of date
 * @param known the newest image, however old: the pad keeps its size and scale
 * @param slip the verdict; null if it is out of date
 * @param masked indices of the taxels that are not used
 */
export function drawPad(canvas, tactile, known, slip, masked) {
  const { context, width, height } = begin(canvas);
  const geometry = padGeometry(known, slip, width, height);
  const { scale, origin, half } = geometry;
  const drawn = { scale, origin, half, taxels: [], circles: [], centroid: null, pole: null };
  const pictured = tactile && geometry.centres.length;
  drawGround(context, geometry, pictured);
  if (pictured) {
    drawn.taxels = drawLoads(context, geometry, tactile, masked);
    drawn.largest = Math.max(0, ...(tactile.loads_n ?? []));
    Object.assign(drawn, drawCircles(context, geometry, tactile, slip));
    drawOutline(context, geometry, tactile);
  }
  if (isVector(slip?.pole_m)) drawn.pole = drawPole(context, geometry, slip);
  if (isVector(slip?.centroid_m)) drawn.centroid = drawCentroid(context, geometry, slip);
  return drawn;
}

function drawGround(context, geometry, pictured) {
  const [left, top] = geometry.toPixels([-geometry.half[0], geometry.half[1]]);
  const [right, bottom] = geometry.toPixels([geometry.half[0], -geometry.half[1]]);
  context.fillStyle = colour("--pad");
  context.fillRect(left, top, right - left, bottom - top);
  context.strokeStyle = colour("--line");
  context.lineWidth = 1;
  if (!pictured) context.setLineDash([4, 4]);
  context.strokeRect(left, top, right - left, bottom - top);
  context.setLineDash([]);
  const corner = [left, bottom + 20];
  context.strokeStyle = context.fillStyle = colour("--faint");
  arrow(context, corner, [left + 22, bottom + 20], 6);
  arrow(context, corner, [left, bottom - 2 > bottom ? bottom : bottom + 2], 6);
  context.fillText("x", left + 26, bottom + 20);
  context.fillText("y", left + 5, bottom + 9);
}

function drawLoads(context, geometry, tactile, masked) {
  const side = tactile.pitch_m * geometry.scale;
  const loads = tactile.loads_n;
  const largest = Math.max(0, ...(loads ?? []));
  const unused = new Set(masked);
  return geometry.centres.map((centre, index) => {
    const [x, y] = geometry.toPixels(centre);
    const [left, top] = [x - side / 2 + 0.5, y - side / 2 + 0.5];
    if (unused.has(index)) {
      context.strokeStyle = colour("--masked");
      context.lineWidth = 1.5;
      line(context, [left + 2, top + 2], [left + side - 3, top + side - 3]);
      line(context, [left + 2, top + side - 3], [left + side - 3, top + 2]);
    } else if (loads) {
      const share = largest > 0 ? loads[index] / largest : 0;
      context.fillStyle = colour("--load");
      context.globalAlpha = share > 0 ? 0.12 + 0.88 * share : 0;
      context.fillRect(left, top, side - 1, side - 1);
      context.globalAlpha = 1;
    }
    return [x, y, side / 2];
  });
}

function drawCircles(context, geometry, tactile, slip) {
  const limits = frictionLimits(tactile, slip);
  if (!limits || tactile.pitch_m * geometry.scale < LEAST_TAXEL_PX) return { circles: [], newtonsPerPixel: null, largestLimit: null };
  const largest = Math.max(...limits);
  const pixels = (LARGEST_CIRCLE * tactile.pitch_m * geometry.scale) / 2 / largest;
  context.strokeStyle = colour("--circle");
  context.lineWidth = 1.5;
  const circles = [];
  limits.forEach((limit, index) => {
    if (limit <= 0) return;
    const [x, y] = geometry.toPixels(geometry.centres[index]);
    circle(context, x, y, limit * pixels);
    context.stroke();
    circles.push([x, y, limit * pixels, index]);
  });
  return { circles, newtonsPerPixel: 1 / pixels, largestLimit: largest };
}

function drawOutline(context, geometry, tactile) {
  if (!Array.isArray(tactile.corners_m) || tactile.corners_m.length < 2) return;
  context.beginPath();
  for (const corner of tactile.corners_m) context.lineTo(...geometry.toPixels(corner));
  context.closePath();
  context.strokeStyle = colour("--outline");
  context.lineWidth = 2.5;
  context.stroke();
}

function drawCentroid(context, geometry, slip) {
  const [x, y] = geometry.toPixels(slip.centroid_m);
  const spread = slip.centroid_std_m;
  if (isVector(spread)) {
    context.beginPath();
    context.ellipse(x, y, spread[0] * geometry.scale, spread[1] * geometry.scale, 0, 0, 2 * Math.PI);
    context.strokeStyle = colour("--centroid");
    context.lineWidth = 1;
    context.stroke();
  }
  circle(context, x, y, 7);
  context.fillStyle = colour("--card");
  context.fill();
  circle(context, x, y, 5);
  context.fillStyle = colour("--centroid");
  context.fill();
  label(context, "C", x + 9, y - 11, colour("--centroid"));
  return [x, y];
}

/** The pole, or outside the pad an arrow at the edge that points from C to it, with the distance between them. */
function drawPole(context, geometry, slip) {
  const pole = slip.pole_m;
  const from = isVector(slip.centroid_m) ? slip.centroid_m : [0, 0];
  const distance_m = Math.hypot(pole[0] - from[0], pole[1] - from[1]);
  const ink = colour("--pole");
  if (geometry.inside(pole)) {
    const [x, y] = geometry.toPixels(pole);
    context.fillStyle = colour("--card");
    context.fillRect(x - 7, y - 7, 14, 14);
    context.fillStyle = ink;
    context.fillRect(x - 5, y - 5, 10, 10);
    label(context, "P", x - 19, y - 11, ink);
    return { inside: true, at: [x, y], middle: [x, y], distance_m };
  }
  const start = geometry.inside(from) ? from : [0, 0];
  const tip = geometry.toPixels(edgePoint(geometry, start, pole, 14 / geometry.scale));
  const tail = geometry.toPixels(edgePoint(geometry, start, pole, -8 / geometry.scale));
  context.strokeStyle = context.fillStyle = ink;
  context.lineWidth = 3;
  arrow(context, tail, tip, 11);
  const text = `P ${quantity(distance_m, 0, "mm", 1000)}`;
  const room = context.measureText(text).width;
  const left = Math.min(Math.max(tip[0] - room / 2, 2), 2 * geometry.origin[0] - room - 2);
  const top = tip[1] < geometry.origin[1] ? Math.max(tip[1] - 10, 9) : Math.min(tip[1] + 12, 2 * geometry.origin[1] - 9);
  label(context, text, left, top, ink);
  return { inside: false, at: tip, middle: [(tail[0] + tip[0]) / 2, (tail[1] + tip[1]) / 2], distance_m };
}
