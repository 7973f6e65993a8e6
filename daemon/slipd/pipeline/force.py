"""The force side of one finger: from the readings of its force/torque sensor to the force on the pad."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slipd.config import Wrench
from slipd.fusion import carry
from slipd.samples import UNTRUSTED, Array, WrenchSample
from slipd.signals.drift import DriftCompensation
from slipd.signals.frozen import WrenchWatch
from slipd.signals.gravity import FingerWeight, GravityCompensation
from slipd.signals.mounting import Mounting
from slipd.signals.tare import Tare
from slipd_client.messages import Health

#: Where the config states no range, no reading is out of it.
NO_RANGE_N = 1e9
NEVER = 1 << 62
#: Faults with which a reading says nothing. One that flickers is believed while it is there.
UNTRUSTED_FAULTS = frozenset({"stuck", "garbage"})
_FAULTS = {
    "stuck": (Health.ERROR, "its readings repeat: it hangs, or stuck_after is too small for a sensor this still"),
    "garbage": (Health.ERROR, "its readings are out of range_n, or jump to and fro"),
    "intermittent": (Health.WARN, "it failed several times within 10 s"),
}
NO_WEIGHT = np.zeros(6)
_NO_TORQUE = [0.0, 0.0, 0.0]
_UNKNOWN = (math.nan, math.nan, math.nan)


class Doubt(NamedTuple):
    """How far a reading may be off: noise, and what an uncompensated weight may add.

    Attributes:
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Likewise of each torque component, N·m.
        force_n: Most that the weight adds, N.
        torque_nm: Likewise, N·m.
    """

    force_std_n: float = 0.0
    torque_std_nm: float = 0.0
    force_n: float = 0.0
    torque_nm: float = 0.0


NO_DOUBT = Doubt()


@dataclass(slots=True)
class Reading:
    """One reading of the force sensor, on the pad.

    Attributes:
        untrusted: What speaks against it; empty when nothing does.
        torque: The sensor measures torque.
        wrench: Force on the finger in the pad frame, N, and torque about the pad's origin, N·m; the torque is NaN where
            the sensor measures none.
    """

    untrusted: tuple[str, ...]
    torque: bool
    wrench: tuple[float, ...] = ()


class ForceSide:
    """A force/torque sensor behind a pad. In this order: tare, mounting, weight of the finger, drift.

    Args:
        wrench: ``[finger.X.wrench]``.
        stale_ns: A longer silence is a failure of the stream.

    Attributes:
        tare: Offset of the readings, in the sensor's own frame.
        gravity: The weight of the finger beyond the sensor.
        fault: What speaks against the newest reading: "stuck", "garbage", "intermittent" or "".
    """

    def __init__(self, wrench: Wrench, stale_ns: int) -> None:
        self._noise = (wrench.force_std_n, wrench.torque_std_nm)
        self.tare = Tare(np.zeros(6), np.repeat(self._noise, 3))
        self._mass_kg = wrench.mass_kg
        self._noise_alone = Doubt(*self._noise)
        self.gravity = GravityCompensation(FingerWeight(wrench.mass_kg, wrench.com_m))
        pose = wrench.pad_from_sensor
        self._to_pad: Array = Mounting(pose.xyz_m, pose.quat_xyzw, wrench.sign).matrix
        self._drift = None
        if wrench.drift_tau_s is not None:
            limit = np.repeat((wrench.drift_limit_n, wrench.drift_limit_nm), 3)
            self._drift = DriftCompensation(wrench.drift_tau_s, limit)
        self._offset = self.tare.current
        self._watch = WrenchWatch(
            wrench.range_n or NO_RANGE_N, repeats=wrench.stuck_after or NEVER, gap_ns=max(stale_ns, 1)
        )
        self.fault = ""
        self._status: tuple[str, ...] = ()

    @property
    def noise_n(self) -> float:
        """Standard deviation of a force component, N."""
        return self._noise[0]

    @property
    def drifts(self) -> bool:
        """Its zero is followed."""
        return self._drift is not None

    def take(self, samples: Sequence[WrenchSample], times_ns: Sequence[int], untouched: bool | None) -> list[Reading]:
        """Takes the readings of one read.

        Args:
            samples: The readings.
            times_ns: When each was acquired.
            untouched: Nothing touches the finger; None where that is not known.
        """
        if self.tare.busy and len(samples) > 1:
            singly = zip(samples, times_ns, strict=True)
            return [reading for sample, t_ns in singly for reading in self.take((sample,), (t_ns,), untouched)]
        found, rows = [], []
        for sample, t_ns in zip(samples, times_ns, strict=True):
            reading, numbers = self._check(sample, t_ns)
            found.append(reading)
            rows.append(numbers)
        if self.tare.busy and math.isfinite(sum(rows[0])):
            self.tare.apply(np.array(rows[0]), times_ns[0], trusted=not found[0].untrusted)
        if self.tare.current is not self._offset:
            self._take_offset()
        weight = self.gravity.correction
        wrenches = carry(self._to_pad, self._offset.value, NO_WEIGHT if weight is None else weight, np.array(rows))
        if self._drift is not None:
            for wrench, reading, t_ns in zip(wrenches, found, times_ns, strict=True):
                learns = not reading.untrusted and self._may_learn(t_ns)
                self._drift.update(wrench, t_ns, untouched if learns else None)
                wrench -= self._drift.value
        for reading, wrench in zip(found, wrenches.tolist(), strict=True):
            if reading.torque:
                reading.wrench = tuple(wrench)
            else:
                reading.wrench = (*wrench[:3], *_UNKNOWN)
        return found

    def _check(self, sample: WrenchSample, t_ns: int) -> tuple[Reading, list[float]]:
        """What speaks against a reading, and its six numbers; a torque that the sensor does not measure is 0."""
        torque = sample.torque_nm
        self._status = status = sample.status
        self.fault = fault = self._watch.update(sample.force_n, torque, t_ns)
        untrusted = tuple(sorted(UNTRUSTED.intersection(status))) if status else ()
        if fault in UNTRUSTED_FAULTS:
            untrusted = (*untrusted, fault)
        numbers: list[float] = sample.force_n.tolist() + (_NO_TORQUE if torque is None else torque.tolist())
        if not math.isfinite(sum(numbers)):
            untrusted = untrusted or ("not_finite",)
        return Reading(untrusted, torque is not None), numbers

    def begin_tare(self, t_ns: int, seconds: float, by: str) -> None:
        """Starts to average readings; the weight at the present orientation becomes part of the offset."""
        self.tare.begin(t_ns, seconds, by, self.gravity.gravity(t_ns))

    def undo_tare(self) -> bool:
        """Puts the offset before the last tare back in force; False where there is none."""
        if not self.tare.undo():
            return False
        if self.tare.current is not self._offset:
            self._take_offset()
        return True

    def set_gravity(self, gravity_mps2: Sequence[float], t_ns: int) -> None:
        """Takes the apparent gravity in the pad frame, m/s²; a tare that is being measured must not be turned."""
        before = self.gravity.gravity(t_ns)
        self.gravity.set(gravity_mps2, t_ns)
        if self.tare.busy and before is not None:
            turned_n = self._mass_kg * math.dist(before, gravity_mps2)
            if turned_n > self._noise[0]:
                self.tare.abort("the finger was turned")

    def doubt(self, t_ns: int) -> Doubt:
        """How far a reading at ``t_ns`` may be off."""
        if self._mass_kg == 0.0:
            return self._noise_alone
        return Doubt(*self._noise, *self.gravity.uncertainty(t_ns))

    def conditions(self, t_ns: int) -> list[tuple[Health, str]]:
        """What people should know of the sensor's readings."""
        found = [_FAULTS[self.fault]] if self.fault else []
        if self._status:
            level = Health.WARN if UNTRUSTED.isdisjoint(self._status) else Health.ERROR
            found.append((level, f"the device reports: {', '.join(self._status)}"))
        if self.gravity.state(t_ns) == "unknown_orientation":
            force_n = self.gravity.uncertainty(t_ns)[0]
            found.append((Health.WARN, f"no fresh gravity.set: the finger's weight may add {force_n:.2f} N"))
        if self.gravity.state(t_ns) == "unknown_orientation" and self._offset.gravity_mps2 is None:
            found.append((Health.OK, "tare it once more while gravity.set runs: the last tare holds an unknown weight"))
        if self._drift is not None and self._drift.total >= 1.0:
            found.append((Health.WARN, "its zero drifted to the limit of what is followed: tare it"))
        if self.tare.aborted_reason:
            found.append((Health.OK, f"the last tare was given up: {self.tare.aborted_reason}"))
        return found

    def told(self, t_ns: int) -> dict[str, Any]:
        """What ``status.streams.<name>`` says of the conditioning."""
        drift = self._drift
        return {
            "gravity": self.gravity.state(t_ns),
            "drift": None if drift is None else drift.value.tolist(),
            "drift_frozen": None if drift is None else drift.frozen,
        }

    def _may_learn(self, t_ns: int) -> bool:
        """A zero is learned only from readings of which nothing else is in doubt."""
        return not self.tare.busy and self.gravity.state(t_ns) != "unknown_orientation"

    def _take_offset(self) -> None:
        """Another offset is in force: by a tare, or by its undo, which has a lower id."""
        now, before = self.tare.current, self._offset
        self._offset = now
        self.gravity.retare(now.gravity_mps2)
        if self._drift is not None and now.id > before.id:
            self._drift.reset()
        elif self._drift is not None:
            self._drift.restore()
