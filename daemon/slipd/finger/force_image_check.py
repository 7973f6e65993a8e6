"""Compare force sensor and pad of one finger, with the force readings of the recent past: both see the same contact."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from slipd.config import Finger as FingerConfig
from slipd.config import Pad
from slipd.finger.force_channel import ForceChannel
from slipd.fusion import Contact
from slipd.fusion.compiled import compiled
from slipd.fusion.contact import contact_numbers
from slipd.fusion.recent_forces import begin_range, mean_wrench
from slipd.fusion.rows import Rows
from slipd.signals.force_image_agreement import STDS, Agreement

if TYPE_CHECKING:
    from slipd.finger.image_channel import ImageChannel

MOVING_STDS = 6.0
"""The normal force moves where its range between two images exceeds this many standard deviations of its noise."""
COMPARE_NS = 10_000_000
"""At most one comparison in this time: a disagreement counts only once it has lasted for longer."""


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
        disagreement: Reasons of a verdict: "disagreement_contact", "disagreement_centroid", "disagreement_force".
    """

    def __init__(self, config: FingerConfig, pad: Pad, force: ForceChannel, image: ImageChannel, state: Rows) -> None:
        self._force, self._image = force, image
        self._state, self._moving_n = state, MOVING_STDS * force.noise.force_std_n
        self._agreement = Agreement(pad.rows, pad.cols, pad.pitch_m, config.min_normal_n, pad.gain_error)
        self._compared_ns = 0
        self.disagreement: tuple[str, ...] = ()

    def take_summary(self, normal_n: float | None, *, free: bool) -> ForceSummary:
        """Return what the force sensor measured since the image before, and begin the next interval.

        Args:
            normal_n: Normal force now, N; None: it is not known.
            free: Nothing touches the pad by it.
        """
        if normal_n is None:
            return NO_SUMMARY
        moving = begin_range(self._state, normal_n) > self._moving_n
        lost = self._agreement.shown > 0.0 and not self._image.reasons
        return ForceSummary(free and not lost, normal_n, moving, not self.disagreement)

    def update_image(self, t_ns: int, *, known: bool) -> None:
        """Compare the newest image with the force at its time.

        What the unknown weight of the finger may add counts fully: `Agreement` allows ``STDS`` standard deviations.

        Args:
            t_ns: When the image was acquired.
            known: The newest force is known.
        """
        image = self._image
        if not (known and image.is_independent):
            self.reset()
            return
        if t_ns - self._compared_ns < COMPARE_NS:
            return
        self._compared_ns = t_ns
        force_std_n, torque_std_nm, unknown_n, unknown_nm = self._force.uncertainty(t_ns)
        contact = Contact(
            *_contact_at(self._state, t_ns, force_std_n + unknown_n / STDS, torque_std_nm + unknown_nm / STDS)
        )
        self._agreement.update(t_ns, contact, force_std_n + unknown_n, image.x, image.y, image.pressure)
        self._follow_agreement()

    def reset(self) -> None:
        """Forget what was compared: the contact or a stream ended."""
        self._agreement.reset()
        self._follow_agreement()

    def _follow_agreement(self) -> None:
        found = self._agreement.reported
        self.disagreement = tuple(f"disagreement_{what}" for what in found) if found else ()


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
