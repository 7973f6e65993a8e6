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

from slipd.motion.image_blocks import Block
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

MODES, MOTIONS = 8, 3
"""Ways in which an image changes: gain, two of tilt, two of growth; then the motions: two of shift, and the turn."""
MODEL_SHARE = 0.005
"""What a taxel reads may differ from the model by this share of its load."""
ACTIVE_SHARE = 0.05
"""A taxel belongs to the contact, with those beside it, above this share of the mean of the loaded taxels."""
OPENS = 0.25
"""A gap may open where the pressure falls across the contact by this share of its mean on either side."""
LEAST_LEFT, LEAST_SHARE, LEAST_CORRELATION = 0.2, 0.4, 0.4
"""Load and tilt leave at least the first share of the squared change; otherwise a tilt may explain it. What they leave
shows at least the second share of the measured shift, and correlates with the change that this shift would make by at
least the third."""
SURE_LEFT, SURE_SHARE = 0.4, 0.15
"""No tilt leaves as much as the first share. Beyond it, the second share of the shift suffices: edges may lie between
electrodes."""
LEAST_TAXELS = 10
"""Load and tilt fit almost any image of fewer taxels."""
STDS = 5.0
"""The share must exceed 0 by this many standard deviations of the noise."""

_DIAGONAL = np.diag_indices(MODES)


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
        self._x, self._y = geometry.positions()
        self._sides = west, east, south, north = geometry.sides()
        self._wide_m = np.maximum(self._x[east] - self._x[west], geometry.pitch_m)
        self._high_m = np.maximum(self._y[north] - self._y[south], geometry.pitch_m)

    def fit(self, before: Block, after: Block) -> ImageFit | None:
        """Fit the change from one block to a later one; None where too few taxels take part."""
        variance = self._variance(before, after)
        used = np.isfinite(variance)
        freedom = int(np.count_nonzero(used)) - MODES
        mean = 0.5 * (before.image + after.image)
        load = np.maximum(mean[used], 0.0)
        total = float(load.sum())
        if freedom <= 0 or not total > 0.0:
            return None
        x, y = self._x[used], self._y[used]
        x, y = x - load @ x / total, y - load @ y / total
        xx, yy = float(load @ (x * x)) / total, float(load @ (y * y)) / total
        radius_m = math.sqrt(xx + yy)
        if radius_m == 0.0:  # pragma: no cover - four loaded taxels never stand at one place
            return None
        slope_x, slope_y = (slope[used] for slope in self._slopes(mean))
        load = mean[used]
        load_modes = (load, load * x / radius_m, load * y / radius_m, x * slope_x, y * slope_y)
        motions = (-slope_x, -slope_y, (y * slope_x - x * slope_y) / radius_m)
        weight = 1.0 / np.sqrt(variance[used])
        modes = weight * np.array(load_modes + motions)
        change = weight * (after.image - before.image)[used]
        normal = modes @ modes.T
        normal[_DIAGONAL] = normal[_DIAGONAL] * (1.0 + 1e-9) + 1e-300  # a pad of one row shows nothing across it
        inverse = np.linalg.inv(normal)
        amount = inverse @ (modes @ change)
        rest = change - amount @ modes
        growth_m = abs(float(amount[3])) * math.sqrt(3.0 * xx), abs(float(amount[4])) * math.sqrt(3.0 * yy)
        return ImageFit(
            amount[-MOTIONS:],
            np.linalg.inv(inverse[-MOTIONS:, -MOTIONS:]),
            growth_m,
            float(rest @ rest) / freedom,
            freedom,
            radius_m,
            math.hypot(amount[1], amount[2]),
        )

    def growth_m(self, fit: ImageFit, before: Block, after: Block) -> tuple[float, float]:
        """Return how far growth, or a gap that opens or closes, may have moved one edge along X and Y, m.

        No contact grows faster with its normal force than that of a sphere (Hertz: with the cube root). A gap opens
        only where an edge is hardly pressed.
        """
        most = [abs(after.load[2] - before.load[2]) / (3.0 * after.load[2]) * fit.radius_m] * 2
        for image in (before.image, after.image):
            on = image > ACTIVE_SHARE * float(image.max())
            loads = image[on]
            for axis, at in enumerate((self._x[on], self._y[on])):
                away = at - at.mean()
                squares = float(away @ away)
                fall = abs(float(away @ loads)) * math.sqrt(3.0 / (squares * len(at))) if squares > 0.0 else 0.0
                if fall > OPENS * float(loads.mean()):
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
            shift_m: The shift, shape (2,), m; not zero.
        """
        variance = self._variance(before, after)
        used = np.isfinite(variance)
        if np.count_nonzero(used) < LEAST_TAXELS:
            return False
        mean = 0.5 * (before.image + after.image)
        slope_x, slope_y = self._slopes(mean)
        by_shift = -(shift_m[0] * slope_x + shift_m[1] * slope_y)
        changes = np.stack((after.image - before.image, by_shift), axis=1)[used]
        x, y, load = self._x[used] - self._x[used].mean(), self._y[used] - self._y[used].mean(), mean[used]
        size = max(float(np.abs(x).max()), float(np.abs(y).max()))
        x, y = x / size, y / size
        modes = np.stack((load, load * x, load * y, load * x * x, load * x * y, load * y * y), axis=1)
        left = changes - modes @ np.linalg.lstsq(modes, changes, rcond=1e-9)[0]
        (of_change, of_both), (_, of_shift) = (left.T @ left).tolist()
        share = of_change / max(float(changes[:, 0] @ changes[:, 0]), 1e-300)
        noise = STDS * math.sqrt(float(variance[used] @ (left[:, 1] * left[:, 1])))
        if share > SURE_LEFT:
            return bool(of_both > max(SURE_SHARE * of_shift, noise))
        like_a_shift = of_both > LEAST_CORRELATION * math.sqrt(of_change * of_shift)
        return bool(share > LEAST_LEFT and like_a_shift and of_both > max(LEAST_SHARE * of_shift, noise))

    def _slopes(self, image: Array) -> tuple[Array, Array]:
        """Return the slopes of an image along X and Y, each shape (n,), per m."""
        west, east, south, north = self._sides
        return (image[east] - image[west]) / self._wide_m, (image[north] - image[south]) / self._high_m

    def _variance(self, before: Block, after: Block) -> Array:
        """Return the variance of the difference of two blocks by noise and errors of the model; infinity outside."""
        mean = 0.5 * (before.image + after.image)
        most = float(mean.max())
        on = mean > (ACTIVE_SHARE * mean[mean > 0.1 * most].mean() if most > 0.0 else math.inf)
        near = on | on[self._sides].any(axis=0)
        noise = np.maximum(after.variance, after.variance[near].mean() if near.any() else math.inf)
        variance: Array = 2.0 * noise + (MODEL_SHARE * mean) ** 2 + (1e-6 * most) ** 2
        variance[~near if after.usable is None else ~(near & after.usable)] = math.inf
        return variance
