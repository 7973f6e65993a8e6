"""Estimate the contact of one finger, read by read: contact phase, utilisation, tipping margin, slip, and level.

All readings of one read go through the compiled kernels of `slipd.fusion` at once. What the next read continues from
is kept here: whether the pad is in contact, the last velocity of slip, and what the detection of slip remembers.
"""

from __future__ import annotations

import math
from enum import Enum

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.finger.finger_state import VerdictBatch
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.image_channel import ImageChannel
from slipd.finger.load_distribution import LoadDistribution
from slipd.finger.verdict import UNTARED
from slipd.friction.friction_estimate import STEP_NS, FrictionEstimate
from slipd.friction.friction_state import FrictionState
from slipd.friction.learning import learn
from slipd.fusion.levels import ContactWatch, SlipSettings, Thresholds, Uncertainty
from slipd.fusion.rows import FREE, LATE, NO_CONTACT, PULLED, TOUCHING, UNKNOWN, UNTRUSTED, Rows
from slipd.fusion.streaming import contact_at, find_contacts, solve_readings, spin_utilisation_1n
from slipd.signals.force_image_agreement import CLEAR, STDS

CONTACT_HYSTERESIS = 0.8
"""A contact lasts down to this share of the normal force at which it begins."""
DECISION_GAP = 1e-6
"""Relative gap between the bounds of the utilisation; far below what a threshold or a message resolves."""
SHAPE_ERROR = 0.7
"""Relative standard deviation of λ of a pure spin, times the number of active taxels: measured on simulated contacts of
4 to 40 taxels (`tests/unit/finger/test_shape_error.py`)."""
LARGEST_BIAS_N = 10.0
"""A force sensor may read this much without load before its first tare, N."""


class Learning(Enum):
    """What readings may teach of friction."""

    NOTHING = 0
    """They are not trusted."""
    SLIPS = 1
    """Slips are believed; but what is carried does not raise μ, because the zero of the force is not known."""
    ALL = 2


