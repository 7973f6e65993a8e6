"""Estimate the contact of one finger, read by read: contact phase, utilisation, tipping margin, slip, and level.

All readings of one read go through the compiled kernels of `slipd.fusion` at once. What the next read continues from
is kept in one row, `ContactState.row`; its conditions show why a verdict came out as it did.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.finger.finger_state import LoadDistribution, VerdictBatch
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.force_image_check import CLEAR, STDS
from slipd.finger.image_channel import ImageChannel
from slipd.friction.friction_estimate import FrictionEstimate
from slipd.friction.friction_state import FrictionState
from slipd.fusion.contact_state import ContactState, WrenchUncertainty
from slipd.fusion.rows import FREE, NO_CONTACT, TOUCHING, UNKNOWN, Rows
from slipd.fusion.streaming import contact_at, find_contacts, judge_readings

SHAPE_ERROR = 0.7
"""Relative standard deviation of λ of a pure spin, times the number of active taxels: measured on simulated contacts of
4 to 40 taxels (`tests/unit/finger/test_shape_error.py`)."""
LARGEST_BIAS_N = 10.0
"""A force sensor may read this much without load before its first tare, N."""
_NO_TAXELS = (*(np.empty(0),) * 5, math.nan)


class ContactEstimator:
    """Estimates the contact of one finger from conditioned force readings and the newest image.

    Args:
        config: ``[finger.X]``.
        levels: ``[levels]``.

    Attributes:
        friction: Coefficients of friction in use.
        contact: Conditions in force, and the memory of the kernels.
        certain: The readings are off by their noise alone, not by the unknown weight of the finger.
    """

    def __init__(self, config: FingerConfig, levels: Levels) -> None:
        slip = config.slip
        half_pitch_m = 0.5 * config.pad.pitch_m if config.pad is not None else math.nan
        self.friction = FrictionEstimate(config.mu, config.mu_spread, config.most_mu, slip.drop, config.mu_rotation)
        self.contact = ContactState(levels, slip, half_pitch_m, config.min_normal_n)
        self._caution = levels.caution
        self._drift_n, self._bias_n = _most_zero_n(config)
        self._friction_in_force: FrictionState | None = None
        self._distribution: LoadDistribution | None = None
        self._arrays = _NO_TAXELS
        self.certain = True

    def note_motion(self, until_ns: int, evidence: int) -> None:
        """Report slip until a time; see `ContactState.note_motion`."""
        self.contact.note_motion(until_ns * 1e-9, evidence)
        self.friction.note_turn(until_ns * 1e-9)

    def end_contact(self) -> None:
        """Forget the contact: it ended, or is no longer known."""
        self.contact.reset()
        self.friction.end_contact()

    def estimate(
        self,
        readings: WrenchBatch,
        image: ImageChannel | None,
        oldest_ns: int,
        disagreement: tuple[str, ...],
        image_fault: str,
        *,
        teaches: bool,
        image_free: bool,
    ) -> VerdictBatch:
        """Estimate the contact at each reading of one read.

        Args:
            readings: The conditioned readings.
            image: The pad; None without an image of the time of the readings.
            oldest_ns: Readings from before this time are too old.
            disagreement: What force sensor and image contradict each other about.
            image_fault: Reason why no image can be used: "stuck", "not_tared", or "".
            teaches: The readings may teach friction, where there is no disagreement.
            image_free: The pad shows by itself that nothing presses. It decides where the unknown weight of the finger
                may hide a contact from the force sensor.
        """
        rows, times_ns, friction, contact = readings.rows, readings.times_ns, self.friction, self.contact
        ends_at, phases = find_contacts(rows, contact.row, oldest_ns, readings.moved)
        distribution, count = None, len(times_ns)
        if image is not None and phases & 1 << TOUCHING:
            distribution = image.load_distribution(rows)
        if disagreement:
            contact.forget_load()  # a wrong reading, and its end, look like a load that falls
            friction.discard_grasp()
        frictions: list[FrictionState] = []
        begin = 0
        while begin < count:
            end = friction.begin_step(times_ns, begin)
            frictions += [friction.state] * (end - begin)
            part = rows if end - begin == count else rows[begin:end]
            self._judge(part, distribution, ends_at - begin if disagreement else 0, teaches=teaches)
            begin = end
        levels = rows["assessment"]["level"].tolist()
        for k, phase in enumerate(rows["phase"].tolist() if disagreement or image_free else ()):
            if disagreement and phase in (TOUCHING, FREE) and k < ends_at:
                levels[k] = UNKNOWN
            elif image_free and phase == FREE:
                levels[k] = NO_CONTACT
        return VerdictBatch(
            readings, phases, distribution, frictions, self._caution, image_fault, disagreement, ends_at, levels
        )

    def _judge(self, rows: Rows, distribution: LoadDistribution | None, agrees_at: int, *, teaches: bool) -> None:
        """Solve and assess readings with one friction, and learn from those of index ``agrees_at`` or more."""
        friction, contact = self.friction, self.contact
        if friction.state is not self._friction_in_force:
            self._friction_in_force = friction.state
            contact.set_friction(
                math.nan if friction.state.mu is None else friction.state.mu, friction.state.spin_scale
            )
        if distribution is not self._distribution:
            self._distribution, self._arrays = distribution, _NO_TAXELS
            if distribution is not None:
                outline, shape_error = distribution.outline, SHAPE_ERROR / len(distribution.x)
                self._arrays = (
                    distribution.x,
                    distribution.y,
                    distribution.shares,
                    outline.x,
                    outline.y,
                    shape_error,
                )
        teaches_from = agrees_at if teaches and self.certain and distribution is not None else len(rows)
        judge_readings(rows, contact.row, friction.learning, *self._arrays, teaches_from)
        if friction.rotation.stated is not None:
            self._learn_rotation(rows, distribution)

    def _learn_rotation(self, rows: Rows, distribution: LoadDistribution | None) -> None:
        """Note which friction the spin of each reading requires: if the object turns now, it was that of the limit."""
        for k, phase in enumerate(rows["phase"].tolist()):
            if phase == TOUCHING and distribution is not None:
                required = abs(distribution.spin_required(contact_at(rows, k)))
                self.friction.rotation.carry(float(rows["t_s"][k]), required)
        if not self.contact.row["memory"]["in_contact"][0]:
            self.friction.forget_turns()

    def set_uncertainty(self, uncertainty: WrenchUncertainty, *, zero_known: bool) -> None:
        """Put the uncertainty of the readings in force, and the negative normal force that it does not explain.

        Args:
            uncertainty: By noise and by the unknown weight of the finger.
            zero_known: Whether the zero of the force is known. If not, readings show neither contact nor its absence.
        """
        self.certain = uncertainty.unknown_n == 0.0
        self.contact.set_uncertainty(uncertainty)
        pulled_n = self._drift_n + STDS * uncertainty.force_std_n + uncertainty.unknown_n
        conditions = self.contact.row["conditions"]
        conditions["zero_known"] = zero_known
        conditions["pulled_n"] = pulled_n if zero_known else pulled_n + self._bias_n


def _most_zero_n(config: FingerConfig) -> tuple[float, float]:
    """Return how negative a normal force without load may be by drift, and in addition by bias before a tare, N.

    The zero of a force sensor may drift by the least normal force of a contact plus the drift that is compensated, that
    of a pad by twice that force plus the threshold of each taxel.
    """
    wrench, pad = config.wrench, config.pad
    if wrench is not None:
        return config.min_normal_n + wrench.drift_limit_n, LARGEST_BIAS_N
    taxels_n = 0.0 if pad is None else pad.rows * pad.cols * pad.threshold
    return CLEAR * config.min_normal_n + taxels_n, 0.0
