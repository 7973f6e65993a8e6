"""Compare force sensor and pad of one finger, with the force readings of the recent past: both see the same contact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from slipd.config import Finger as FingerConfig
from slipd.config import Pad
from slipd.finger.force_channel import ForceChannel
from slipd.fusion import Contact
from slipd.fusion.contact import contact_of
from slipd.fusion.levels import Uncertainty
from slipd.fusion.rows import PASTS, Rows
from slipd.signals.force_image_agreement import STDS, Agreement

if TYPE_CHECKING:
    from slipd.finger.contact_estimator import ContactEstimator
    from slipd.finger.image_channel import ImageChannel

MOVING_STDS = 6.0
"""The normal force moves where its range between two images exceeds this many standard deviations of its noise."""
COMPARE_NS = 10_000_000
"""At most one comparison in this time: a disagreement counts only once it has lasted for longer."""


class ForceSummary(NamedTuple):
    """Measurements of the finger's force sensor since the image before.

    Attributes:
        no_contact: It reads no contact. False also where it reads nothing: a held load must not be taken for an offset.
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


class ForceHistory:
    """Range of the normal force since the newest image, and wrenches of the last 128 ms at least.

    Args:
        noise_n: Standard deviation of a force component, N.
        state: One row of STATE, whose forces the kernels fill.
    """

    def __init__(self, noise_n: float, state: Rows) -> None:
        self._moving_n = MOVING_STDS * noise_n
        self._state = state

    def take_summary(self, normal_n: float | None, *, free: bool, agrees: bool) -> ForceSummary:
        """Return what the force sensor measured since the image before, and begin the next interval.

        Args:
            normal_n: Normal force now, N; None: it is not known.
            free: Nothing touches the pad by it.
            agrees: Force and images did not contradict each other so far.
        """
        if normal_n is None:
            return NO_SUMMARY
        forces = self._state["forces"]
        moving = bool(forces["high_n"][0] - forces["low_n"][0] > self._moving_n)
        forces["low_n"] = forces["high_n"] = normal_n
        return ForceSummary(free, normal_n, moving, agrees)

    def mean_wrench(self, since_ns: int, until_ns: int) -> tuple[float, ...]:
        """Return the mean wrench of the kept readings between two times, after a first reading.

        If no reading is kept of that interval, this is the wrench of the reading nearest to its end.

        Args:
            since_ns: CLOCK_MONOTONIC; a reading of this time does not count.
            until_ns: Likewise; a reading of this time counts.
        """
        found = []
        for t_ns, *wrench in self._newest_first():
            if t_ns <= since_ns:
                break
            if t_ns <= until_ns:
                found.append(wrench)
        if not found:
            return self.wrench_at(until_ns)
        share = 1.0 / len(found)
        return tuple([share * sum(component) for component in zip(*found, strict=True)])

    def wrench_at(self, t_ns: int) -> tuple[float, ...]:
        """Return the wrench of the kept reading nearest to ``t_ns``, in the pad frame: N and N·m, six numbers."""
        nearest: tuple[float, ...] = ()
        for past in self._newest_first():
            if nearest and abs(past[0] - t_ns) > abs(nearest[0] - t_ns):
                break
            nearest = past
        return nearest[1:]

    def _newest_first(self) -> Iterator[Any]:
        """Yield time and wrench of each kept reading."""
        forces = self._state["forces"]
        count, past = int(forces["count"][0]), forces["past"][0]
        for k in range(count - 1, max(count - PASTS, 0) - 1, -1):
            yield past.item(k % PASTS)


class ForceImageCheck:
    """What force sensor and image of one finger contradict each other about.

    Args:
        config: ``[finger.X]``.
        pad: ``[finger.X.pad]``.
        force: The force sensor.
        image: The pad.
        state: One row of STATE, see `ForceHistory`.

    Attributes:
        history: Force readings of the recent past.
        disagreement: Reasons of a verdict: "disagreement_contact", "disagreement_centroid", "disagreement_force".
    """

    def __init__(self, config: FingerConfig, pad: Pad, force: ForceChannel, image: ImageChannel, state: Rows) -> None:
        self._force, self._image = force, image
        self.history = ForceHistory(force.noise.force_std_n, state)
        self._agreement = Agreement(pad.rows, pad.cols, pad.pitch_m, config.min_normal_n, pad.gain_error)
        self._compared_ns = 0
        self.disagreement: tuple[str, ...] = ()

    def update_image(self, t_ns: int, estimator: ContactEstimator, *, known: bool) -> None:
        """Compare the newest image with the force at its time.

        Args:
            t_ns: When the image was acquired.
            estimator: Knows the least normal force that counts as contact.
            known: The newest force is known.
        """
        image = self._image
        if not (known and image.is_independent):
            self.reset()
            return
        if t_ns - self._compared_ns < COMPARE_NS:
            return
        self._compared_ns = t_ns
        uncertainty = self._force.uncertainty(t_ns)
        contact = _contact(self.history.wrench_at(t_ns), uncertainty, estimator.least_normal_n)
        found = self._agreement.update(
            t_ns, contact, uncertainty.force_std_n + uncertainty.force_n, image.x, image.y, image.pressure
        )
        self.disagreement = tuple(f"disagreement_{what}" for what in found)

    def reset(self) -> None:
        """Forget what was compared: the contact or a stream ended."""
        self.disagreement = ()
        self._agreement.reset()


def _contact(wrench: tuple[float, ...], uncertainty: Uncertainty, least_normal_n: float) -> Contact:
    """Return the contact by the force sensor; without torque its centroid and spin are NaN.

    What the unknown weight of the finger may add counts fully: `Agreement` allows ``STDS`` standard deviations.
    """
    force_std_n = uncertainty.force_std_n + uncertainty.force_n / STDS
    torque_std_nm = uncertainty.torque_std_nm + uncertainty.torque_nm / STDS
    fx, fy, fz, *torque = wrench
    if math.isnan(torque[0]):
        contact = contact_of((fx, fy, fz, 0.0, 0.0, 0.0), least_normal_n, force_std_n, torque_std_nm)
        nan = math.nan
        return contact._replace(cx_m=nan, cy_m=nan, cx_std_m=nan, cy_std_m=nan, spin_nm=nan)
    return contact_of((fx, fy, fz, *torque), least_normal_n, force_std_n, torque_std_nm)
