"""What is known of a finger after a reading, and after each reading of one read."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from slipd.finger.force_channel import WrenchBatch
from slipd.finger.image_channel import LoadDistribution
from slipd.finger.verdict import Verdict, danger_reasons
from slipd.fusion import (
    FREE,
    LATE,
    PULLED,
    UNTRUSTED,
    Contact,
    Found,
    Loads,
    Utilisation,
    contact_told,
    utilisation_told,
    wrench_told,
)
from slipd.fusion.slip import STABLE, UNKNOWN, WARNING
from slipd.samples import Array
from slipd_client.messages import LEVELS

HOLDS = Verdict("stable", ())
NOTHING = Verdict("no_contact", ())
LOST = Verdict("unknown", ("stale",))
#: The finger's own weight may be a contact, or hide one.
HIDDEN = Verdict("unknown", ("weight_unknown",))
NO_MU = Verdict("unknown", ("no_mu",))
#: The normal force is clearly negative: the sensor or its config is wrong.
NEGATIVE = Verdict("unknown", ("pulled",))
#: Without an image translation alone can prove a grip unsafe, and never safe.
UNOBSERVED, UNSAFE = Verdict("unknown", ("rotation_unobserved",)), Verdict("warning", ("translation",))


class ForceReading(NamedTuple):
    """What a reading says of the force alone.

    Attributes:
        wrench: Force on the finger in the pad frame, N, and torque about the pad's origin, N·m: six numbers, NaN where
            unknown; None where nothing is known.
        status: Conditions that the device reported with it.
        age_s: Its age when it was received, s; None before the first.
    """

    wrench: tuple[float, ...] | None
    status: tuple[str, ...]
    age_s: float | None


@dataclass(slots=True)
class FingerState:
    """What is known of a finger after its newest force reading; None or NaN is unknown.

    Attributes:
        t_ns: When the reading was acquired, CLOCK_MONOTONIC.
        verdict: Level and reasons.
        wrench: Force on the finger in the pad frame, N, and torque about the pad's origin, N·m: six numbers.
        contact: What the force sensor alone sees; not valid without contact.
        load_distribution: How the image shares the normal force among its taxels.
        utilisation: λ of the load, with its bounds.
        tipping_margin_m: Signed distance of the centroid to the outline of the image, m.
        model: "none", "translation" or "exact": the most that was needed.
        status: Conditions that the device reported with the reading.
        age_s: Age of the newest reading when this was found, s; None before the first.
    """

    t_ns: int
    verdict: Verdict
    wrench: tuple[float, ...] | None = None
    contact: Contact | None = None
    load_distribution: LoadDistribution | None = None
    utilisation: Utilisation | None = None
    tipping_margin_m: float = math.nan
    model: str = "none"
    status: tuple[str, ...] = ()
    age_s: float | None = None

    @property
    def force_reading(self) -> ForceReading:
        """What the reading says of the force alone."""
        return ForceReading(self.wrench, self.status, self.age_s)

    @property
    def loads(self) -> Loads | None:
        """Normal forces on the active taxels, N."""
        if self.load_distribution is None or self.contact is None:
            return None
        shares = self.load_distribution.loads
        return Loads(shares.loads * self.contact.normal_n, shares.centroid_residual_m, shares.status)


@dataclass(slots=True, eq=False)
class VerdictBatch:
    """The verdicts on the readings of one read; a `FingerState` is made of those that somebody asks for.

    Attributes:
        read: The readings.
        touch: What each is to the contact.
        contacts: As from `find_contacts`, shape (n, 15).
        load_distribution: How the image shares the force of those that touch.
        used: Numbers of the `Utilisation` of each, shape (n, 9), or (0, 9).
        margins_m: Tipping margin of each, m, shape (n,), or (0,).
        found: Numbers of the `Found` of each, shape (n, 6).
        mu: Coefficient of static friction; NaN: not known.
        caution: Utilisation that counts as danger.
        image_fault: Reason for which no image can be used: "stuck", "not_tared", or "".
        disagreement: What force sensor and image contradict each other about, until the contact ends.
        ends_at: Place of the first reading with which a contact ended; that of the last and one where none did.
        levels: ``level_code`` of each.
    """

    read: WrenchBatch
    touch: list[int]
    contacts: Array
    load_distribution: LoadDistribution | None
    used: Array
    margins_m: Array
    found: Array
    mu: float
    caution: float
    image_fault: str
    disagreement: tuple[str, ...]
    ends_at: int
    levels: list[int]
    _made: dict[int, FingerState] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.levels)

    def __iter__(self) -> Iterator[FingerState]:
        return (self[at] for at in range(len(self)))

    def __getitem__(self, at: int) -> FingerState:
        at = range(len(self.levels))[at]
        state = self._made.get(at)
        if state is None:
            state = self._made[at] = self._make(at)
        return state

    def force_reading(self, at: int) -> ForceReading:
        """What one reading says of the force alone."""
        read, row = self.read, self.contacts[at].tolist()
        age_s = (read.received_ns - read.times_ns[at]) * 1e-9
        if self.touch[at] == LATE:
            return ForceReading(None, (), age_s)
        known = self.touch[at] != UNTRUSTED or not math.isnan(row[4])
        return ForceReading(wrench_told(row) if known else None, read.statuses[at], age_s)

    def _make(self, at: int) -> FingerState:
        touch, t_ns = self.touch[at], self.read.times_ns[at]
        wrench, status, age_s = self.force_reading(at)
        if touch == LATE:
            return FingerState(t_ns, LOST, age_s=age_s)
        if touch == UNTRUSTED:
            return FingerState(t_ns, Verdict("unknown", self.read.untrusted[at]), wrench, status=status, age_s=age_s)
        if touch == PULLED:
            return FingerState(t_ns, NEGATIVE, wrench, status=status, age_s=age_s)
        contact = contact_told(self.contacts[at].tolist())
        if touch == FREE:
            verdict = HIDDEN if self.levels[at] == UNKNOWN else NOTHING
            return FingerState(t_ns, verdict, wrench, contact, status=status, age_s=age_s)
        verdict, used, margin_m, model = self._verdict(at), None, math.nan, "translation"
        if len(self.margins_m):
            margin_m = float(self.margins_m[at])
        if self._exact(at):
            model, used = "exact", utilisation_told(self.used[at].tolist())
        elif math.isnan(self.mu):
            model = "none"
        return FingerState(t_ns, verdict, wrench, contact, self.load_distribution, used, margin_m, model, status, age_s)

    def _exact(self, at: int) -> bool:
        return len(self.used) > 0 and not math.isnan(self.contacts[at, 7])

    def _verdict(self, at: int) -> Verdict:
        """Of a reading that touches."""
        if self.disagreement and at < self.ends_at:
            return Verdict("unknown", ("disagreement", *self.disagreement))
        verdict = self._of_contact(at)
        if self.load_distribution is None and self.image_fault:
            return Verdict(verdict.level, (self.image_fault, *verdict.reasons))
        return verdict

    def _of_contact(self, at: int) -> Verdict:
        if math.isnan(self.mu):
            return NO_MU
        found, level = Found(*self.found[at].tolist()), LEVELS[self.levels[at]]
        if not self._exact(at):
            if not found.slips:
                return UNOBSERVED if found.step < WARNING else UNSAFE
            return Verdict(level, ("slip_detected", *(UNOBSERVED if found.step < WARNING else UNSAFE).reasons))
        if found.step == found.tipping == STABLE and not found.slips:
            return HOLDS
        translation = float(self.contacts[at, 8]) / self.mu
        value, upper = float(self.used[at, 1]), float(self.used[at, 3])
        reasons = danger_reasons(value, translation, self.caution) if found.step > STABLE else ()
        if found.step > STABLE and upper < self.caution and not found.weighed and found.upper > upper:
            reasons = (*reasons, "weight_unknown")
        if found.tipping > STABLE:
            reasons = (*reasons, "tipping", "weight_unknown") if found.weighed else (*reasons, "tipping")
        return Verdict(level, ("slip_detected", *reasons) if found.slips else reasons)
