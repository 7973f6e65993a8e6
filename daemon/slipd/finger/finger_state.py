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
    PAD_FREE,
    PAD_PULLED,
    STREAM_STALE,
    UNTARED,
    WEIGHT_UNKNOWN,
    Verdict,
    contact_verdict,
)
from slipd.friction.friction_state import FrictionState
from slipd.fusion import Contact, Loads, Utilisation, grey_loads
from slipd.fusion.friction_learning import Z
from slipd.fusion.hull import Outline
from slipd.fusion.levels import Assessment
from slipd.fusion.limit.grip_factor import solve_reserve
from slipd.fusion.loads import active_loads
from slipd.fusion.rows import FREE, LATE, PULLED, TOUCHING, UNKNOWN, UNTRUSTED
from slipd.fusion.streaming import contact_at, reading_at, wrench_at
from slipd.motion.evidence import evidence_names
from slipd.types.arrays import Array, finite_or_none
from slipd_client.messages import LEVELS


@dataclass(slots=True, frozen=True, eq=False)
class LoadDistribution:
    """How an image distributes a normal force of 1 N over its k ≥ 1 active taxels, in the pad frame.

    Attributes:
        x: Centres of the active taxels along X, shape (k,), m.
        y: Likewise along Y, shape (k,), m.
        loads: Normal force on each at 1 N; between two images it scales with the normal force.
        outline: Convex outline of the active taxels.
    """

    x: Array
    y: Array
    loads: Loads
    outline: Outline

    def spin_required(self, contact: Contact) -> float:
        """Return the coefficient of friction that the spin of a contact alone requires, with the sign of the spin.

        It is m / (f_n × mean distance of the load from the centroid): 0 where the load is at one point, NaN where the
        spin is not known.
        """
        lever_m = float(self.loads.loads @ np.hypot(self.x - contact.cx_m, self.y - contact.cy_m))
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
    return LoadDistribution(x, y, loads, outline)


