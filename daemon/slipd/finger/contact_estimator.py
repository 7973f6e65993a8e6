"""The verdict on one contact: what force and image together say of it, reading by reading."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.image_channel import LoadDistribution
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

#: A contact that exists is lost only below this share of the least normal force.
CONTACT_HYSTERESIS = 0.8
#: Relative gap of the bounds of utilisation: far below what a threshold, or a message, can tell apart.
DECISION_GAP = 1e-6
#: Of the fall from static to dynamic friction, so much must be seen; and no less than noise may bring.
SEEN_SHARE, LEAST_DROP = 0.5, 0.05
_NOT_USED: Array = np.empty((0, 9))
_NO_MARGINS: Array = np.empty(0)


class ContactEstimator:
    """Judges the readings of one finger.

    Args:
        config: ``[finger.X]``.
        levels: ``[levels]``.

    Attributes:
        mu: Coefficient of static friction; None: not known.
        in_contact: The newest reading that tells of it touches.
    """

    def __init__(self, config: FingerConfig, levels: Levels) -> None:
        least = config.min_normal_n
        half_pitch_m = 0.5 * config.pad.pitch_m if config.pad is not None else math.nan
        thresholds = Thresholds(levels.caution, levels.warning, levels.hysteresis)
        self.mu = config.mu
        self.in_contact = False
        self._drop = config.slip.drop
        self._caution = levels.caution
        self._contact_n = (least, CONTACT_HYSTERESIS * least)
        self._watch = ContactWatch(thresholds, SlipSettings(**config.slip.model_dump()), half_pitch_m, least)
        self._twist: tuple[float, float, float] | None = None

    @property
    def least_normal_n(self) -> float:
        """Normal force down to which there is a contact now, N."""
        return self._contact_n[self.in_contact]

    def set_friction(self, mu_s: float, mu_d: float | None) -> None:
        """Takes the friction of the object that is held.

        Args:
            mu_s: Coefficient of static friction.
            mu_d: Of dynamic friction; None: what the config says of the fall holds.
        """
        self.mu = mu_s
        self._twist = None
        if mu_d is not None:
            self._drop = _drop(mu_s, mu_d)
            self._watch.set_drop(self._drop)

    def is_more_lenient(self, mu_s: float, mu_d: float | None) -> bool:
        """Whether `set_friction` would make a verdict more lenient: by a larger μ, or a larger fall that is a slip."""
        if self.mu is None or mu_s > self.mu:
            return True
        return mu_d is not None and _drop(mu_s, mu_d) > self._drop

    def end_contact(self) -> None:
        """The contact ended, or is not known any more."""
        self.in_contact, self._twist = False, None
        self._watch.reset()

    def estimate(
        self,
        read: WrenchBatch,
        doubt: Doubt,
        shares_of: Callable[[Contact], LoadDistribution | None] | None,
        disagreement: tuple[str, ...],
        image_fault: str,
        pulled_n: float,
    ) -> VerdictBatch:
        """Judges the readings of one read.

        Args:
            read: The readings.
            doubt: What they may hold beside the contact's load.
            shares_of: How the image shares the force of a contact, and None where it cannot; None without a fresh one.
            disagreement: What force sensor and image contradict each other about.
            image_fault: Reason for which no image can be used: "stuck", "not_tared", or "".
            pulled_n: A normal force below minus this is clearly negative, N.
        """
        noise = doubt.force_std_n + doubt.force_n, doubt.torque_std_nm + doubt.torque_nm
        contacts = find_contacts(read.carrier, read.rows, self._contact_n, self.in_contact, *noise, pulled_n)
        touch = [int(touch) for touch in contacts[:, TOUCH].tolist()]
        shares, used, margins_m, turn = None, _NOT_USED, _NO_MARGINS, 0.0
        if shares_of is not None and TOUCHING in touch:
            shares = shares_of(contact_told(contacts[touch.index(TOUCHING)].tolist()))
        if shares is not None:
            margins_m = shares.outline.margins_m(contacts)
        if shares is not None and self.mu is not None:
            x, y, loads = shares.x, shares.y, shares.loads.loads
            used = follow_readings(x, y, loads, self.mu, contacts, self._twist, DECISION_GAP)
            if doubt.force_n > 0.0:
                turn = utilisation_of(x, y, loads, self.mu, (0.0, 0.0), doubt.torque_nm, (0.0, 0.0)).upper
        mu = math.nan if self.mu is None else self.mu
        found = self._watch.follow(contacts, used, margins_m, mu, doubt, turn)
        levels = [int(level) for level in found[:, 0].tolist()]
        ends_at = _contact_end(touch, self.in_contact)
        if disagreement:
            levels = [
                UNKNOWN if now == TOUCHING and at < ends_at else level
                for at, (level, now) in enumerate(zip(levels, touch, strict=True))
            ]
        self._keep(touch, used)
        return VerdictBatch(
            read, touch, contacts, shares, used, margins_m, found, mu, self._caution, image_fault, disagreement,
            ends_at, levels,
        )  # fmt: skip

    def _keep(self, touch: list[int], used: Array) -> None:
        """Remembers what the next read goes on from: the newest reading that says something."""
        at = len(touch) - 1
        while at >= 0 and touch[at] == UNTRUSTED:
            at -= 1
        if at < 0:
            return
        self.in_contact, self._twist = touch[at] == TOUCHING, None
        if self.in_contact and len(used):
            vx, vy, om = used[at, 6:].tolist()
            self._twist = vx, vy, om


def _drop(mu_s: float, mu_d: float) -> float:
    """Share by which the friction ratio falls when a contact of these coefficients slips, as far as it must be seen."""
    return max(SEEN_SHARE * (1.0 - mu_d / mu_s), LEAST_DROP)


def _contact_end(touch: list[int], in_contact: bool) -> int:
    """Place of the first reading with which a contact ends; that behind the last where none does."""
    if FREE in touch or LATE in touch or PULLED in touch:
        for at, now in enumerate(touch):
            if in_contact and now in (FREE, LATE, PULLED):
                return at
            in_contact = in_contact or now == TOUCHING
    return len(touch)
