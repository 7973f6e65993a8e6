"""Whether the force sensor and the tactile image tell the same contact.

Both know where the force acts, a calibrated pad also how large it is. A sensor mounted otherwise than the config says,
a force sensor with a bias, half an image that is dead: each makes them differ, and then neither can be believed.

How far they may differ was found on 9,000 simulated contacts of 8 × 16 taxels (patches of 1 to 30 mm anywhere on the
pad, tilted until they lift off, gains with 5 % of spread). It depends on how many taxels are *inner*: active, with all
four side neighbours active. With one or more the centroids lay within a third of a pitch of each other, with none
(points, lines, strips along the border) within 1.5; the sum of the pressures was within exp(±FORCE (inner + 2)^−¾) of
the force, and without inner taxels it said nothing.

With these tolerances none of 4,500 further contacts at 1, 5 and 20 N was told wrongly. Told of 300 contacts at 5 N with
patches of 8 mm and more: axes swapped 90 %, flipped 90–96 %, turned 98–99 %, 10 mm off in the plane 100 % and along Z
81 %, a bias of 1 N along X 80 % and along Z 45–61 %, half the image dead 55–78 % (85 % of those where that half bore a
third of the load). The rest are contacts near the pad's centre or its axes, which look alike either way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slipd.fusion import Contact
from slipd.signals.pad import STEPS, neighbours

Array = NDArray[np.float64]

INNER_PITCHES = 0.5
"""Tolerance of the centroid, in pitches, with an inner taxel."""
OUTER_PITCHES = 1.75
"""Without one: where a contact is a line, C lies up to 1.5 pitches from the taxels that feel it, outside their hull.
That is tipping, and stays a matter of the tipping margin."""
FORCE = 1.3
"""Tolerance of the logarithm of the force ratio is this over (inner + 2)^¾: sampling by electrodes with gaps."""
STDS = 4.0
"""Standard deviations of the noise given."""
CLEAR = 2.0
"""Over the least normal force: a force that the image must show."""
PERSIST_NS = 60_000_000
PERSIST_IMAGES = 4
"""A disagreement is told once it has lasted for so long, and so many images: one image is a matter of skew."""
AGREE_NS = 200_000_000
"""It ends when both have agreed for so long."""

_SIDES = [k for k, (down, right) in enumerate(STEPS) if down == 0 or right == 0]


class Agreement:
    """Compares the force sensor and the image of one finger.

    Args:
        rows: Rows of the scan.
        cols: Columns of the scan.
        pitch_m: Distance between neighbouring taxels, m.
        least_n: Least normal force of a contact, N.
        gain_error: Relative error of the pad's calibration in newtons, such as 0.05; None for a pad without one, whose
            sum is not compared.
    """

    def __init__(self, rows: int, cols: int, pitch_m: float, least_n: float, gain_error: float | None = None) -> None:
        self._sides = neighbours(rows, cols)[:, _SIDES]
        self._pitch_m, self._least_n, self._gain_error = pitch_m, least_n, gain_error
        self._before: Contact | None = None
        self._since_ns: int | None = None
        self._images = 0
        self._agreed_ns = 0
        self._told: tuple[str, ...] = ()

    def update(
        self, t_ns: int, contact: Contact, force_std_n: float, x: Array, y: Array, pressure: Array
    ) -> tuple[str, ...]:
        """Takes an image and the contact that the force sensor saw at its time.

        Args:
            t_ns: Time of the image, rising.
            contact: What the force sensor tells; one that is not valid is not compared, and ends what was told.
            force_std_n: Standard deviation of its normal force, N.
            x: Taxel centres in the pad frame, shape (taxels,), m.
            y: Likewise, shape (taxels,), m.
            pressure: Normal force on each active taxel, 0 elsewhere, shape (taxels,); in newtons if calibrated.

        Returns:
            What the two disagree about, for long enough: "contact" (a clear force, and no image), "centroid", "force".
        """
        now = self._differences(contact, force_std_n, x, y, pressure)
        if not contact.valid:
            self.reset()
            return ()
        self._before = contact
        if not now:
            self._since_ns, self._images = None, 0
            if t_ns - self._agreed_ns >= AGREE_NS:
                self._told = ()
            return self._told
        if self._since_ns is None:
            self._since_ns = t_ns
        self._images += 1
        self._agreed_ns = t_ns
        if self._told or (self._images >= PERSIST_IMAGES and t_ns - self._since_ns >= PERSIST_NS):
            self._told = now
        return self._told

    def reset(self) -> None:
        """Forgets what was compared: the contact ended, or one of the streams did."""
        self._before, self._since_ns, self._images, self._told = None, None, 0, ()

    def _differences(
        self, contact: Contact, force_std_n: float, x: Array, y: Array, pressure: Array
    ) -> tuple[str, ...]:
        total = float(pressure.sum())
        if not (contact.valid and math.isfinite(total)):
            return ()
        if total <= 0.0:
            return ("contact",) if contact.normal_n > CLEAR * self._least_n else ()
        before = self._before or contact
        active = np.append(pressure > 0.0, False)
        inner = int(np.count_nonzero(active[:-1] & active[self._sides].all(axis=1)))
        found = []
        away_m = math.hypot(pressure @ x / total - contact.centroid_m[0], pressure @ y / total - contact.centroid_m[1])
        moved_m = math.dist(contact.centroid_m, before.centroid_m)  # since the last image, whose time is not quite this
        pitches = INNER_PITCHES if inner else OUTER_PITCHES
        if away_m > pitches * self._pitch_m + STDS * float(contact.centroid_std_m.max()) + moved_m:
            found.append("centroid")
        if inner and self._gain_error is not None:
            tolerance = -math.expm1(-self._gain_error - FORCE * (inner + 2) ** -0.75)
            least = STDS * force_std_n + abs(contact.normal_n - before.normal_n)
            if abs(total - contact.normal_n) > tolerance * max(total, contact.normal_n) + least:
                found.append("force")
        return tuple(found)
