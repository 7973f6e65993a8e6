"""Compare the contact of the force sensor with that of the tactile image of one finger.

Both measure where the force acts; a calibrated pad also measures how large it is. A mounting that differs from the
config, a bias of the force sensor or a half-dead image makes them disagree, and then neither is trusted.

The tolerances come from 9,000 simulated contacts on 8 × 16 taxels (patches of 1 to 30 mm anywhere on the pad, tilted
until they lift off, taxel gains with 5 % spread). They depend on the number of *inner* taxels: active, with all four
side neighbours active. With at least one, the centroids lay within a third of a pitch of each other; with none (points,
lines, strips along the border) within 1.5 pitches. The sum of the pressures lay within exp(±FORCE (inner + 2)^−¾) of
the force; without inner taxels it carried no information.

With these tolerances none of 4,500 further contacts at 1, 5 and 20 N gave a false disagreement. Detected of 300
contacts at 5 N with patches of at least 8 mm: axes swapped 90 %, flipped 90–96 %, rotated 98–99 %, 10 mm off in the
plane 100 % and along Z 81 %, a bias of 1 N along X 80 % and along Z 45–61 %, half the image dead 55–78 % (85 % of those
in which that half carried a third of the load). The others are contacts near the pad's centre or axes, which look the
same either way.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Pad
from slipd.finger.force_channel import ForceChannel
from slipd.fusion import Contact
from slipd.fusion.compiled import compiled
from slipd.fusion.contact import contact_numbers
from slipd.fusion.recent_forces import begin_range, mean_wrench
from slipd.fusion.rows import Rows
from slipd.signals.pad import STEPS, neighbours
from slipd.types.arrays import Array, Indices

if TYPE_CHECKING:
    from slipd.finger.image_channel import ImageChannel

MOVING_STDS = 6.0
"""The normal force moves where its range between two images exceeds this many standard deviations of its noise."""
COMPARE_NS = 10_000_000
"""At most one comparison in this time: a disagreement counts only once it has lasted for longer."""
INNER_PITCHES = 0.5
"""Tolerance of the centroid, in pitches, with an inner taxel."""
OUTER_PITCHES = 1.75
"""Tolerance of the centroid, in pitches, without an inner taxel. The centroid of a line contact lies up to 1.5 pitches
outside the hull of its active taxels; that is tipping, which the tipping margin covers."""
FORCE = 1.3
"""Tolerance of the logarithm of the force ratio, times (inner + 2)^¾: electrodes with gaps sample the pressure."""
STDS = 4.0
"""Tolerance for noise, in standard deviations."""
CLEAR = 2.0
"""Multiple of the least normal force from which the image must show a contact."""
PERSIST_NS = 60_000_000
PERSIST_IMAGES = 4
"""A disagreement counts once it has lasted for this time and this many images; a single image may be time skew."""
AGREE_NS = 200_000_000
"""A disagreement ends once both have agreed for this time."""
KEPT, GONE = 0.75, 0.25
"""A force sensor that falls from a clear contact to none between two images has failed if the image keeps the first
share of its sum; the contact lasts until the image falls below the second. A release leaves about a tenth."""

_CONTACT: tuple[str, ...] = ("disagreement_contact",)
_SIDES = [k for k, (down, right) in enumerate(STEPS) if down == 0 or right == 0]


class ForceSummary(NamedTuple):
    """Measurements of the finger's force sensor since the image before.

    Attributes:
        no_contact: It reads no contact. False also where it reads nothing, or has lost a contact that the image shows:
            a held load must not be taken for an offset, or for hot taxels.
        normal_n: Normal force now, N; None: unknown.
        moving: The normal force moved beyond its noise; None: unknown.
        agrees: Force and images did not contradict each other so far.
    """

    no_contact: bool = False
    normal_n: float | None = None
    moving: bool | None = None
    agrees: bool = False


NO_SUMMARY: ForceSummary = ForceSummary()
"""No force sensor, or its contact is not known."""


class ForceImageCheck:
    """What force sensor and image of one finger contradict each other about.

    Args:
        config: ``[finger.X]``.
        pad: ``[finger.X.pad]``.
        force: The force sensor.
        image: The pad.
        state: One row of CONTACT_STATE, whose forces the kernels keep.

    Attributes:
        agreement: Whether both show the same contact.
    """

    def __init__(self, config: FingerConfig, pad: Pad, force: ForceChannel, image: ImageChannel, state: Rows) -> None:
        self._force, self._image = force, image
        self._state, self._moving_n = state, MOVING_STDS * force.noise.force_std_n
        self.agreement = Agreement(pad.rows, pad.cols, pad.pitch_m, config.min_normal_n, pad.gain_error)
        self._compared_ns = 0

    def take_summary(self, normal_n: float | None, *, free: bool) -> ForceSummary:
        """Return what the force sensor measured since the image before, and begin the next interval.

        Args:
            normal_n: Normal force now, N; None: it is not known.
            free: Nothing touches the pad by it.
        """
        if normal_n is None:
            return NO_SUMMARY
        moving = begin_range(self._state, normal_n) > self._moving_n
        lost = self.agreement.shown > 0.0 and not self._image.reasons
        return ForceSummary(free and not lost, normal_n, moving, not self.agreement.reported)

    def update_image(self, t_ns: int, *, known: bool) -> None:
        """Compare the newest image with the force at its time.

        What the unknown weight of the finger may add counts fully: `Agreement` allows ``STDS`` standard deviations.

        Args:
            t_ns: When the image was acquired.
            known: The newest force is known.
        """
        image = self._image
        if not (known and image.is_independent):
            self.agreement.reset()
            return
        if t_ns - self._compared_ns < COMPARE_NS:
            return
        self._compared_ns = t_ns
        force_std_n, torque_std_nm, unknown_n, unknown_nm = self._force.uncertainty(t_ns)
        contact = Contact(
            *_contact_at(self._state, t_ns, force_std_n + unknown_n / STDS, torque_std_nm + unknown_nm / STDS)
        )
        self.agreement.update(t_ns, contact, force_std_n + unknown_n, image.x, image.y, image.pressure)


class Agreement:
    """Compares the force sensor and the image of one finger.

    Args:
        rows: Rows of the scan.
        cols: Columns of the scan.
        pitch_m: Distance between neighbouring taxels, m.
        least_n: Least normal force of a contact, N.
        gain_error: Relative error of the pad's calibration in newtons, such as 0.05; None for a pad without one, whose
            sum is not compared.

    Attributes:
        reported: Reasons of a lasting disagreement: "disagreement_contact" (one of both shows a clear contact, the
            other none), "disagreement_centroid", "disagreement_force".
        shown: Sum of the image of the last clear contact that the force sensor measures, or has lost; 0 where it ended.
        gripped: The gripper and another finger show a clear grip, of which this force sensor must measure its share.
    """

    def __init__(self, rows: int, cols: int, pitch_m: float, least_n: float, gain_error: float | None = None) -> None:
        self._sides = np.ascontiguousarray(neighbours(rows, cols)[:, _SIDES])
        self._pitch_m, self._least_n, self._gain_error = pitch_m, least_n, gain_error
        self._before: Contact | None = None
        self._images = self._since_ns = 0  # in a row that differ, and since when
        self._differed_ns = 0
        self.shown = 0.0
        self.gripped = False
        self.reported: tuple[str, ...] = ()

    def update(
        self, t_ns: int, contact: Contact, force_std_n: float, x: Array, y: Array, pressure: Array
    ) -> tuple[str, ...]:
        """Update with an image and the contact that the force sensor measured at its time.

        Args:
            t_ns: Time of the image, rising.
            contact: Contact measured by the force sensor; invalid where it measures none, or is not trusted. That ends
                a disagreement unless the image still shows the contact.
            force_std_n: Standard deviation of its normal force, N.
            x: Taxel centres in the pad frame, shape (taxels,), m.
            y: Likewise, shape (taxels,), m.
            pressure: Normal force on each active taxel, 0 elsewhere, shape (taxels,); in newtons if calibrated.

        Returns:
            `reported`.
        """
        total, x_sum, y_sum, inner = _moments(x, y, pressure, self._sides)
        missed = self.gripped and total > 0.0 and contact.normal_n + force_std_n < self._least_n
        if contact.valid:
            found = self._differences(contact, force_std_n, total, x_sum, y_sum, inner)
            if contact.normal_n > CLEAR * self._least_n:
                self.shown = total if math.isfinite(total) else 0.0
            elif not self.reported:
                self.shown = 0.0
            self._before = contact
        elif missed or (self.shown > 0.0 and total >= (GONE if self.reported else KEPT) * self.shown):
            found, self._before = _CONTACT, None
            self.shown = self.shown or (total if self.reported else 0.0)
        else:
            self.shown = 0.0
            self.reset()
            return ()
        self._follow(found, t_ns)
        return self.reported

    def _follow(self, found: tuple[str, ...], t_ns: int) -> None:
        """Report what differs once it has lasted, until both have agreed for long."""
        if found:
            self._since_ns = self._since_ns if self._images else t_ns
            self._images, self._differed_ns = self._images + 1, t_ns
            if self.reported or (self._images >= PERSIST_IMAGES and t_ns - self._since_ns >= PERSIST_NS):
                self.reported = found
        else:
            self._images = 0
            if t_ns - self._differed_ns >= AGREE_NS:
                self.reported = ()

    def reset(self) -> None:
        """Forget the comparison, because the contact or a stream ended; a contact that the force sensor lost lasts."""
        if self._before is not None or self.shown == 0.0:
            self.reported = ()
        self._before, self._images = None, 0

    def _differences(
        self, contact: Contact, force_std_n: float, total: float, x_sum: float, y_sum: float, inner: int
    ) -> tuple[str, ...]:
        if not math.isfinite(total):
            return ()
        if total <= 0.0:
            return _CONTACT if contact.normal_n > CLEAR * self._least_n else ()
        before = self._before or contact
        found = []
        away_m = math.hypot(x_sum / total - contact.cx_m, y_sum / total - contact.cy_m)
        # since the last image, whose time is not quite this
        moved_m = math.hypot(contact.cx_m - before.cx_m, contact.cy_m - before.cy_m)
        pitches = INNER_PITCHES if inner else OUTER_PITCHES
        std_m = max(contact.cx_std_m, contact.cy_std_m)
        if away_m > pitches * self._pitch_m + STDS * std_m + moved_m:
            found.append("disagreement_centroid")
        if inner and self._gain_error is not None:
            tolerance = -math.expm1(-self._gain_error - FORCE * (inner + 2) ** -0.75)
            least = STDS * force_std_n + abs(contact.normal_n - before.normal_n)
            if abs(total - contact.normal_n) > tolerance * max(total, contact.normal_n) + least:
                found.append("disagreement_force")
        return tuple(found)


@compiled
def _moments(x: Array, y: Array, pressure: Array, sides: Indices) -> tuple[float, float, float, int]:
    """Return Σ p, Σ p x and Σ p y of an image, and its number of inner taxels.

    Args:
        x: Centres of the taxels, shape (n,), m.
        y: Likewise, shape (n,), m.
        pressure: Readings, shape (n,); a taxel is active when positive.
        sides: The four side neighbours of each, shape (n, 4); −1 beyond the border.
    """
    total, x_sum, y_sum, inner = 0.0, 0.0, 0.0, 0
    for i in range(len(pressure)):
        total += pressure[i]
        x_sum += pressure[i] * x[i]
        y_sum += pressure[i] * y[i]
        within = pressure[i] > 0.0
        for side in sides[i]:
            within = within and side >= 0 and pressure[side] > 0.0
        inner += int(within)
    return total, x_sum, y_sum, inner


@compiled
def _contact_at(
    states: Rows, t_ns: int, force_std: float, torque_std: float
) -> tuple[float, float, float, float, float, float, float, float, float, float, bool]:
    """Return the fields of the `Contact` at a time, by the kept reading nearest to it; there must be a reading.

    Without torque, its centroid and spin are NaN. Where it is not valid, only its normal force is known.

    Args:
        states: One row of CONTACT_STATE.
        t_ns: CLOCK_MONOTONIC.
        force_std: Standard deviation of each force component, N.
        torque_std: Standard deviation of each torque component, N·m.
    """
    fx, fy, fz, mx, my, mz = mean_wrench(states, t_ns, t_ns)
    conditions = states[0]["conditions"]
    least_n = conditions["lasts_n"] if states[0]["memory"]["in_contact"] else conditions["begins_n"]
    known = math.isfinite(fx + fy + fz) and (math.isnan(mx) or math.isfinite(mx + my + mz))
    cx, cy, cx_std, cy_std, normal, _, _, spin, ratio, ratio_std = contact_numbers(
        fx, fy, -fz, mx, my, mz, force_std, torque_std
    )
    return cx, cy, cx_std, cy_std, normal, fx, fy, spin, ratio, ratio_std, known and normal >= least_n