@dataclass(slots=True)
class FingerState:
    """State of a finger after one force reading: the verdict and the quantities behind it. None or NaN is unknown.

    Attributes:
        t_ns: When the reading was acquired, CLOCK_MONOTONIC.
        verdict: Level and reasons.
        wrench: Force on the finger, N, and torque about the pad's origin, N·m, both in the pad frame: six numbers.
        contact: Contact by the force sensor alone, in the pad frame; not valid without contact.
        load_distribution: Shares of the normal force on the taxels, by the image.
        utilisation: λ of the load, with its bounds; only its pole is known without a coefficient of friction.
        tipping_margin_m: Signed distance of the contact centroid to the outline of the image, m; negative outside.
        assessment: Result of the slip decision; None without a contact.
        model: Most that the utilisation takes into account: "none", "translation" or "exact".
        status: Conditions that the device reported with the reading.
        age_s: Age of the reading when it was received, s; None before the first.
        friction: What was known of the friction; None where nothing touches or the reading says nothing.
        reserve: Needed normal force, N, and torque limit, N·m, once they were found.
    """

    t_ns: int
    verdict: Verdict
    wrench: tuple[float, ...] | None = None
    contact: Contact | None = None
    load_distribution: LoadDistribution | None = None
    utilisation: Utilisation | None = None
    tipping_margin_m: float = math.nan
    assessment: Assessment | None = None
    model: str = "none"
    status: tuple[str, ...] = ()
    age_s: float | None = None
    friction: FrictionState | None = None
    reserve: tuple[float | None, float | None] | None = field(default=None, init=False, compare=False)

    @property
    def normal_n(self) -> float | None:
        """Normal force by the force sensor, N; None where it is not known, or clearly negative."""
        return None if self.contact is None else self.contact.normal_n

    @property
    def evidence(self) -> tuple[str, ...]:
        """What shows that the object moves, words of `slipd.motion.evidence.EVIDENCE`; empty where nothing does."""
        return () if self.assessment is None else evidence_names(self.assessment.evidence)

    def needed_normal_n(self, config: FingerConfig) -> float | None:
        """Return the least normal force on this pad that holds its load with the safety of ``[finger.X]``, N.

        It holds the load with the noise of the reading too, at a one-sided confidence of 95 %. None where it is not
        known, and where no force would hold the load.
        """
        return self._reserve(config)[0]

    def torque_limit_nm(self, config: FingerConfig) -> float | None:
        """Return the torque in the sense of the spin that friction carries together with the tangential force, N·m.

        None where it is not known.
        """
        return self._reserve(config)[1]

    def _reserve(self, config: FingerConfig) -> tuple[float | None, float | None]:
        """Return the force that is needed and the torque limit: a search on the limit surface, once for each state."""
        if self.reserve is None:
            self.reserve = self._find_reserve(config)
        return self.reserve

    def _find_reserve(self, config: FingerConfig) -> tuple[float | None, float | None]:
        contact, distribution, used, friction = self.contact, self.load_distribution, self.utilisation, self.friction
        if contact is None or distribution is None or used is None or friction is None or not friction.mu:
            return None, None
        wrench, loads_n = config.wrench, distribution.loads.loads * contact.normal_n
        noise = (0.0, 0.0) if wrench is None else (wrench.force_std_n, wrench.torque_std_nm)  # that of a pad: unknown
        factor, torque_nm = solve_reserve(
            distribution.x, distribution.y, loads_n, friction.mu, contact.fx_n, contact.fy_n, contact.spin_nm,
            contact.cx_m, contact.cy_m, used.twist, *noise, Z, config.grip_safety, friction.spin_scale,
            config.contact_growth,
        )  # fmt: skip
        return finite_or_none(factor * float(loads_n.sum())), finite_or_none(torque_nm)


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
        return int(self.readings.rows["phase"][k])

    @property
    def touches(self) -> bool:
        """All readings touch."""
        return self.phases == 1 << TOUCHING

    @property
    def is_late(self) -> bool:
        """The newest reading is too old."""
        return bool(self.phases & 1 << LATE) and self.phase(-1) == LATE

    @property
    def normal_n(self) -> float | None:
        """Normal force of the newest reading as in its `FingerState`, without the work of one."""
        if self.phase(-1) not in (FREE, TOUCHING):
            return None
        return float(self.readings.rows["contact"]["normal_n"][-1])

    def force_state(self, k: int) -> FingerState:
        """Return the force of reading k, which a message about it needs, without the work of a verdict."""
        readings, phase = self.readings, self.phase(k)
        age_s = (readings.received_ns - readings.times_ns[k]) * 1e-9
        state = FingerState(readings.times_ns[k], STREAM_STALE, age_s=age_s)
        if phase != LATE:
            state.status, wrench = readings.statuses[k], wrench_at(readings.rows, k)
            state.wrench = None if phase == UNTRUSTED and math.isnan(wrench[2]) else wrench
        return state

    def _make_state(self, k: int) -> FingerState:
        state, phase = self.force_state(k), self.phase(k)
        if phase == TOUCHING:
            self._add_contact(state, k)
        elif phase == UNTRUSTED:
            state.verdict = Verdict("unknown", self.readings.untrusted.get(k, UNTARED.reasons))
        elif phase == PULLED:
            state.verdict = PAD_PULLED
        elif phase == FREE:
            state.verdict = WEIGHT_UNKNOWN if self.levels[k] == UNKNOWN else PAD_FREE
            state.contact = contact_at(self.readings.rows, k)
        return state

    def _add_contact(self, state: FingerState, k: int) -> None:
        """Fill in the state of a reading that touches."""
        reading, friction = reading_at(self.readings.rows, k), self.frictions[k]
        state.contact, state.friction, state.load_distribution = reading.contact, friction, self.load_distribution
        state.tipping_margin_m, state.assessment = reading.tipping_margin_m, reading.assessment
        used = None if math.isnan(reading.contact.spin_nm) else reading.utilisation
        if friction.mu is not None:
            state.model = "translation" if used is None else "exact"
        elif used is not None:
            used = used._replace(value=math.nan, lower=math.nan, upper=math.nan)
        state.utilisation = used
        if self.disagreement and k < self.ends_at:
            state.verdict = Verdict("unknown", ("disagreement", *self.disagreement))
            return
        ratio, level = reading.contact.friction_ratio, LEVELS[self.levels[k]]
        state.verdict = contact_verdict(reading.assessment, level, used, ratio, friction.mu, self.caution)
        if self.load_distribution is None and self.image_fault:
            state.verdict = Verdict(state.verdict.level, (self.image_fault, *state.verdict.reasons))
