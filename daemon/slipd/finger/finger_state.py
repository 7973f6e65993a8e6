"""What is known of one finger after each force reading: the verdicts of one read, as rows and as states.

A state is made only for the readings that need one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.finger.force_channel import WrenchBatch
from slipd.finger.verdict import (
    GRIP_HOLDS,
    PAD_FREE,
    PAD_PULLED,
    STREAM_STALE,
    UNTARED,
    WEIGHT_UNKNOWN,
    Verdict,
    contact_verdict,
)
from slipd.friction.friction_state import FrictionState
from slipd.fusion import Contact, Utilisation, grey_loads
from slipd.fusion.hull import Outline
from slipd.fusion.loads import active_loads
from slipd.fusion.rows import FREE, LATE, PULLED, TOUCHING, UNKNOWN, UNTRUSTED, Rows
from slipd.fusion.streaming import assessment_at, contact_at, utilisation_at, wrench_at
from slipd.fusion.verdict_numbers import UNKNOWN_NUMBERS, VerdictNumbers, find_numbers
from slipd.motion.evidence import evidence_names
from slipd.types.arrays import Array
from slipd_client.messages import LEVELS

_NO_FRICTION = FrictionState()
_NO_TAXELS = (np.empty(0),) * 3


@dataclass(slots=True, frozen=True, eq=False)
class LoadDistribution:
    """How an image distributes a normal force of 1 N over its k ≥ 1 active taxels, in the pad frame.

    Attributes:
        x: Centres of the active taxels along X, shape (k,), m.
        y: Likewise along Y, shape (k,), m.
        shares: Normal force on each at 1 N, shape (k,); between two images it scales with the normal force.
        centroid_residual_m: Distance of their centroid from that of the force sensor, as of `Loads`, m.
        outline: Convex outline of the active taxels.
    """

    x: Array
    y: Array
    shares: Array
    centroid_residual_m: float
    outline: Outline

    def spin_required(self, contact: Contact) -> float:
        """Return the coefficient of friction that the spin of a contact alone requires, with the sign of the spin.

        It is m / (f_n × mean distance of the load from the centroid): 0 where the load is at one point, NaN where the
        spin is not known.
        """
        lever_m = float(self.shares @ np.hypot(self.x - contact.cx_m, self.y - contact.cy_m))
        return contact.spin_nm / (contact.normal_n * lever_m) if lever_m > 0.0 else 0.0


def distribute(rule: str, x: Array, y: Array, pressure: Array, contact: Contact) -> LoadDistribution | None:
    """Return the load distribution of an image for a contact; None where no taxel is active.

    Args:
        rule: ``load_rule`` of the config: "grey", "binary" or "matched". A contact without a centroid takes "grey".
        x: Centres of the taxels along X, shape (n,), m.
        y: Likewise along Y, shape (n,), m.
        pressure: Normal force on each taxel, 0 where it is inactive, shape (n,), any unit.
        contact: The contact by the force sensor.
    """
    (active,) = pressure.nonzero()
    if active.size == 0:
        return None
    x, y, pressure = x[active], y[active], pressure[active]
    outline = Outline(x, y)
    if rule == "grey" or math.isnan(contact.cx_m):
        loads = grey_loads(pressure, 1.0)
    else:
        loads = active_loads(x, y, None if rule == "binary" else pressure, (contact.cx_m, contact.cy_m), outline)
    return LoadDistribution(x, y, loads.loads, loads.centroid_residual_m, outline)


@dataclass(slots=True, eq=False)
class FingerState:
    """State of a finger after one force reading: the verdict, and the reading behind it. None or NaN is unknown.

    Attributes:
        t_ns: When the reading was acquired, CLOCK_MONOTONIC.
        verdict: Level and reasons.
        age_s: Age of the reading when it was received, s; None before the first.
        status: Conditions that the device reported with the reading.
        reading: Row of READING with all that was found, shape (1,); PENDING where it is not known any more what the
            contact does; None where nothing is known.
        load_distribution: Shares of the normal force on the taxels, by the image, where the reading touches.
        friction: What was known of the friction; None where nothing touches or the reading is not used.
    """

    t_ns: int
    verdict: Verdict
    age_s: float | None = None
    status: tuple[str, ...] = ()
    reading: Rows | None = None
    load_distribution: LoadDistribution | None = None
    friction: FrictionState | None = None
    _numbers: VerdictNumbers | None = field(default=None, init=False)

    @property
    def phase(self) -> int:
        """Contact phase of the reading."""
        return LATE if self.reading is None else int(self.reading["phase"].item(0))

    @property
    def wrench(self) -> list[float] | None:
        """Force on the finger, N, and torque about the pad's origin, N·m, both in the pad frame: six numbers."""
        if self.reading is None:
            return None
        wrench = wrench_at(self.reading, 0)
        return None if math.isnan(wrench[2]) and self.phase == UNTRUSTED else wrench

    @property
    def contact(self) -> Contact | None:
        """Contact by the force sensor alone, in the pad frame; not valid without contact."""
        if self.reading is None or self.phase in (PULLED, UNTRUSTED):
            return None
        return contact_at(self.reading, 0)

    @property
    def normal_n(self) -> float | None:
        """Normal force by the force sensor, N; None where it is not known, or clearly negative."""
        contact = self.contact
        return None if contact is None else contact.normal_n

    @property
    def utilisation(self) -> Utilisation | None:
        """λ of the load, with its bounds; only its pole is known without a coefficient of friction."""
        if self.reading is None or self.friction is None:
            return None
        used, nan = utilisation_at(self.reading, 0), math.nan
        if used is None or math.isnan(self.reading["contact"]["spin_nm"].item(0)):
            return None
        return used if self.friction.mu is not None else used._replace(value=nan, lower=nan, upper=nan)

    @property
    def evidence(self) -> tuple[str, ...]:
        """What shows that the object moves, words of `slipd.motion.evidence.EVIDENCE`; empty where nothing does."""
        return () if self.reading is None else evidence_names(self.reading["assessment"]["evidence"].item(0))

    def needed_normal_n(self, config: FingerConfig) -> float | None:
        """Return the least normal force on this pad that holds its load with the safety of ``[finger.X]``, N.

        It holds the load with the noise of the reading too, at a one-sided confidence of 95 %. None where it is not
        known, and where no force would hold the load.
        """
        needed_n: float | None = self.numbers(config).needed_n
        return needed_n

    def numbers(self, config: FingerConfig) -> VerdictNumbers:
        """Return the numbers of the verdict, which take a search on the limit surface, once for each state."""
        if self._numbers is None:
            self._numbers = UNKNOWN_NUMBERS if self.reading is None else self._find_numbers(self.reading, config)
        return self._numbers

    def _find_numbers(self, reading: Rows, config: FingerConfig) -> VerdictNumbers:
        distribution, friction, wrench = self.load_distribution, self.friction or _NO_FRICTION, config.wrench
        found = find_numbers(
            reading,
            *(_NO_TAXELS if distribution is None else (distribution.x, distribution.y, distribution.shares)),
            math.nan if friction.mu is None else friction.mu,
            friction.spin_scale,
            0.0 if wrench is None else wrench.force_std_n,  # the noise of a pad is not known
            0.0 if wrench is None else wrench.torque_std_nm,
            config.grip_safety,
            config.contact_growth,
        )
        return VerdictNumbers(*[number if math.isfinite(number) else None for number in found])


