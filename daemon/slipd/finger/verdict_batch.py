"""Verdicts on the readings of one read, as rows of numbers; states are made of the few that somebody asks for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from slipd.finger.finger_state import FingerState, ForceReading
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.load_distribution import LoadDistribution
from slipd.finger.verdict import (
    NO_MU,
    PAD_FREE,
    PAD_PULLED,
    STREAM_STALE,
    WEIGHT_UNKNOWN,
    Verdict,
    exact_verdict,
    translation_verdict,
)
from slipd.fusion import FREE, LATE, PULLED, UNTRUSTED, Found, contact_told, utilisation_told, wrench_told
from slipd.fusion.slip import UNKNOWN
from slipd.samples import Array
from slipd_client.messages import LEVELS


@dataclass(slots=True, eq=False)
class VerdictBatch:
    """Verdicts on the n readings of one read, in their order; ``batch[k]`` is the `FingerState` after reading k.

    Attributes:
        readings: The conditioned readings.
        phases: Contact phase of each: PULLED, LATE, UNTRUSTED, FREE or TOUCHING.
        contacts: Rows of `find_contacts`, shape (n, 15).
        load_distribution: Shares of the normal force on the taxels, for the readings that touch; None without a usable
            image.
        utilisations: Rows of `follow_readings`, shape (n, 9), or (0, 9) where rotation or μ is unknown.
        margins_m: Tipping margin of each, m, shape (n,), or (0,) where it is unknown.
        found: Rows of `Found`, shape (n, 6).
        mu: Coefficient of static friction; NaN: unknown.
        caution: Utilisation from which on the grip is in danger.
        image_fault: Reason why no image can be used: "stuck", "not_tared", or "".
        disagreement: What force sensor and image contradict each other about, until the contact ends.
        ends_at: Index of the first reading with which a contact ended; n where none did.
        levels: Level of each, as ``level_code``.
    """

    readings: WrenchBatch
    phases: list[int]
    contacts: Array
    load_distribution: LoadDistribution | None
    utilisations: Array
    margins_m: Array
    found: Array
    mu: float
    caution: float
    image_fault: str
    disagreement: tuple[str, ...]
    ends_at: int
    levels: list[int]
    _states: dict[int, FingerState] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.levels)

    def __iter__(self) -> Iterator[FingerState]:
        return (self[k] for k in range(len(self)))

    def __getitem__(self, index: int) -> FingerState:
        k = range(len(self.levels))[index]
        state = self._states.get(k)
        if state is None:
            state = self._states[k] = self._make_state(k)
        return state

    def force_reading(self, k: int) -> ForceReading:
        """Return the force of reading k, without the work of a whole state."""
        readings, row = self.readings, self.contacts[k].tolist()
        age_s = (readings.received_ns - readings.times_ns[k]) * 1e-9
        if self.phases[k] == LATE:
            return ForceReading(None, (), age_s)
        known = self.phases[k] != UNTRUSTED or not math.isnan(row[4])
        return ForceReading(wrench_told(row) if known else None, readings.statuses[k], age_s)

    def _make_state(self, k: int) -> FingerState:
        phase, t_ns = self.phases[k], self.readings.times_ns[k]
        wrench, status, age_s = self.force_reading(k)
        if phase == LATE:
            return FingerState(t_ns, STREAM_STALE, age_s=age_s)
        if phase == UNTRUSTED:
            verdict = Verdict("unknown", self.readings.untrusted[k])
            return FingerState(t_ns, verdict, wrench, status=status, age_s=age_s)
        if phase == PULLED:
            return FingerState(t_ns, PAD_PULLED, wrench, status=status, age_s=age_s)
        contact = contact_told(self.contacts[k].tolist())
        if phase == FREE:
            verdict = WEIGHT_UNKNOWN if self.levels[k] == UNKNOWN else PAD_FREE
            return FingerState(t_ns, verdict, wrench, contact, status=status, age_s=age_s)
        utilisation, margin_m, model = None, math.nan, "translation"
        if len(self.margins_m):
            margin_m = float(self.margins_m[k])
        if self._is_exact(k):
            model, utilisation = "exact", utilisation_told(self.utilisations[k].tolist())
        elif math.isnan(self.mu):
            model = "none"
        return FingerState(
            t_ns, self._verdict(k), wrench, contact, self.load_distribution, utilisation, margin_m, model, status, age_s
        )

    def _is_exact(self, k: int) -> bool:
        """Return whether the utilisation of reading k takes the spin into account."""
        return len(self.utilisations) > 0 and not math.isnan(self.contacts[k, 7])

    def _verdict(self, k: int) -> Verdict:
        """Return the verdict on a reading that touches."""
        if self.disagreement and k < self.ends_at:
            return Verdict("unknown", ("disagreement", *self.disagreement))
        verdict = self._contact_verdict(k)
        if self.load_distribution is None and self.image_fault:
            return Verdict(verdict.level, (self.image_fault, *verdict.reasons))
        return verdict

    def _contact_verdict(self, k: int) -> Verdict:
        """Return the verdict on a contact of which force sensor and image do not disagree."""
        if math.isnan(self.mu):
            return NO_MU
        found, level = Found(*self.found[k].tolist()), LEVELS[self.levels[k]]
        if not self._is_exact(k):
            return translation_verdict(found, level)
        return exact_verdict(
            found,
            level,
            utilisation=float(self.utilisations[k, 1]),
            upper=float(self.utilisations[k, 3]),
            translation=float(self.contacts[k, 8]) / self.mu,
            caution=self.caution,
        )
