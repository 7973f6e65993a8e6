"""Estimate the contact of one finger, read by read: contact phase, utilisation, tipping margin, slip, and level.

All readings of one read go through the compiled kernels of `slipd.fusion` at once. What the next read continues from
is kept here: whether the pad is in contact, the last velocity of slip, and the windows of the slip decision.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.friction import Friction
from slipd.finger.load_distribution import LoadDistribution
from slipd.finger.verdict_batch import VerdictBatch
from slipd.fusion import Contact
from slipd.fusion.levels import ContactWatch, SlipSettings, Thresholds, Uncertainty
from slipd.fusion.rows import FREE, LATE, PULLED, TOUCHING, UNKNOWN, UNTRUSTED, Rows
from slipd.fusion.streaming import contact_at, find_contacts, solve_readings, spin_utilisation_1n

CONTACT_HYSTERESIS = 0.8
"""A contact lasts down to this share of the normal force at which it begins."""
DECISION_GAP = 1e-6
"""Relative gap between the bounds of the utilisation; far below what a threshold or a message resolves."""


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
        least_n = config.min_normal_n
        half_pitch_m = 0.5 * config.pad.pitch_m if config.pad is not None else math.nan
        thresholds = Thresholds(levels.caution, levels.warning, levels.hysteresis)
        self.friction = Friction(config.mu, config.slip.drop)
        self.in_contact = False
        self._caution = levels.caution
        self._contact_n = (least_n, CONTACT_HYSTERESIS * least_n)
        self._watch = ContactWatch(thresholds, SlipSettings(**config.slip.model_dump()), half_pitch_m, least_n)
        self._twist: tuple[float, float, float] | None = None

    @property
    def least_normal_n(self) -> float:
        """Least normal force that counts as contact now, N."""
        return self._contact_n[self.in_contact]

    def set_friction(self, mu_s: float, mu_d: float | None, by: str, t_ns: int | None) -> None:
        """Use the coefficients that a client states; see `Friction.set`."""
        self.friction.set(mu_s, mu_d, by, t_ns)
        self._twist = None
        if mu_d is not None:
            self._watch.set_drop(self.friction.drop)

    def note_motion(self, until_ns: int, evidence: int) -> None:
        """Report slip until a time; see `ContactWatch.note_motion`."""
        self._watch.note_motion(until_ns * 1e-9, evidence)

    def end_contact(self) -> None:
        """Forget the contact: it ended, or is no longer known."""
        self.in_contact, self._twist = False, None
        self._watch.reset()

    def estimate(
        self,
        readings: WrenchBatch,
        uncertainty: Uncertainty,
        distribution_of: Callable[[Contact], LoadDistribution | None] | None,
        disagreement: tuple[str, ...],
        image_fault: str,
        pulled_n: float,
    ) -> VerdictBatch:
        """Estimate the contact at each reading of one read.

        Args:
            readings: The conditioned readings.
            uncertainty: Of the readings, by noise and by the unknown weight of the finger.
            distribution_of: Returns the shares of a contact's normal force on the taxels, None where the image cannot
                give them. None without a fresh image.
            disagreement: What force sensor and image contradict each other about.
            image_fault: Reason why no image can be used: "stuck", "not_tared", or "".
            pulled_n: The normal force is clearly negative below minus this, N.
        """
        rows = readings.rows
        find_contacts(
            rows,
            readings.transform,
            self._contact_n,
            self.in_contact,
            uncertainty.force_std_n + uncertainty.force_n,
            uncertainty.torque_std_nm + uncertainty.torque_nm,
            pulled_n,
        )
        phases = rows["phase"].tolist()
        mu, distribution, solved, spin_1n = self.friction.mu, None, False, 0.0
        if distribution_of is not None and TOUCHING in phases:
            distribution = distribution_of(contact_at(rows, phases.index(TOUCHING)))
        if distribution is not None:
            distribution.outline.fill_margins(rows)
        if distribution is not None and mu is not None:
            x, y, loads, solved = distribution.x, distribution.y, distribution.loads.loads, True
            solve_readings(rows, x, y, loads, mu, self._twist, DECISION_GAP)
            if uncertainty.force_n > 0.0:
                spin_1n = spin_utilisation_1n(x, y, loads, mu, uncertainty.torque_nm)
        known_mu = math.nan if mu is None else mu
        self._watch.assess(rows, known_mu, uncertainty, spin_1n)
        levels = rows["assessment"]["level"].tolist()
        ends_at = _contact_end(phases, self.in_contact)
        if disagreement:
            levels = [
                UNKNOWN if phase == TOUCHING and k < ends_at else level
                for k, (level, phase) in enumerate(zip(levels, phases, strict=True))
            ]
        self._remember(phases, rows, solved=solved)
        return VerdictBatch(
            readings, phases, distribution, known_mu, self._caution, image_fault, disagreement, ends_at, levels
        )

    def _remember(self, phases: list[int], rows: Rows, *, solved: bool) -> None:
        """Keep contact and slip velocity of the newest reading that could be trusted, for the next read."""
        k = len(phases) - 1
        while k >= 0 and phases[k] == UNTRUSTED:
            k -= 1
        if k < 0:
            return
        self.in_contact, self._twist = phases[k] == TOUCHING, None
        if self.in_contact and solved:
            vx, vy, omega = rows["utilisation"]["twist"][k].tolist()
            self._twist = vx, vy, omega


def _contact_end(phases: list[int], in_contact: bool) -> int:
    """Return the index of the first reading with which a contact ends; the number of readings where none does."""
    if FREE in phases or LATE in phases or PULLED in phases:
        for k, phase in enumerate(phases):
            if in_contact and phase in (FREE, LATE, PULLED):
                return k
            in_contact = in_contact or phase == TOUCHING
    return len(phases)
