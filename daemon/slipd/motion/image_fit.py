"""Compare two images of a pad: did the contact move, or did its load change?

The difference of two images is linear in small changes. With their mean m, and x, y from its centroid:

* a shift by (u, v) gives −u ∂m/∂x − v ∂m/∂y, and a turn by θ gives θ (y ∂m/∂x − x ∂m/∂y);
* more load gives a multiple of m, a tilt multiples of x m and y m, and growth multiples of x ∂m/∂x and y ∂m/∂y.

All eight are fitted together, so that load, tilt and growth explain as much as they can. Only edges tell them from a
motion: a patch with none moves unseen, and so does an edge between two electrodes.

The force sensor measures a shift of the contact centroid far better than an image does, but the centroid also moves
when a moment tilts the pressure, when the arm accelerates the finger, or when the zero of the sensor drifts. The image
tells these apart: a shift moves the edges, a tilt changes the pressure where it is, the others change nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.level_hysteresis import CERTAIN_STDS
from slipd.motion.image_blocks import SLIGHT_SHARE, Block
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Indices, Mask

MODES, MOTIONS = 8, 3
"""Ways in which an image changes: gain, two of tilt, two of growth; then the motions: two of shift, and the turn."""
MOST_TILT = 0.3
"""A gap may open where the pressure falls across the contact by this share of its mean on either side. A change by tilt
that is stronger, relative at the radius of gyration, may lift one edge off the pad, which looks like a motion."""
LEAST_SHARE, SURE_SHARE = 0.2, 0.4
"""Load and tilt leave at least the first share of the squared change; otherwise a tilt may explain it. What they leave
shows at least the second share of the measured shift, and correlates as much with the change that this shift would
make. No tilt leaves more than the second share: then the first share of the shift suffices, because edges may lie
between electrodes."""

_MEAN, _VARIANCE, _SLOPE_X, _SLOPE_Y = range(4)
"""What `compare_taxels` finds of each taxel: mean of both images, variance of their difference by noise, infinite
outside the contact, and the slopes of the mean along X and Y, per m."""


class ImageFit(NamedTuple):
    """How the contact moved from one image to another.

    Attributes:
        shift_m: Motion of the contact along X and Y of the pad frame, and its turn times ``radius_m``, shape (3,), m.
        precision: Inverse covariance of the three at unit scale of the noise, shape (3, 3), 1/m².
        growth_m: How far growth moves the edges along X and Y, m.
        scale: Mean square of the residuals over that of the noise.
        freedom: Degrees of freedom of ``scale``.
        radius_m: Radius of gyration of the contact, m.
        tilt: Relative change of the pressure by tilt at that radius.
    """

    shift_m: Array
    precision: Array
    growth_m: tuple[float, float]
    scale: float
    freedom: int
    radius_m: float
    tilt: float


class ImageComparison:
    """Compares blocks of images of one pad of n taxels.

    Args:
        geometry: Layout of the taxels.
    """

    def __init__(self, geometry: PadGeometry) -> None:
        self._x, self._y = self._places = np.array(geometry.positions())
        self._sides = west, east, south, north = geometry.sides()
        self._spans = np.maximum((self._x[east] - self._x[west], self._y[north] - self._y[south]), geometry.pitch_m)
        self._all = np.ones(geometry.taxels, dtype=bool)

    def fit(self, before: Block, after: Block) -> ImageFit | None:
        """Fit the change from one block to a later one; None where too few taxels take part."""
        shift_m, precision, taxels = np.empty(MOTIONS), np.empty((MOTIONS, MOTIONS)), self._compare(before, after)
        found = fit_change(after.image - before.image, taxels, self._places, shift_m, precision)
        freedom, scale, radius_m, tilt, growth_x_m, growth_y_m = found
        if not freedom:
            return None
        return ImageFit(shift_m, precision, (growth_x_m, growth_y_m), scale, freedom, radius_m, tilt)

    def _compare(self, before: Block, after: Block) -> Array:
        """Return what two blocks show of each taxel, see `_MEAN`; shape (4, n)."""
        taxels, usable = np.empty((4, len(self._all))), self._all if after.usable is None else after.usable
        compare_taxels(before.image, after.image, after.variance, usable, self._sides, self._spans, taxels)
        return taxels

    def growth_m(self, fit: ImageFit, before: Block, after: Block) -> tuple[float, float]:
        """Return how far growth, or a gap that opens or closes, may have moved one edge along X and Y, m.

        No contact grows faster with its normal force than that of a sphere (Hertz: with the cube root). A gap opens
        only where an edge is hardly pressed.
        """
        most = [abs(after.load[2] - before.load[2]) / (3.0 * after.load[2]) * fit.radius_m] * 2
        for image in (before.image, after.image):
            on = image > SLIGHT_SHARE * float(image.max())
            loads = image[on]
            for axis, at in enumerate((self._x[on], self._y[on])):
                away = at - at.mean()
                squares = float(away @ away)
                fall = abs(float(away @ loads)) * math.sqrt(3.0 / (squares * len(at))) if squares > 0.0 else 0.0
                if fall > MOST_TILT * float(loads.mean()):
                    most[axis] = math.inf
        return min(fit.growth_m[0], most[0]), min(fit.growth_m[1], most[1])

    def shows_shift(self, before: Block, after: Block, shift_m: Array) -> bool:
        """Return whether the images show that the contact moved by about a shift that the force sensor measured.

        With x, y from the middle of the contact, the difference is fitted by m, x m, y m for a change of load and tilt,
        and by x² m, x y m, y² m for a tilt of a pressure that is tilted already. What they leave of it must be like
        what they leave of the change that the shift would make.

        Source of the limits: discs, rings, strips and rectangles on pads with and without gaps between the electrodes,
        with sharp and with blurred edges. Of 4800 tilts, up to where the contact opens, one met them; of shifts by 0.2
        to 0.6 mm, 73 to 94 % did, depending on the pad.

        Args:
            before: The earlier block.
            after: The later one.
            shift_m: The shift along X and Y, m; not zero.
        """
        mean, variance, slope_x, slope_y = self._compare(before, after)
        used = np.isfinite(variance)
        if np.count_nonzero(used) <= MODES:
            return False  # load and tilt fit almost any image of so few taxels
        by_shift = -(shift_m[0] * slope_x + shift_m[1] * slope_y)
        changes = np.stack((after.image - before.image, by_shift), axis=1)[used]
        x, y, load = self._x[used] - self._x[used].mean(), self._y[used] - self._y[used].mean(), mean[used]
        size = max(float(np.abs(x).max()), float(np.abs(y).max()))
        x, y = x / size, y / size
        modes = np.stack((load, load * x, load * y, load * x * x, load * x * y, load * y * y), axis=1)
        left = changes - modes @ np.linalg.lstsq(modes, changes, rcond=1e-9)[0]
        (of_change, of_both), (_, of_shift) = (left.T @ left).tolist()
        share = of_change / max(float(changes[:, 0] @ changes[:, 0]), 1e-300)
        noise = CERTAIN_STDS * math.sqrt(float(variance[used] @ (left[:, 1] * left[:, 1])))
        if share > SURE_SHARE:
            return bool(of_both > max(LEAST_SHARE * of_shift, noise))
        like_a_shift = of_both > SURE_SHARE * math.sqrt(of_change * of_shift)
        return bool(share > LEAST_SHARE and like_a_shift and of_both > max(SURE_SHARE * of_shift, noise))


@compiled
def compare_taxels(
    before: Array, after: Array, noise: Array, usable: Mask, sides: Indices, spans: Array, taxels: Array
) -> None:
    """Fill in what two images show of each taxel.

    Args:
        before: The earlier image, shape (n,).
        after: The later one, shape (n,).
        noise: Variance of one of them by noise, shape (n,); a taxel that shows less has the mean of the contact.
        usable: Taxels that measure by themselves, shape (n,).
        sides: Neighbours of each taxel, as `PadGeometry.sides`.
        spans: Distance of those along X, and of those along Y, shape (2, n), m.
        taxels: Filled, see `_MEAN`; shape (4, n).
    """
    count, mean = len(before), taxels[_MEAN]
    near, most, loads, loaded = np.zeros(count, np.bool_), 0.0, 0.0, 0
    for k in range(count):
        mean[k] = 0.5 * (before[k] + after[k])
        most = max(most, mean[k])
    for k in range(count):
        if mean[k] > 0.1 * most:
            loads += mean[k]
            loaded += 1
    least = SLIGHT_SHARE * loads / loaded if loaded > 0 else math.inf
    for k in range(count):
        if mean[k] > least:
            near[k] = True
            for side in sides[:, k]:
                near[side] = True
    common, inside = 0.0, 0
    for k in range(count):
        if near[k]:
            common += noise[k]
            inside += 1
    common /= max(inside, 1)
    for k in range(count):
        rounding = 1e-6 * most
        variance = 2.0 * max(noise[k], common) + rounding * rounding
        taxels[_VARIANCE, k] = variance if near[k] and usable[k] else math.inf
        taxels[_SLOPE_X, k] = (mean[sides[1, k]] - mean[sides[0, k]]) / spans[0, k]
        taxels[_SLOPE_Y, k] = (mean[sides[3, k]] - mean[sides[2, k]]) / spans[1, k]


@compiled
def fit_change(
    change: Array, taxels: Array, places: Array, shift_m: Array, precision: Array
) -> tuple[int, float, float, float, float, float]:
    """Fit the change of an image by all modes together, each taxel weighted by its variance.

    The motions come last in the Cholesky factor of the normal equations: its last rows are that of their precision
    where the other modes are free.

    Args:
        change: The change, shape (n,).
        taxels: As `compare_taxels` filled it.
        places: Taxel centres, shape (2, n), m.
        shift_m: Filled as ``shift_m`` of `ImageFit`.
        precision: Likewise.

    Returns:
        Freedom, scale, radius, tilt and the growth along X and Y of `ImageFit`; freedom 0: too few taxels take part.
    """
    mean, variance, used = taxels[_MEAN], taxels[_VARIANCE], np.empty(len(change), np.int64)
    count, total, x_sum, y_sum = 0, 0.0, 0.0, 0.0
    for k in range(len(change)):
        if math.isfinite(variance[k]):
            used[count] = k
            count += 1
            load = max(mean[k], 0.0)
            total += load
            x_sum += load * places[0, k]
            y_sum += load * places[1, k]
    total = max(total, 1e-300)  # without a load, the radius is 0
    x_mid, y_mid, xx, yy = x_sum / total, y_sum / total, 0.0, 0.0
    for k in used[:count]:
        x, y, load = places[0, k] - x_mid, places[1, k] - y_mid, max(mean[k], 0.0)
        xx += load * x * x / total
        yy += load * y * y / total
    radius_m = math.sqrt(xx + yy)
    if count <= MODES or radius_m == 0.0:
        return 0, 0.0, 0.0, 0.0, 0.0, 0.0
    modes, changes = np.empty((count, MODES)), np.empty(count)
    for n in range(count):
        k = used[n]
        x, y, load, weight = places[0, k] - x_mid, places[1, k] - y_mid, mean[k], 1.0 / math.sqrt(variance[k])
        slope_x, slope_y = taxels[_SLOPE_X, k], taxels[_SLOPE_Y, k]
        changes[n] = weight * change[k]
        each = modes[n]
        each[0], each[1], each[2] = weight * load, weight * load * x / radius_m, weight * load * y / radius_m
        each[3], each[4] = weight * x * slope_x, weight * y * slope_y
        each[5], each[6] = -weight * slope_x, -weight * slope_y
        each[7] = weight * (y * slope_x - x * slope_y) / radius_m
    factor, amount = _solve(modes, changes)
    for i in range(MOTIONS):
        shift_m[i] = amount[MODES - MOTIONS + i]
        for j in range(MOTIONS):
            precision[i, j] = 0.0
            for m in range(MODES - MOTIONS, MODES):
                precision[i, j] += factor[MODES - MOTIONS + i, m] * factor[MODES - MOTIONS + j, m]
    squares = 0.0
    for n in range(count):
        rest = changes[n]
        for i in range(MODES):
            rest -= amount[i] * modes[n, i]
        squares += rest * rest
    freedom, tilt = count - MODES, math.hypot(amount[1], amount[2])
    growth_x_m, growth_y_m = abs(amount[3]) * math.sqrt(3.0 * xx), abs(amount[4]) * math.sqrt(3.0 * yy)
    return freedom, squares / freedom, radius_m, tilt, growth_x_m, growth_y_m


@compiled_part
def _solve(modes: Array, changes: Array) -> tuple[Array, Array]:
    """Return the Cholesky factor of the normal equations of some modes, shape (count, MODES), and their amounts."""
    factor, amount = np.zeros((MODES, MODES)), np.zeros(MODES)
    for n in range(len(changes)):
        for i in range(MODES):
            amount[i] += modes[n, i] * changes[n]
            for j in range(i + 1):
                factor[i, j] += modes[n, i] * modes[n, j]
    for i in range(MODES):
        factor[i, i] = factor[i, i] * (1.0 + 1e-9) + 1e-300  # a pad of one row shows nothing across it
        for j in range(i):
            for m in range(j):
                factor[i, j] -= factor[i, m] * factor[j, m]
            factor[i, j] /= factor[j, j]
            factor[i, i] -= factor[i, j] * factor[i, j]
            amount[i] -= factor[i, j] * amount[j]
        factor[i, i] = math.sqrt(factor[i, i])
        amount[i] /= factor[i, i]
    for i in range(MODES - 1, -1, -1):
        for j in range(i + 1, MODES):
            amount[i] -= factor[j, i] * amount[j]
        amount[i] /= factor[i, i]
    return factor, amount
