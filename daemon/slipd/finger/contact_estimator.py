"""Estimate the contact of one finger, read by read: contact phase, utilisation, tipping margin, slip, and level.

All readings of one read go through the compiled kernels of `slipd.fusion` at once. What the next read continues from
is kept here: whether the pad is in contact, the last velocity of slip, and the windows of the slip decision.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.friction import Friction
from slipd.finger.load_distribution import LoadDistribution
from slipd.finger.verdict_batch import VerdictBatch
from slipd.fusion import (
    FREE,
    LATE,
    PULLED,
    TOUCH,
    TOUCHING,
    UNTRUSTED,
    Contact,
    ContactWatch,
    Doubt,
    SlipSettings,
    Thresholds,
    contact_told,
    find_contacts,
    follow_readings,
    utilisation_of,
)
from slipd.fusion.slip import UNKNOWN
from slipd.samples import Array

CONTACT_HYSTERESIS = 0.8
"""A contact lasts down to this share of the normal force at which it begins."""
DECISION_GAP = 1e-6
"""Relative gap between the bounds of the utilisation; far below what a threshold or a message resolves."""
_NO_UTILISATIONS: Array = np.empty((0, 9))
_NO_MARGINS: Array = np.empty(0)


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

    def end_contact(self) -> None:
        """Forget the contact: it ended, or is no longer known."""
        self.in_contact, self._twist = False, None
        self._watch.reset()

    def estimate(
        self,
        readings: WrenchBatch,
        doubt: Doubt,
        distribution_of: Callable[[Contact], LoadDistribution | None] | None,
        disagreement: tuple[str, ...],
        image_fault: str,
        pulled_n: float,
    ) -> VerdictBatch:
        """Estimate the contact at each reading of one read.

        Args:
            readings: The conditioned readings.
            doubt: Their uncertainty, by noise and by the unknown weight of the finger.
            distribution_of: Returns the shares of a contact's normal force on the taxels, None where the image cannot
                give them. None without a fresh image.
            disagreement: What force sensor and image contradict each other about.
            image_fault: Reason why no image can be used: "stuck", "not_tared", or "".
            pulled_n: The normal force is clearly negative below minus this, N.
        """
        noise = doubt.force_std_n + doubt.force_n, doubt.torque_std_nm + doubt.torque_nm
        contacts = find_contacts(readings.carrier, readings.rows, self._contact_n, self.in_contact, *noise, pulled_n)
        phases = [int(phase) for phase in contacts[:, TOUCH].tolist()]
        mu = self.friction.mu
        distribution, utilisations, margins_m, turn = None, _NO_UTILISATIONS, _NO_MARGINS, 0.0
        if distribution_of is not None and TOUCHING in phases:
            distribution = distribution_of(contact_told(contacts[phases.index(TOUCHING)].tolist()))
        if distribution is not None:
            margins_m = distribution.outline.margins_m(contacts)
        if distribution is not None and mu is not None:
            x, y, loads = distribution.x, distribution.y, distribution.loads.loads
            utilisations = follow_readings(x, y, loads, mu, contacts, self._twist, DECISION_GAP)
            if doubt.force_n > 0.0:
                turn = utilisation_of(x, y, loads, mu, (0.0, 0.0), doubt.torque_nm, (0.0, 0.0)).upper
        known_mu = math.nan if mu is None else mu
        found = self._watch.follow(contacts, utilisations, margins_m, known_mu, doubt, turn)
        levels = [int(level) for level in found[:, 0].tolist()]
        ends_at = _contact_end(phases, self.in_contact)
        if disagreement:
            levels = [
                UNKNOWN if phase == TOUCHING and k < ends_at else level
                for k, (level, phase) in enumerate(zip(levels, phases, strict=True))
            ]
        self._remember(phases, utilisations)
        return VerdictBatch(
            readings, phases, contacts, distribution, utilisations, margins_m, found, known_mu, self._caution,
            image_fault, disagreement, ends_at, levels,
        )  # fmt: skip

    def _remember(self, phases: list[int], utilisations: Array) -> None:
        """Keep contact and slip velocity of the newest reading that could be trusted, for the next read."""
        k = len(phases) - 1
        while k >= 0 and phases[k] == UNTRUSTED:
            k -= 1
        if k < 0:
            return
        self.in_contact, self._twist = phases[k] == TOUCHING, None
        if self.in_contact and len(utilisations):
            vx, vy, om = utilisations[k, 6:].tolist()
            self._twist = vx, vy, om


def _contact_end(phases: list[int], in_contact: bool) -> int:
    """Return the index of the first reading with which a contact ends; the number of readings where none does."""
    if FREE in phases or LATE in phases or PULLED in phases:
        for k, phase in enumerate(phases):
            if in_contact and phase in (FREE, LATE, PULLED):
                return k
            in_contact = in_contact or phase == TOUCHING
    return len(phases)
