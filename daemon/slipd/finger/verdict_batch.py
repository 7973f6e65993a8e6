"""Verdicts on the readings of one read, as rows; a state is made only for the readings that need one."""

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
    SLIPS_WITHOUT_MU,
    STREAM_STALE,
    WEIGHT_UNKNOWN,
    Verdict,
    exact_verdict,
    translation_verdict,
)
from slipd.friction.friction_state import FrictionState
from slipd.fusion import Utilisation
from slipd.fusion.rows import FREE, LATE, PULLED, TOUCHING, UNKNOWN, UNTRUSTED
from slipd.fusion.streaming import Reading, contact_at, reading_at, wrench_at
from slipd_client.messages import LEVELS


@dataclass(slots=True, eq=False)
class VerdictBatch:
    """Verdicts on the n readings of one read, in their order; ``batch[k]`` is the `FingerState` after reading k.

    Attributes:
        readings: The conditioned readings, with all that was found in their rows.
        phases: Contact phase of each: PULLED, LATE, UNTRUSTED, FREE or TOUCHING.
        load_distribution: Shares of the normal force on the taxels, for the readings that touch; None without a usable
            image.
        frictions: What was known of the friction at each.
        caution: Utilisation from which on the grip is in danger.
        image_fault: Reason why no image can be used: "stuck", "not_tared", or "".
        disagreement: What force sensor and image contradict each other about, until the contact ends.
        ends_at: Index of the first reading with which a contact ended; n where none did.
        levels: Level of each, as ``level_code``.
    """

    readings: WrenchBatch
    phases: list[int]
    load_distribution: LoadDistribution | None
    frictions: list[FrictionState]
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

    @property
    def level(self) -> str:
        """Level after the newest reading; like the next two, without the work of a whole state."""
        return LEVELS[self.levels[-1]]

    @property
    def is_stale(self) -> bool:
        """The newest reading is too old."""
        return self.phases[-1] == LATE

    @property
    def normal_n(self) -> float | None:
        """Normal force of the newest reading, N; None where it is not known, or clearly negative."""
        if self.phases[-1] not in (FREE, TOUCHING):
            return None
        return float(self.readings.rows["contact"]["normal_n"][-1])

    def force_reading(self, k: int) -> ForceReading:
        """Return the force of reading k, without the work of a whole state."""
        readings, phase = self.readings, self.phases[k]
        age_s = (readings.received_ns - readings.times_ns[k]) * 1e-9
        if phase == LATE:
            return ForceReading(None, (), age_s)
        wrench = wrench_at(readings.rows, k)
        known = phase != UNTRUSTED or not math.isnan(wrench[2])
        return ForceReading(wrench if known else None, readings.statuses[k], age_s)

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
        if phase == FREE:
            verdict = WEIGHT_UNKNOWN if self.levels[k] == UNKNOWN else PAD_FREE
            contact = contact_at(self.readings.rows, k)
            return FingerState(t_ns, verdict, wrench, contact, status=status, age_s=age_s)
        reading, friction = reading_at(self.readings.rows, k), self.frictions[k]
        solved = None if math.isnan(reading.contact.spin_nm) else reading.utilisation
        verdict = self._verdict(k, reading, solved)
        if friction.mu is None:
            model = "none"
            solved = None if solved is None else solved._replace(value=math.nan, lower=math.nan, upper=math.nan)
        else:
            model = "translation" if solved is None else "exact"
        return FingerState(
            t_ns,
            verdict,
            wrench,
            reading.contact,
            self.load_distribution,
            solved,
            reading.tipping_margin_m,
            reading.assessment,
            model,
            status,
            age_s,
            friction,
        )

    def _verdict(self, k: int, reading: Reading, utilisation: Utilisation | None) -> Verdict:
        """Return the verdict on reading k, which touches; ``utilisation`` is None where it leaves out the spin."""
        if self.disagreement and k < self.ends_at:
            return Verdict("unknown", ("disagreement", *self.disagreement))
        verdict = self._contact_verdict(LEVELS[self.levels[k]], reading, utilisation, self.frictions[k].mu)
        if self.load_distribution is None and self.image_fault:
            return Verdict(verdict.level, (self.image_fault, *verdict.reasons))
        return verdict

    def _contact_verdict(
        self, level: str, reading: Reading, utilisation: Utilisation | None, mu: float | None
    ) -> Verdict:
        """Return the verdict on a contact of which force sensor and image do not disagree."""
        if mu is None:
            return SLIPS_WITHOUT_MU if reading.assessment.slips else NO_MU
        if utilisation is None:
            return translation_verdict(reading.assessment, level)
        return exact_verdict(
            reading.assessment,
            level,
            utilisation=utilisation.value,
            upper=utilisation.upper,
            translation=reading.contact.friction_ratio / mu,
            caution=self.caution,
        )