class ContactEstimator:
    """Estimates the contact of one finger from conditioned force readings and the newest image.

    Args:
        config: ``[finger.X]``.
        levels: ``[levels]``.

    Attributes:
        friction: Coefficients of friction in use.
        in_contact: The newest reading that could be trusted touches.
    """

    def __init__(self, config: FingerConfig, levels: Levels) -> None:
        least_n, slip = config.min_normal_n, config.slip
        half_pitch_m = 0.5 * config.pad.pitch_m if config.pad is not None else math.nan
        thresholds = Thresholds(levels.caution, levels.warning, levels.hysteresis)
        self.friction = FrictionEstimate(config.mu, config.mu_spread, config.most_mu, slip.drop, config.mu_rotation)
        self.in_contact = False
        self._caution = levels.caution
        self._contact_n = (least_n, CONTACT_HYSTERESIS * least_n)
        self._drift_n, self._bias_n = _most_zero_n(config)
        settings = SlipSettings(slip.drop, slip.window_s, slip.hold_s, levels.false_alarms_per_hour)
        self._watch = ContactWatch(thresholds, settings, half_pitch_m, least_n)
        self._twist: tuple[float, float, float] | None = None

    @property
    def least_normal_n(self) -> float:
        """Least normal force that counts as contact now, N."""
        return self._contact_n[self.in_contact]

    def set_friction(self, mu_s: float, mu_d: float | None, by: str, t_ns: int | None) -> None:
        """Use the coefficients that a client states; see `FrictionEstimate.set`."""
        self.friction.set(mu_s, mu_d, by, t_ns)
        if mu_d is not None:
            self._watch.set_drop(self.friction.drop)

    def note_motion(self, until_ns: int, evidence: int) -> None:
        """Report slip until a time; see `ContactWatch.note_motion`."""
        self._watch.note_motion(until_ns * 1e-9, evidence)
        self.friction.note_turn(until_ns * 1e-9)

    def end_contact(self) -> None:
        """Forget the contact: it ended, or is no longer known."""
        self.in_contact, self._twist = False, None
        self._watch.reset()
        self.friction.end_contact()

    def estimate(
        self,
        readings: WrenchBatch,
        uncertainty: Uncertainty,
        image: ImageChannel | None,
        disagreement: tuple[str, ...] = (),
        image_fault: str = "",
        learning: Learning = Learning.NOTHING,
        *,
        image_free: bool = False,
        zero_known: bool = True,
    ) -> VerdictBatch:
        """Estimate the contact at each reading of one read.

        Args:
            readings: The conditioned readings.
            uncertainty: Of the readings, by noise and by the unknown weight of the finger.
            image: The pad; None without an image of the time of the readings.
            disagreement: What force sensor and image contradict each other about.
            image_fault: Reason why no image can be used: "stuck", "not_tared", or "".
            learning: What the readings may teach of friction, where there is no disagreement.
            image_free: The pad shows by itself that nothing presses. It decides where the unknown weight of the finger
                may hide a contact from the force sensor.
            zero_known: The zero of the force is known. Otherwise no reading shows a contact, or the want of one.
        """
        rows, times_ns, friction = readings.rows, readings.times_ns, self.friction
        pulled_n = self._drift_n + STDS * uncertainty.force_std_n + uncertainty.force_n
        find_contacts(
            rows,
            readings.transform,
            self._contact_n,
            self.in_contact,
            uncertainty.force_std_n + uncertainty.force_n,
            uncertainty.torque_std_nm + uncertainty.torque_nm,
            pulled_n if zero_known else pulled_n + self._bias_n,
        )
        if not zero_known:
            _doubt_zero(readings)
        phases = rows["phase"].tolist()
        distribution, count = None, len(phases)
        if image is not None and TOUCHING in phases:
            distribution = image.load_distribution(lambda: contact_at(rows, phases.index(TOUCHING)))
        if distribution is not None:
            distribution.outline.fill_margins(rows)
        ends_at = count if phases.count(TOUCHING) == count else _contact_end(phases, self.in_contact)
        if disagreement:
            self._watch.forget_load()  # a wrong reading, and its end, look like a load that falls
            friction.discard_grasp()
        frictions: list[FrictionState] = []
        begin, end = 0, count
        while begin < count:
            if times_ns[-1] // STEP_NS != friction.step:
                end = friction.begin_step(times_ns, begin)
            frictions += [friction.state] * (end - begin)
            agrees_at = min(max(ends_at, begin), end) if disagreement else begin
            if begin < agrees_at:
                self._judge(rows[begin:agrees_at], phases[begin:agrees_at], distribution, uncertainty, Learning.NOTHING)
            if agrees_at < end:
                self._judge(rows[agrees_at:end], phases[agrees_at:end], distribution, uncertainty, learning)
            begin, end = end, count
        levels = rows["assessment"]["level"].tolist()
        for k, phase in enumerate(phases if disagreement or image_free else ()):
            if disagreement and phase == TOUCHING and k < ends_at:
                levels[k] = UNKNOWN
            elif image_free and phase == FREE:
                levels[k] = NO_CONTACT
        return VerdictBatch(
            readings, phases, distribution, frictions, self._caution, image_fault, disagreement, ends_at, levels
        )

    def _judge(
        self,
        rows: Rows,
        phases: list[int],
        distribution: LoadDistribution | None,
        uncertainty: Uncertainty,
        learning: Learning,
    ) -> None:
        """Solve and assess readings with one friction, learn from them, and keep what the next read continues from."""
        friction = self.friction
        mu, spin_1n, shape_error = friction.state.mu, 0.0, math.nan
        if distribution is not None:
            x, y, loads = distribution.x, distribution.y, distribution.loads.loads
            solved_mu, shape_error = mu or 1.0, SHAPE_ERROR / len(x)  # λ at μ = 1 is the required friction
            scale = 1.0 if friction.rotation.stated is None else friction.state.spin_scale
            if scale != 1.0:
                rows["contact"]["spin_nm"] *= scale
            solve_readings(rows, x, y, loads, solved_mu, self._twist, DECISION_GAP)
            if scale != 1.0:
                rows["contact"]["spin_nm"] /= scale
            if friction.rotation.stated is not None:
                self._carry_spin(rows, phases, distribution)
            if uncertainty.force_n > 0.0:
                spin_1n = spin_utilisation_1n(x, y, loads, solved_mu, uncertainty.torque_nm)
        self._watch.assess(rows, math.nan if mu is None else mu, uncertainty, spin_1n)
        teaches = learning is not Learning.NOTHING and distribution is not None and uncertainty.force_n == 0.0
        learn(rows, friction.learning, shape_error, teaches, learning is Learning.ALL)
        k = len(phases) - 1
        while k >= 0 and phases[k] == UNTRUSTED:
            k -= 1
        if k < 0:
            return
        self.in_contact, self._twist = phases[k] == TOUCHING, None
        if self.in_contact and distribution is not None:
            vx, vy, omega = rows["utilisation"]["twist"][k].tolist()
            self._twist = vx, vy, omega
        if not self.in_contact and friction.rotation.stated is not None:
            friction.forget_turns()

    def _carry_spin(self, rows: Rows, phases: list[int], distribution: LoadDistribution) -> None:
        """Note which friction the spin of each reading requires: if the object turns now, it was that of the limit."""
        for k, phase in enumerate(phases):
            if phase == TOUCHING:
                required = abs(distribution.spin_required(contact_at(rows, k)))
                self.friction.rotation.carry(float(rows["t_s"][k]), required)


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


def _doubt_zero(readings: WrenchBatch) -> None:
    """Mark readings whose zero is not known; a clear pull, and a reading that is too late, stay what they are."""
    for k, phase in enumerate(readings.rows["phase"].tolist()):
        if phase in (FREE, TOUCHING):
            readings.rows["phase"][k] = UNTRUSTED
            readings.untrusted[k] = UNTARED.reasons


def _contact_end(phases: list[int], in_contact: bool) -> int:
    """Return the index of the first reading with which a contact ends; the number of readings where none does."""
    if FREE in phases or LATE in phases or PULLED in phases:
        for k, phase in enumerate(phases):
            if in_contact and phase in (FREE, LATE, PULLED):
                return k
            in_contact = in_contact or phase == TOUCHING
    return len(phases)