@dataclass(slots=True, eq=False)
class VerdictBatch:
    """Verdicts on the n readings of one read, in their order; ``batch[k]`` is the `FingerState` after reading k.

    Attributes:
        readings: The conditioned readings, with all that was found in their rows.
        phases: Contact phases that occur, a bit each: PULLED, LATE, UNTRUSTED, FREE and TOUCHING.
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
    phases: int
    load_distribution: LoadDistribution | None
    frictions: list[FrictionState]
    caution: float
    image_fault: str
    disagreement: tuple[str, ...]
    ends_at: int
    levels: list[int]
    _states: dict[int, FingerState] | None = field(default=None, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.levels)

    def __iter__(self) -> Iterator[FingerState]:
        return (self[k] for k in range(len(self)))

    def __getitem__(self, index: int) -> FingerState:
        k = range(len(self.levels))[index]
        if self._states is None:
            self._states = {}
        if k not in self._states:
            self._states[k] = self._make_state(k)
        return self._states[k]

    def phase(self, k: int) -> int:
        """Return the contact phase of reading k."""
        return int(self.readings.rows["phase"].item(k))

    @property
    def normal_n(self) -> float | None:
        """Normal force of the newest reading as in its `FingerState`, without the work of one."""
        if self.phase(-1) not in (FREE, TOUCHING):
            return None
        return float(self.readings.rows["contact"]["normal_n"][-1])

    def _make_state(self, k: int) -> FingerState:
        readings, phase = self.readings, self.phase(k)
        age_s = (readings.received_ns - readings.times_ns[k]) * 1e-9
        state = FingerState(readings.times_ns[k], STREAM_STALE, age_s)
        if phase == LATE:
            return state
        state.status, state.reading = readings.statuses[k], readings.rows[k : k + 1]
        if phase == TOUCHING:
            state.friction, state.load_distribution = self.frictions[k], self.load_distribution
        if phase == UNTRUSTED:
            state.verdict = Verdict("unknown", self.readings.untrusted.get(k, UNTARED.reasons))
        elif phase == PULLED:
            state.verdict = PAD_PULLED
        elif self.disagreement and k < self.ends_at:
            state.verdict = Verdict("unknown", ("disagreement", *self.disagreement))
        elif phase == TOUCHING:
            state.verdict = self._contact_verdict(state, k)
        else:
            state.verdict = WEIGHT_UNKNOWN if self.levels[k] == UNKNOWN else PAD_FREE
        return state

    def _contact_verdict(self, state: FingerState, k: int) -> Verdict:
        """Return the verdict on reading k, which touches, without a disagreement."""
        level, found, friction = LEVELS[self.levels[k]], GRIP_HOLDS, self.frictions[k]
        if level != GRIP_HOLDS.level:
            rows = self.readings.rows
            judged, ratio = assessment_at(rows, k), rows["contact"]["friction_ratio"].item(k)
            found = contact_verdict(judged, level, state.utilisation, ratio, friction.mu, self.caution)
        if self.load_distribution is None and self.image_fault:
            return Verdict(found.level, (self.image_fault, *found.reasons))
        return found
