"""Fit the change between two images of a pad by a motion of the contact and by what a change of load does to it.

The difference of two images is linear in small changes. With their mean m, and x, y from its centroid:

* a shift by (u, v) gives −u ∂m/∂x − v ∂m/∂y, and a turn by θ gives θ (y ∂m/∂x − x ∂m/∂y);
* more load gives a multiple of m, a tilt multiples of x m and y m, and growth multiples of x ∂m/∂x and y ∂m/∂y.

All eight are fitted together, so that load, tilt and growth explain as much as they can. Only edges tell them from a
motion: a patch with none moves unseen, and so does an edge between two electrodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Indices

MODES, MOTIONS = 8, 3
"""Ways in which an image changes: gain, two of tilt, two of growth; then the motions: two of shift, and the turn."""


class ImageFit(NamedTuple):
    """How the contact moved from one image to another; attributes are NaN where the images do not tell.

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


class ImageFitter:
    """Fits pairs of images of one pad of n taxels.

    Args:
        geometry: Layout of the taxels.
    """

    def __init__(self, geometry: PadGeometry) -> None:
        self._x, self._y = geometry.positions()
        self._beside = neighbours_along(geometry)
        self._pitch_m = geometry.pitch_m
        self._found = np.zeros(17)

    def fit(self, before: Array, after: Array, variance: Array) -> ImageFit | None:
        """Fit the change from one image to another.

        Args:
            before: Normal force on each taxel, shape (n,), in any unit.
            after: Likewise.
            variance: Variance of the difference by noise, shape (n,); infinity leaves a taxel out.

        Returns:
            None where too few taxels take part.
        """
        freedom = _fit(before, after, variance, self._x, self._y, self._beside, self._pitch_m, self._found)
        if freedom <= 0:
            return None
        found = self._found
        growth_x, growth_y, scale, radius_m, tilt = found[12:].tolist()
        precision = found[3:12].reshape(MOTIONS, MOTIONS).copy()
        return ImageFit(found[:3].copy(), precision, (growth_x, growth_y), scale, freedom, radius_m, tilt)


def neighbours_along(geometry: PadGeometry) -> Indices:
    """Return the neighbours of each taxel towards −X, +X, −Y and +Y, shape (n, 4); itself at the border."""
    x, y = geometry.positions()
    place = {
        (round(a / geometry.pitch_m * 2), round(b / geometry.pitch_m * 2)): k
        for k, (a, b) in enumerate(zip(x, y, strict=True))
    }
    steps = ((-2, 0), (2, 0), (0, -2), (0, 2))
    return np.array(
        [[place.get((a + da, b + db), k) for da, db in steps] for (a, b), k in place.items()], dtype=np.int64
    )


@compiled
def _fit(
    before: Array, after: Array, variance: Array, xs: Array, ys: Array, beside: Indices, pitch: float, found: Array
) -> int:
    """Do the work of `ImageFitter.fit`; return the degrees of freedom that are left, 0 where there are none.

    Args:
        before: As in `ImageFitter.fit`.
        after: Likewise.
        variance: Likewise.
        xs: Centres of the taxels, m.
        ys: Likewise.
        beside: Neighbours towards −X, +X, −Y and +Y.
        pitch: Distance of neighbours, m.
        found: Filled with the motion (3), its precision (9), growth (2), scale, radius and tilt.
    """
    total, cx, cy, taken = 0.0, 0.0, 0.0, 0
    for k in range(len(before)):
        if math.isfinite(variance[k]):
            load = max(before[k] + after[k], 0.0)
            total += load
            cx += load * xs[k]
            cy += load * ys[k]
            taken += 1
    if taken <= MODES or not total > 0.0:
        return 0
    cx /= total
    cy /= total
    xx, yy = 0.0, 0.0
    for k in range(len(before)):
        if math.isfinite(variance[k]):
            load = max(before[k] + after[k], 0.0)
            xx += load * (xs[k] - cx) ** 2
            yy += load * (ys[k] - cy) ** 2
    radius = math.sqrt((xx + yy) / total)
    if not radius > 0.0:
        return 0
    normal, right, square = np.zeros((MODES, MODES)), np.zeros(MODES), 0.0
    mode = np.empty(MODES)
    for k in range(len(before)):
        if not math.isfinite(variance[k]):
            continue
        west, east, south, north = beside[k, 0], beside[k, 1], beside[k, 2], beside[k, 3]
        wide = pitch * (int(west != k) + int(east != k))
        high = pitch * (int(south != k) + int(north != k))
        gx = 0.5 * (before[east] + after[east] - before[west] - after[west]) / wide if wide > 0.0 else 0.0
        gy = 0.5 * (before[north] + after[north] - before[south] - after[south]) / high if high > 0.0 else 0.0
        mean, x, y = 0.5 * (before[k] + after[k]), xs[k] - cx, ys[k] - cy
        mode[0], mode[1], mode[2] = mean, mean * x / radius, mean * y / radius
        mode[3], mode[4] = x * gx, y * gy
        mode[5], mode[6], mode[7] = -gx, -gy, (y * gx - x * gy) / radius
        change, weight = after[k] - before[k], 1.0 / variance[k]
        square += weight * change * change
        for i in range(8):
            right[i] += weight * mode[i] * change
            for j in range(i + 1):
                normal[i, j] += weight * mode[i] * mode[j]
    return _solve(normal, right, square, taken - MODES, xx / total, yy / total, radius, found)


@compiled
def _solve(
    normal: Array, right: Array, square: float, freedom: int, xx: float, yy: float, radius: float, found: Array
) -> int:
    """Solve the normal equations by Cholesky's method, in place; the motions come last, so their precision remains."""
    for i in range(8):
        normal[i, i] = normal[i, i] * (1.0 + 1e-9) + 1e-300
    for i in range(8):
        for j in range(i + 1):
            rest = normal[i, j]
            for k in range(j):
                rest -= normal[i, k] * normal[j, k]
            if i == j:
                normal[i, i] = math.sqrt(max(rest, 1e-300))
            else:
                normal[i, j] = rest / normal[j, j]
    explained = 0.0
    for i in range(8):
        rest = right[i]
        for k in range(i):
            rest -= normal[i, k] * right[k]
        right[i] = rest / normal[i, i]
        explained += right[i] * right[i]
    for i in range(7, -1, -1):
        rest = right[i]
        for k in range(i + 1, 8):
            rest -= normal[k, i] * right[k]
        right[i] = rest / normal[i, i]
    for i in range(3):
        found[i] = right[5 + i]
        for j in range(3):  # the lower right block of the factor is the factor of the precision
            total = 0.0
            for k in range(min(i, j) + 1):
                total += normal[5 + i, 5 + k] * normal[5 + j, 5 + k]
            found[3 + 3 * i + j] = total
    found[12], found[13] = abs(right[3]) * math.sqrt(3.0 * xx), abs(right[4]) * math.sqrt(3.0 * yy)
    found[14], found[15] = max(square - explained, 0.0) / freedom, radius
    found[16] = math.hypot(right[1], right[2])
    return freedom
