"""Condition the readings of one force/torque sensor: from sensor readings to the wrench on the pad."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from slipd.config import Wrench
from slipd.finger.freshness import Arrival
from slipd.fusion.levels import Uncertainty
from slipd.fusion.rows import PENDING, UNTRUSTED, Rows
from slipd.fusion.streaming import IDENTITY, WrenchTransform, move_to_pad, new_readings
from slipd.signals.drift import DriftCompensation
from slipd.signals.frozen import MOST, WrenchWatch
from slipd.signals.gravity import FingerWeight, GravityCompensation
from slipd.signals.mounting import Mounting
from slipd.signals.tare import Offset, Tare
from slipd.types.arrays import Array
from slipd.types.samples import UNTRUSTED as UNTRUSTED_WORDS
from slipd.types.samples import WrenchSample

UNTRUSTED_FAULTS = frozenset({"stuck", "garbage"})
"""Faults with which a reading is not used. Those of an intermittent stream are, while it runs."""
GARBAGE, NOT_FINITE = ("garbage",), ("not_finite",)
NO_WEIGHT = np.zeros(6)
NO_UNCERTAINTY = Uncertainty()


class WrenchBatch(NamedTuple):
    """The readings of one read of a finger's force, conditioned.

    Attributes:
        times_ns: When each was acquired, CLOCK_MONOTONIC.
        received_ns: When they were received.
        rows: Rows of READING, shape (n,).
        transform: Moves their wrenches into the pad frame.
        untrusted: Reasons a reading is not trusted, by index.
        statuses: Conditions that the device reported with each.
    """

    times_ns: Sequence[int]
    received_ns: int
    rows: Rows
    transform: WrenchTransform
    untrusted: dict[int, tuple[str, ...]]
    statuses: Sequence[tuple[str, ...]]


class ForceChannel:
    """A force/torque sensor behind a pad.

    Each reading is checked and passes, in this order: tare, mounting, weight of the finger, drift.

    Args:
        wrench: ``[finger.X.wrench]``.
        stale_ns: Longest silence of a stream that did not fail.

    Attributes:
        tare: Offset of the readings, in the sensor frame, shape (6,), N and N·m.
        gravity: Weight of the finger beyond the sensor.
        drift: Drift of the zero that is subtracted; None where it is not followed.
        status: Conditions that the device reported with the newest reading.
        fault: Fault of the newest reading: "stuck", "garbage", "not_finite", "intermittent" or "".
    """

    def __init__(self, wrench: Wrench, stale_ns: int) -> None:
        self._noise = (wrench.force_std_n, wrench.torque_std_nm)
        self.tare = Tare(np.zeros(6), np.repeat(self._noise, 3))
        self._mass_kg = wrench.mass_kg
        self._noise_alone = Uncertainty(*self._noise)
        self.gravity = GravityCompensation(FingerWeight(wrench.mass_kg, wrench.com_m))
        pose = wrench.pad_from_sensor
        self._transform = WrenchTransform(
            Mounting(pose.xyz_m, pose.quat_xyzw, wrench.sign).matrix, self.tare.current.value, NO_WEIGHT
        )
        self.drift: DriftCompensation | None = None
        if wrench.drift_tau_s is not None:
            limit = np.repeat((wrench.drift_limit_n, wrench.drift_limit_nm), 3)
            self.drift = DriftCompensation(wrench.drift_tau_s, limit)
        self._offset = self.tare.current
        self._watch = WrenchWatch(
            wrench.range_n or MOST, wrench.range_nm or MOST, repeats=wrench.stuck_after, gap_ns=max(stale_ns, 1)
        )
        self.fault = ""
        self.status: tuple[str, ...] = ()
        self._waited_undated = False

    @property
    def zero_origin(self) -> str | None:
        """Where the zero comes from: "measured" or "stored"; None: it is not known, because no tare was taken."""
        return self.tare.current.origin if self.zero_known else None

    @property
    def zero_known(self) -> bool:
        """A tare of this run or an earlier one is in force; without one the bias may be any."""
        return self.tare.known

    @property
    def suspect(self) -> bool:
        """The newest reading repeats the one before, or jumped: no grip may be raised on it."""
        return self._watch.suspect

    @property
    def rests(self) -> bool:
        """The newest reading is suspect only because it repeats, which the config allows (``stuck_after`` 0)."""
        return self._watch.rests

    @property
    def noise_n(self) -> float:
        """Standard deviation of a force component, N."""
        return self._noise[0]

    def condition(
        self, samples: Sequence[WrenchSample], times_ns: Sequence[int], untouched: Callable[[], bool | None]
    ) -> WrenchBatch:
        """Return the readings of one read, conditioned.

        Args:
            samples: The readings; only one while a tare is measured.
            times_ns: When each was acquired, CLOCK_MONOTONIC.
            untouched: Returns whether nothing touches the finger; None: unknown.
        """
        numbers, statuses = [sample.numbers for sample in samples], [sample.status for sample in samples]
        rows = new_readings(numbers, [t_ns * 1e-9 for t_ns in times_ns])
        wrenches = rows["wrench"]
        untrusted = self._check(numbers, wrenches, statuses, times_ns)
        for k in untrusted:
            rows["phase"][k] = UNTRUSTED
        if self.tare.busy and 0 not in untrusted:
            self.tare.apply(wrenches[0], times_ns[0])
        if self.tare.current is not self._offset:
            self._take_offset()
        transform = self._current_transform()
        if self.drift is not None:
            move_to_pad(rows, transform)
            self._subtract_drift(self.drift, rows, times_ns, untouched())
            transform = IDENTITY
        forces_alone = [k for k, sample in enumerate(samples) if not sample.has_torque]
        if forces_alone:
            wrenches[forces_alone, 3:] = math.nan
        return WrenchBatch(times_ns, samples[-1].t_ns, rows, transform, untrusted, statuses)

    def begin_read(self, first_ns: int, arrival: Arrival) -> None:
        """Note how a read reached the daemon; ``first_ns``: when its first reading was acquired.

        Without a clock, time seems to stand still for readings that waited, and then to jump: that is no gap.
        """
        if self._waited_undated:
            self._watch.excuse(first_ns)
        self._waited_undated = arrival.waited_ns > 0 and not arrival.dated

    def _current_transform(self) -> WrenchTransform:
        """Return what moves readings into the pad frame, with the offset and the weight in force."""
        weight = self.gravity.correction
        if weight is None:
            weight = NO_WEIGHT
        if weight is not self._transform.weight or self._offset.value is not self._transform.offset:
            self._transform = WrenchTransform(self._transform.matrix, self._offset.value, weight)
        return self._transform

    def _subtract_drift(
        self, drift: DriftCompensation, rows: Rows, times_ns: Sequence[int], untouched: bool | None
    ) -> None:
        """Subtract the drift from readings in the pad frame, and learn it from them."""
        for wrench, phase, t_ns in zip(rows["wrench"], rows["phase"].tolist(), times_ns, strict=True):
            learns = phase == PENDING and self._may_learn(t_ns)
            drift.update(wrench, t_ns, untouched if learns else None)
            wrench -= drift.value

    def _check(
        self,
        readings: Sequence[Sequence[float]],
        wrenches: Array,
        statuses: Sequence[tuple[str, ...]],
        times_ns: Sequence[int],
    ) -> dict[int, tuple[str, ...]]:
        """Return the reasons a reading is not trusted, by index."""
        untrusted: dict[int, tuple[str, ...]] = {}
        self.status = statuses[-1]
        if any(statuses):
            words = (UNTRUSTED_WORDS.intersection(status) for status in statuses)
            untrusted = {k: tuple(sorted(found)) for k, found in enumerate(words) if found}
        for k, fault in self._watch.update(readings, times_ns, wrenches).items():
            if fault in UNTRUSTED_FAULTS:
                untrusted[k] = (*untrusted.get(k, ()), fault)
        self.fault = self._watch.fault
        if not self._watch.lively:
            for k, reading in enumerate(readings):
                if not all(map(math.isfinite, reading)) and untrusted.get(k, GARBAGE) == GARBAGE:
                    untrusted[k] = NOT_FINITE
            if untrusted.get(len(readings) - 1) == NOT_FINITE:
                self.fault = "not_finite"
        return untrusted

    def begin_tare(self, t_ns: int, seconds: float, by: str) -> None:
        """Begin to average readings; the weight at the present orientation becomes part of the offset."""
        self.tare.begin(t_ns, seconds, by, self.gravity.gravity(t_ns))

    def undo_tare(self) -> bool:
        """Restore the offset before the last tare; return False where there is none."""
        if not self.tare.undo():
            return False
        if self.tare.current is not self._offset:
            self._take_offset()
        return True

    def restore_tare(self, offset: Offset) -> None:
        """Put the offset of an earlier run in force."""
        self.tare.restore(offset)
        self._take_offset()

    def reject_tare(self, text: str) -> None:
        """Forget the offset of an earlier run; see `Tare.reject`."""
        self.tare.reject(text)
        self._take_offset()

    def set_gravity(self, gravity_mps2: Sequence[float], t_ns: int) -> None:
        """Set the apparent gravity in the pad frame, m/s²; a finger that turns gives up its tare."""
        before = self.gravity.gravity(t_ns)
        self.gravity.set(gravity_mps2, t_ns)
        if self.tare.busy and before is not None:
            turned_n = self._mass_kg * math.dist(before, gravity_mps2)
            if turned_n > self._noise[0]:
                self.tare.abort("turned")

    def uncertainty(self, t_ns: int) -> Uncertainty:
        """Return how far a reading at ``t_ns`` may be off."""
        if self._mass_kg == 0.0:
            return self._noise_alone
        return Uncertainty(*self._noise, *self.gravity.uncertainty(t_ns))

    def _may_learn(self, t_ns: int) -> bool:
        """Return whether the drift may be learned: nothing else about the readings is uncertain."""
        return not self.tare.busy and self.gravity.state(t_ns) != "unknown_orientation"

    def _take_offset(self) -> None:
        """Use the offset of a tare, or that of its undo, which has a lower id."""
        now, before = self.tare.current, self._offset
        self._offset = now
        self.gravity.retare(now.gravity_mps2)
        if self.drift is not None and now.id > before.id:
            self.drift.reset()
        elif self.drift is not None:
            self.drift.restore()
