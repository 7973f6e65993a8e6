"""Motion of the arm: gives each finger of the grasp the apparent gravity that acts on its own weight.

A stream that cannot be right is not believed: its fingers are then as they are without a stream.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from slipd.config import Arm as ArmConfig
from slipd.config import stale_after_ns
from slipd.grasp.arm_check import SHIFTS_NS, ArmCheck
from slipd.grasp.arm_gravity import ArmGravity
from slipd.grasp.grasp_fingers import WeighedFinger
from slipd.grasp.object_estimate import GripperMotion
from slipd.signals.gravity import FRESH_NS, MOST_GRAVITY_MPS2, STANDARD_GRAVITY_MPS2, gravity_fault
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample
from slipd_client.messages import Health

CHECK_NS = 1_000_000_000
LEAST_MEAN_MPS2, MOST_MEAN_MPS2 = 5.0, 20.0
"""Range of the mean length of the apparent gravity over `CHECK_NS`. The mean vector differs from gravity by the change
of speed over this time, and no arm changes its speed by more than about 4 m/s; a stream in g is at 1."""


STILL_MPS2, REST_PART = 0.3, 0.05
"""Over a span in which the apparent gravity stays within STILL_MPS2, its mean length is that of gravity within
REST_PART: no arm speeds up evenly by 0.5 m/s in a second."""

MOST_JUMP_MPS2, MOST_JUMPS = 15.0, 2
"""From one reading to the next, the apparent gravity changes by more in a collision alone, and not more often than that
in `CHECK_NS`; a stream whose sign alternates changes by 2 g each time."""

MOST_TURN_RADPS = 30.0
"""Twice the fastest turn of a wrist beside those of the other joints; in degrees per second, a slow one exceeds it."""
MOST_TURN_RADPS2 = 10_000.0
"""More than a collision gives. The gravity at the fingers does not bound it: a turn about the line through both moves
neither."""

KEPT_NS = 400_000_000
"""Readings are kept for so long."""
MOST_GAP_NS = 60_000_000
"""Between readings further apart than this nothing is known: three periods of the slowest stream."""
TIMING_NS = 4_000_000
"""Error of timing between arm and fingers, as a standard deviation."""
TURN_NS = 20_000_000
"""Angular acceleration that is not reported is the change of ω over twice this time."""


class MotionHistory:
    """Buffers the recent readings of the arm, and interpolates between them."""

    def __init__(self) -> None:
        self._times_ns: list[int] = []
        self._rows: list[Array] = []  # γ, ω and α of each; α NaN: not reported

    @property
    def newest_ns(self) -> int:
        """Time of the newest reading; 0 before the first."""
        return self._times_ns[-1] if self._times_ns else 0

    def add(self, sample: ArmSample, t_ns: int) -> None:
        """Add the reading of ``t_ns``. A repeated time is ignored; a time that goes back starts the history again."""
        if t_ns == self.newest_ns:
            return
        if t_ns < self.newest_ns:
            self._times_ns.clear()
            self._rows.clear()
        turning = sample.angular_acceleration_radps2
        parts = sample.gravity_mps2, sample.angular_velocity_radps, (np.nan,) * 3 if turning is None else turning
        self._times_ns.append(t_ns)
        self._rows.append(np.concatenate(parts))
        old = bisect_right(self._times_ns, t_ns - KEPT_NS)
        del self._times_ns[:old], self._rows[:old]

    def motion(self, t_ns: int) -> GripperMotion | None:
        """Return the motion of the gripper at ``t_ns``; None where readings before or after it are missing."""
        rows = self.at((t_ns, t_ns - TURN_NS, t_ns + TURN_NS, t_ns - TIMING_NS, t_ns + TIMING_NS))
        if rows is None:
            return None
        now, before, after, early, late = rows
        turning = now[6:] if np.isfinite(now[6:]).all() else (after[3:6] - before[3:6]) / (2e-9 * TURN_NS)
        return GripperMotion(now[:3], now[3:6], turning, float(np.linalg.norm(late[:3] - early[:3])) / 2.0)

    def at(self, times_ns: Sequence[int]) -> Array | None:
        """Return apparent gravity, angular velocity and acceleration at some times, shape (n, 9).

        Returns:
            The rows, with NaN for an acceleration that is not reported; None where one of the times is not known.
        """
        read_ns, found = self._times_ns, np.empty((len(times_ns), 9))
        for row, t_ns in zip(found, times_ns, strict=True):
            after = bisect_right(read_ns, t_ns)
            if after == 0 or t_ns > read_ns[-1]:
                return None
            if after == len(read_ns):
                row[:] = self._rows[-1]
                continue
            begin_ns, end_ns = read_ns[after - 1], read_ns[after]
            if end_ns - begin_ns > MOST_GAP_NS:
                return None
            part = (t_ns - begin_ns) / (end_ns - begin_ns)
            row[:] = (1.0 - part) * self._rows[after - 1] + part * self._rows[after]
        return found


class ArmMotion:
    """Follows the arm, and sets the gravity of the fingers of the grasp.

    Args:
        arm: ``[grasp.arm]``.
        fingers: Those of the grasp that have a force sensor.

    Attributes:
        history: Its newest readings that can be right.
        gravity: Direction of gravity, by the readings that can be right.
        check: Compares the stream with the load; while it finds a fault, the stream is not used.
    """

    def __init__(self, arm: ArmConfig, fingers: Sequence[WeighedFinger]) -> None:
        self._stale_ns = stale_after_ns(arm)
        self.history, self.gravity = MotionHistory(), ArmGravity()
        self._fingers = fingers
        self.check = ArmCheck(math.hypot(*(one.noise_n for one in fingers)))
        self._fresh_until_ns: int | None = None
        self._fault = ""  # of the newest reading
        self._mean_mps2: float | None = None
        self._at_rest_mps2 = STANDARD_GRAVITY_MPS2
        self._since_ns: int | None = None
        self._first: Sequence[float] = ()
        self._sum_mps2, self._count, self._change_mps2 = 0.0, 0, 0.0
        self._newest: Sequence[float] = ()
        self._jumps = 0

    def update(self, samples: Sequence[ArmSample], times_ns: Sequence[int], width_m: float | None) -> None:
        """Set the gravity of the fingers by the newest usable reading of one read.

        Args:
            samples: The readings, at least one.
            times_ns: When each was acquired.
            width_m: Width between the pads, m; None: unknown, and that in the middle of the configured ones counts.
        """
        for sample, acquired_ns in zip(samples, times_ns, strict=True):
            self._fault = _fault_of(sample)
            if self._fault or not self._check_length(sample.gravity_mps2, acquired_ns):
                continue
            gravities = [finger.gravity_under(sample, width_m) for finger in self._fingers]
            if any(map(gravity_fault, gravities)):
                self._fault = f"its motion exceeds {MOST_GRAVITY_MPS2:.0f} m/s² (5 g) at a finger: check its units"
                continue
            self.history.add(sample, acquired_ns)
            if self.check.fault:
                continue
            for finger, gravity in zip(self._fingers, gravities, strict=True):
                finger.set_motion(gravity, sample.angular_velocity_radps, acquired_ns, self._stale_ns)
            self._fresh_until_ns = acquired_ns + self._stale_ns
        if not self._fault:
            self.gravity.update(samples[-1], times_ns[-1])

    def bridge_stall(self, since_ns: int) -> None:
        """Let a stream that was fresh as the daemon stalled count for as long as ``gravity.set``.

        Lines are read one after another: readings of a sensor are judged before those of the arm arrive.

        Args:
            since_ns: When the lines were last read empty.
        """
        fresh_until_ns = self._fresh_until_ns
        if fresh_until_ns is not None and since_ns <= fresh_until_ns:
            for finger in self._fingers:
                finger.force.gravity.extend(fresh_until_ns - self._stale_ns + FRESH_NS)

    def compare(self, t_ns: int, load_n: Array) -> bool:
        """Compare the stream with the load on the fingers at ``t_ns``; return whether its fault changed.

        Args:
            t_ns: When the load was read; the history reaches beyond it by all of `SHIFTS_NS`.
            load_n: Force with the weight of the fingers, in the gripper frame, shape (3,), N.
        """
        before, rows = self.check.fault, self.history.at([t_ns + shift for shift in SHIFTS_NS])
        if rows is not None:
            self.check.update(load_n, rows[:, :3])
        return self.check.fault != before

    def is_used(self, t_ns: int) -> bool:
        """Return whether the stream is fresh and believed at ``t_ns``."""
        return self._fresh_until_ns is not None and t_ns <= self._fresh_until_ns and not self.check.fault

    def sets_gravity_of(self, finger: str, t_ns: int) -> bool:
        """Return whether the gravity of a finger comes from the arm at ``t_ns``."""
        return any(one.finger.name == finger for one in self._fingers) and self.is_used(t_ns)

    def conditions(self) -> list[tuple[Health, str]]:
        """Return why the readings are not used, for people; empty where they are."""
        if self._fault:
            return [(Health.ERROR, self._fault)]
        if self._mean_mps2 is None:
            return [(Health.OK, "its gravity is checked for 1 s before it is used")]
        if self.check.fault:
            return [(Health.ERROR, f"{self.check.fault}, by the load on the fingers: its readings are not used")]
        if self._is_plausible():
            return []
        if math.isnan(self._mean_mps2):
            return [(Health.ERROR, "gravity_mps2 jumps to and fro by more than 1.5 g: its readings are not used")]
        if LEAST_MEAN_MPS2 <= self._mean_mps2 <= MOST_MEAN_MPS2:
            what = f"the length of gravity_mps2 at rest is {self._at_rest_mps2:.3g} m/s²; it must be 9.81"
            return [(Health.ERROR, f"{what}: its scale is wrong, and its readings are not used")]
        what = f"the mean length of gravity_mps2 is {self._mean_mps2:.3g} m/s²; it must be near 9.81"
        return [(Health.ERROR, f"{what}: its readings are not used; is it in g, or without gravity?")]

    def _is_plausible(self) -> bool:
        mean, scale_error = self._mean_mps2, abs(self._at_rest_mps2 / STANDARD_GRAVITY_MPS2 - 1.0)
        return mean is not None and LEAST_MEAN_MPS2 <= mean <= MOST_MEAN_MPS2 and scale_error <= REST_PART

    def _check_length(self, gravity_mps2: Sequence[float], t_ns: int) -> bool:
        """Return whether the length of the last whole span is plausible; False before the first one."""
        if self._since_ns is None:
            self._since_ns, self._first = t_ns, gravity_mps2
            self._sum_mps2, self._count, self._change_mps2, self._jumps = 0.0, 0, 0.0, 0
        self._sum_mps2 += math.hypot(*gravity_mps2)
        self._count += 1
        self._change_mps2 = max(self._change_mps2, math.dist(gravity_mps2, self._first))
        self._jumps += math.dist(gravity_mps2, self._newest or gravity_mps2) > MOST_JUMP_MPS2
        self._newest = gravity_mps2
        if self._jumps > MOST_JUMPS:
            self._mean_mps2, self._since_ns = math.nan, None
        elif t_ns - self._since_ns >= CHECK_NS:
            self._mean_mps2, self._since_ns = self._sum_mps2 / self._count, None
            if self._change_mps2 <= STILL_MPS2:
                self._at_rest_mps2 = self._mean_mps2
        return self._is_plausible()


def _fault_of(sample: ArmSample) -> str:
    """Return why a reading cannot be used, for people; "" where it can."""
    if sample.status:
        return f"the sender reports: {', '.join(sample.status)}"
    turn_radps = math.hypot(*sample.angular_velocity_radps)
    if turn_radps > MOST_TURN_RADPS:
        return f"its angular velocity is {turn_radps:.3g} rad/s, more than any arm's: is it in degrees per second?"
    turn_radps2 = math.hypot(*(sample.angular_acceleration_radps2 or ()))
    if turn_radps2 > MOST_TURN_RADPS2:
        return f"its angular acceleration is {turn_radps2:.3g} rad/s², more than any arm's: check its units"
    return ""
