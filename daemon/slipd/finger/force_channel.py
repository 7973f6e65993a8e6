"""Condition the readings of one force/torque sensor: from sensor readings to the wrench on the pad."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from slipd.config import Wrench, stale_after_ns
from slipd.finger.freshness import Arrival, Freshness
from slipd.fusion.contact_state import WrenchUncertainty
from slipd.fusion.rows import GARBAGE, NOT_FINITE, PENDING, STUCK, UNTRUSTED, Rows
from slipd.fusion.streaming import move_to_pad, new_readings
from slipd.signals.drift import DriftCompensation
from slipd.signals.frozen import MOST, WrenchWatch
from slipd.signals.gravity import FRESH_NS, FingerWeight, GravityCompensation
from slipd.signals.mounting import mounting_matrix
from slipd.signals.tare import Average, Offset, Tare
from slipd.types.arrays import Array
from slipd.types.samples import UNTRUSTED_WORDS, WrenchSample

UNTRUSTED_FAULTS = frozenset({"stuck", "garbage"})
"""Faults with which a reading is not used. Those of an intermittent stream are, while it runs."""


class WrenchBatch(NamedTuple):
    """The readings of one read of a finger's force, conditioned.

    Attributes:
        times_ns: When each was acquired, CLOCK_MONOTONIC.
        received_ns: When they were received.
        rows: Rows of READING, shape (n,).
        moved: Their wrenches are in the pad frame already, not in that of the sensor.
        untrusted: Reasons a reading is not trusted, by index.
        statuses: Conditions that the device reported with each.
    """

    times_ns: Sequence[int]
    received_ns: int
    rows: Rows
    moved: bool
    untrusted: dict[int, tuple[str, ...]]
    statuses: Sequence[tuple[str, ...]]


class ForceChannel:
    """A force/torque sensor behind a pad.

    Each reading is checked and passes, in this order: tare, mounting, weight of the finger, drift.

    Args:
        wrench: ``[finger.X.wrench]``.
        state: One row of CONTACT_STATE, in whose conditions mounting, offset and weight are kept up to date.

    Attributes:
        freshness: Of the readings.
        tare: Offset of the readings, in the sensor frame, shape (6,), N and N·m.
        zero: Whether the zero of the readings is known: it is the tare itself, of this run or an earlier one.
        gravity: Weight of the finger beyond the sensor.
        drift: Drift of the zero that is subtracted; None where it is not followed.
        noise: Of the readings, without what the weight may add.
        mass_kg: Of the finger beyond the sensor.
        watch: Repeated, impossible and missing readings; whether the newest reading is suspect.
        status: Conditions that the device reported with the newest reading.
        fault: Fault of the newest reading: "stuck", "garbage", "not_finite", "intermittent" or "".
    """

    def __init__(self, wrench: Wrench, state: Rows) -> None:
        self.freshness = Freshness(stale_after_ns(wrench))
        noise = wrench.force_std_n, wrench.torque_std_nm
        self.zero = self.tare = Tare(np.zeros(6), np.repeat(noise, 3))
        self.tare.on_change.append(self._follow_tare)
        self.mass_kg = wrench.mass_kg
        self.noise = WrenchUncertainty(*noise)
        self.gravity = GravityCompensation(FingerWeight(wrench.mass_kg, wrench.com_m))
        self._gravity_before: Sequence[float] | Array | None = None  # the running tare; as it was known first
        self._gravity_since = Average((3,))
        pose = wrench.pad_from_sensor
        self._state = state
        state["conditions"]["matrix"] = mounting_matrix(pose.xyz_m, pose.quat_xyzw, wrench.sign)
        self.drift: DriftCompensation | None = None
        if wrench.drift_tau_s is not None:
            limit = np.repeat((wrench.drift_limit_n, wrench.drift_limit_nm), 3)
            self.drift = DriftCompensation(wrench.drift_tau_s, limit)
        self.watch = WrenchWatch(
            wrench.range_n or MOST,
            wrench.range_nm or MOST,
            repeats=wrench.stuck_after,
            gap_ns=max(self.freshness.stale_ns, 1),
            noise=noise,
        )
        self.fault = ""
        self.status: tuple[str, ...] = ()
        self._waited_undated = False  # the newest read waited for the daemon, and has no time of its own
        self._set_conditions()

    def condition(
        self,
        samples: Sequence[WrenchSample],
        times_ns: Sequence[int],
        untouched: Callable[[], bool | None],
        received_ns: int | None = None,
    ) -> WrenchBatch:
        """Return the readings of one read, conditioned.

        Args:
            samples: The readings; only one while a tare is measured.
            times_ns: When each was acquired, CLOCK_MONOTONIC.
            untouched: Returns whether nothing touches the finger; None: unknown.
            received_ns: When they were received; None: as they state.
        """
        statuses = [sample.status for sample in samples]
        rows = new_readings([sample.numbers for sample in samples], times_ns)
        untrusted: dict[int, tuple[str, ...]] = {}
        doubted = self.watch.update(rows)
        self.status, self.fault = statuses[-1], self.watch.fault
        if doubted or any(statuses):
            untrusted = self._find_untrusted(rows, statuses)
            rows["phase"][list(untrusted)] = UNTRUSTED
        if self.tare.busy and 0 not in untrusted:
            self.tare.apply(rows["wrench"][0], times_ns[0])
        if self.drift is not None:
            move_to_pad(rows, self._state)
            self._subtract_drift(self.drift, rows, times_ns, untouched())
        for k, sample in enumerate(samples):
            if not sample.has_torque:
                rows["wrench"][k, 3:] = math.nan
        received_ns = samples[-1].t_ns if received_ns is None else received_ns
        return WrenchBatch(times_ns, received_ns, rows, self.drift is not None, untrusted, statuses)

    def begin_read(self, first_ns: int, arrival: Arrival) -> None:
        """Note how a read reached the daemon; ``first_ns``: when its first reading was acquired.

        Without a clock, time seems to stand still for readings that waited, and then to jump: that is no gap.
        """
        if self._waited_undated:
            self.watch.excuse(first_ns)
        self._waited_undated = arrival.waited_ns > 0 and not arrival.dated

    def _subtract_drift(
        self, drift: DriftCompensation, rows: Rows, times_ns: Sequence[int], untouched: bool | None
    ) -> None:
        """Subtract the drift from readings in the pad frame, and learn it from them while nothing else is uncertain."""
        for wrench, phase, t_ns in zip(rows["wrench"], rows["phase"].tolist(), times_ns, strict=True):
            certain = not self.tare.busy and self.gravity.state(t_ns) != "unknown_orientation"
            drift.update(wrench, t_ns, untouched if phase == PENDING and certain else None)
            wrench -= drift.value

    def _find_untrusted(self, rows: Rows, statuses: Sequence[tuple[str, ...]]) -> dict[int, tuple[str, ...]]:
        """Return the reasons a reading is not trusted, by index."""
        untrusted: dict[int, tuple[str, ...]] = {}
        for k, (doubts, status) in enumerate(zip(rows["doubts"].tolist(), statuses, strict=True)):
            reported = sorted(UNTRUSTED_WORDS.intersection(status))
            if doubts & NOT_FINITE and not reported and not doubts & STUCK:
                untrusted[k] = ("not_finite",)
            elif doubts & (STUCK | GARBAGE):
                untrusted[k] = (*reported, "stuck" if doubts & STUCK else "garbage")
            elif reported:
                untrusted[k] = tuple(reported)
        if untrusted.get(len(rows) - 1) == ("not_finite",):
            self.fault = "not_finite"
        return untrusted

    def begin_tare(self, t_ns: int, seconds: float, by: str) -> None:
        """Begin to average readings; the weight at the present orientation becomes part of the offset."""
        gravity = self._gravity_before = self.gravity.gravity(t_ns)
        self._gravity_since = Average((3,))
        self.tare.begin(t_ns, seconds, by, gravity)

    def set_gravity(self, gravity_mps2: Sequence[float], t_ns: int, fresh_ns: int = FRESH_NS) -> None:
        """Set the apparent gravity in the pad frame, m/s²; a finger that turns during a tare gives it up.

        Args:
            gravity_mps2: The gravity, shape (3,).
            t_ns: When it was measured.
            fresh_ns: For how long it is valid.
        """
        self.gravity.set(gravity_mps2, t_ns, fresh_ns)
        self._set_conditions()
        if self.tare.busy:
            self._give_up_turned_tare(gravity_mps2)

    def set_motion(self, gravity_mps2: Sequence[float], turn_radps: float, t_ns: int, fresh_ns: int) -> None:
        """Set the apparent gravity of a moving arm, as `set_gravity` does; it also explains how the load changes.

        Args:
            gravity_mps2: As in `set_gravity`.
            turn_radps: Angular velocity about the normal of the pad.
            t_ns: When they were measured.
            fresh_ns: For how long they are valid.
        """
        self.set_gravity(gravity_mps2, t_ns, fresh_ns)
        conditions = self._state["conditions"]
        conditions["gravity_mps2"], conditions["turn_radps"] = gravity_mps2[:2], turn_radps
        conditions["gravity_s"], conditions["gravity_lasts_s"] = t_ns * 1e-9, fresh_ns * 1e-9

    def _give_up_turned_tare(self, gravity_mps2: Sequence[float]) -> None:
        """Give up a tare over which the mean weight differs from that at its begin by more than the noise."""
        before = self._gravity_before = gravity_mps2 if self._gravity_before is None else self._gravity_before
        self._gravity_since.add(np.array(gravity_mps2))
        if self.mass_kg * math.dist(before, self._gravity_since.mean) > self.noise.force_std_n:
            self.tare.abort("turned")

    def uncertainty(self, t_ns: int) -> WrenchUncertainty:
        """Return how far a reading at ``t_ns`` may be off."""
        return WrenchUncertainty(*self.noise[:2], *self.gravity.uncertainty(t_ns))

    def _follow_tare(self, now: Offset, before: Offset) -> None:
        """Use the offset of a tare, or that of its undo, which has a lower id."""
        if now is before:
            return
        self.gravity.retare(now.gravity_mps2)
        if self.drift is not None and now.id > before.id:
            self.drift.reset()
        elif self.drift is not None:
            self.drift.restore()
        self._set_conditions()

    def _set_conditions(self) -> None:
        """Put the offset and the weight in force."""
        weight = self.gravity.correction
        conditions = self._state["conditions"]
        conditions["offset"], conditions["weight"] = self.tare.current.value, 0.0 if weight is None else weight
