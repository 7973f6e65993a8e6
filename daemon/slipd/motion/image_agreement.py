"""Whether two images of a pad show the shift of the contact that the force sensor measured between them.

The contact centroid moves when the contact moves over the pad, and also when a moment tilts the pressure, when the arm
accelerates the finger, or when the zero of the force sensor drifts. Only the image tells these apart: a shift moves the
edges, a tilt changes the pressure where it is, the others change nothing.

With x, y from the middle of the contact and m the mean of both images, their difference is fitted by m, x m, y m for a
change of load and tilt; by x² m, x y m, y² m for a tilt of a pressure that is tilted already; and by the change
that the measured shift (u, v) would make, −u ∂m/∂x − v ∂m/∂y.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.motion.image_fit import neighbours_along
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

LEAST_LEFT, LEAST_SHARE, LEAST_CORRELATION = 0.2, 0.4, 0.4
"""The six modes of load and tilt leave at least the first share of the squared change; otherwise a tilt may explain it.
What they leave shows at least the second share of the measured shift, and correlates with the change that this shift
would make by at least the third."""
SURE_LEFT, SURE_SHARE = 0.4, 0.15
"""No tilt leaves as much as the first share. Beyond it, the second share of the shift suffices: edges may lie between
electrodes."""
LEAST_TAXELS = 10
"""The six modes fit almost any image of fewer taxels."""
STDS = 5.0
"""The share must exceed 0 by this many standard deviations of the noise."""


class ImageAgreement:
    """Compares pairs of images of one pad of n taxels with measured shifts.

    Source of the limits: discs, rings, strips and rectangles on pads with and without gaps between the electrodes, with
    sharp and with blurred edges. Of 4800 tilts, up to where the contact opens, one met them; of shifts by 0.2 to
    0.6 mm, 73 to 94 % did, depending on the pad.

    Args:
        geometry: Layout of the taxels.
    """

    def __init__(self, geometry: PadGeometry) -> None:
        self._x, self._y = geometry.positions()
        west, east, south, north = neighbours_along(geometry).T
        self._west, self._east, self._south, self._north = west, east, south, north
        here = np.arange(geometry.taxels)
        self._wide = geometry.pitch_m * np.maximum((west != here) + 1.0 * (east != here), 1.0)
        self._high = geometry.pitch_m * np.maximum((south != here) + 1.0 * (north != here), 1.0)

    def shows(self, before: Array, after: Array, variance: Array, shift_m: Array) -> bool:
        """Return whether the contact moved by about a shift from one image to another.

        Args:
            before: Normal force on each taxel, shape (n,), in any unit.
            after: Likewise.
            variance: Variance of the difference by noise, shape (n,); infinity leaves a taxel out.
            shift_m: The shift that the force sensor measured, shape (2,), m; not zero.
        """
        mean = 0.5 * (before + after)
        slope_x = (mean[self._east] - mean[self._west]) / self._wide
        slope_y = (mean[self._north] - mean[self._south]) / self._high
        used = np.isfinite(variance)
        if np.count_nonzero(used) < LEAST_TAXELS:
            return False
        by_shift = -(shift_m[0] * slope_x + shift_m[1] * slope_y)[used]
        change, load = (after - before)[used], mean[used]
        x, y = self._x[used], self._y[used]
        x, y = x - x.mean(), y - y.mean()
        size = max(float(np.abs(x).max()), float(np.abs(y).max()))
        x, y = x / size, y / size
        modes = np.stack((load, load * x, load * y, load * x * x, load * x * y, load * y * y), axis=1)
        return _agree(change, by_shift, modes, variance[used])


def _agree(change: Array, by_shift: Array, modes: Array, variance: Array) -> bool:
    """Return whether the change of an image that its modes do not explain is that of the measured shift.

    Args:
        change: Change of the normal force on each taxel, shape (n,).
        by_shift: Change that the measured shift would make, shape (n,).
        modes: Changes by load and by tilt, shape (n, 6); both changes are compared after their best fit is subtracted.
        variance: Variance of ``change`` by noise, shape (n,).
    """
    fitted = np.linalg.lstsq(modes, np.stack((change, by_shift), axis=1), rcond=1e-9)[0]
    left = np.stack((change, by_shift), axis=1) - modes @ fitted
    of_change, of_both, of_shift = (float(left[:, i] @ left[:, k]) for i, k in ((0, 0), (0, 1), (1, 1)))
    share = of_change / max(float(change @ change), 1e-300)
    noise = math.sqrt(float(variance @ (left[:, 1] * left[:, 1])))
    if share > SURE_LEFT:
        return of_both > max(SURE_SHARE * of_shift, STDS * noise)
    like_a_shift = of_both > LEAST_CORRELATION * math.sqrt(of_change * of_shift)
    return share > LEAST_LEFT and like_a_shift and of_both > max(LEAST_SHARE * of_shift, STDS * noise)
