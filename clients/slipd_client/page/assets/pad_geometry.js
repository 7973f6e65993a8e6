// Where things of the pad's frame are on its canvas: X to the right, Y up, seen from the object.

import { isNumber, isVector } from "./format.js";

/** Half of what is shown of a pad whose image says nothing of its size, m. */
const HALF_UNKNOWN_M = 0.015;

/** More than any pad has. */
const MOST_TAXELS = 4096;

/** Room around the pad for the arrow to a pole outside, px. */
const EDGE_PX = 34;

/** Direction of one step of a row or column index: "+x" is [1, 0]. */
const AXES = { "+x": [1, 0], "-x": [-1, 0], "+y": [0, 1], "-y": [0, -1] };

/** Centres of the taxels in scan order, m; none where the message does not say where they are. */
export function taxelCentres(tactile) {
  const { rows, cols, pitch_m: pitch } = tactile ?? {};
  const [down, along] = [AXES[tactile?.rows_along], AXES[tactile?.cols_along]];
  if (!isNumber(pitch) || !down || !along) return [];
  if (!(rows * cols <= MOST_TAXELS)) return [];
  const centres = [];
  for (let row = 0; row < rows; row += 1) {
    for (let col = 0; col < cols; col += 1) {
      const [r, c] = [(row - (rows - 1) / 2) * pitch, (col - (cols - 1) / 2) * pitch];
      centres.push([r * down[0] + c * along[0], r * down[1] + c * along[1]]);
    }
  }
  return centres;
}

/** The scale and the origin that show the whole pad. */
export function padGeometry(tactile, slip, width, height) {
  const centres = taxelCentres(tactile);
  const half = [0, 1].map((axis) => {
    const reach = centres.map((each) => Math.abs(each[axis]));
    if (reach.length) return Math.max(...reach) + tactile.pitch_m / 2;
    const centroid = isVector(slip?.centroid_m) ? Math.abs(slip.centroid_m[axis]) : 0;
    return Math.max(HALF_UNKNOWN_M, 1.3 * centroid);
  });
  const scale = Math.max(
    1,
    Math.min((width / 2 - EDGE_PX) / half[0], (height / 2 - EDGE_PX) / half[1]),
  );
  const origin = [width / 2, height / 2];
  return {
    centres,
    half,
    scale,
    origin,
    toPixels: ([x, y]) => [origin[0] + x * scale, origin[1] - y * scale],
    inside: ([x, y]) => Math.abs(x) <= half[0] && Math.abs(y) <= half[1],
  };
}

/** Where the line from `from` towards `to` leaves the pad, grown by a margin in m. */
export function edgePoint(geometry, from, to, margin) {
  const direction = [to[0] - from[0], to[1] - from[1]];
  const shares = [0, 1]
    .filter((axis) => direction[axis] !== 0)
    .map((axis) => (Math.sign(direction[axis]) * (geometry.half[axis] + margin) - from[axis]) / direction[axis]);
  const share = Math.min(1, ...shares.filter((each) => each >= 0));
  return [from[0] + share * direction[0], from[1] + share * direction[1]];
}

/**
 * Friction limit of each taxel, N: its share of the normal force times μ. Null where a factor is not known.
 */
export function frictionLimits(tactile, slip) {
  const loads = tactile?.loads_n;
  if (!Array.isArray(loads) || !isNumber(slip?.mu) || slip.force_unit !== "N" || !isNumber(slip.normal_n)) return null;
  const total = loads.reduce((sum, load) => sum + load, 0);
  return total > 0 ? loads.map((load) => (slip.mu * slip.normal_n * load) / total) : null;
}
