"""The motion of the gripper over the last 0.4 s, interpolated between the readings of the arm stream."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from slipd.grasp.object_estimate import GripperMotion
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample

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
        """Add the reading of ``t_ns``; if it is not newer than the newest one, drop all earlier readings first."""
        if t_ns <= self.newest_ns:
            self._times_ns.clear()
            self._rows.clear()
        turning = sample.angular_acceleration_radps2
        parts = sample.gravity_mps2, sample.angular_velocity_radps, (np.nan,) * 3 if turning is None else turning
        self._times_ns.append(t_ns)
        self._rows.append(np.concatenate(parts))
        old = bisect_right(self._times_ns, t_ns - KEPT_NS)
        del self._times_ns[:old], self._rows[:old]

    def gravity(self, t_ns: int) -> Array | None:
        """Return the apparent gravity at ``t_ns``, shape (3,), m/s²; None where it is not known."""
        row = self._row(t_ns)
        return None if row is None else row[:3]

    def motion(self, t_ns: int) -> GripperMotion | None:
        """Return the motion of the gripper at ``t_ns``; None where readings before or after it are missing."""
        row, before, after = self._row(t_ns), self._row(t_ns - TURN_NS), self._row(t_ns + TURN_NS)
        early, late = self._row(t_ns - TIMING_NS), self._row(t_ns + TIMING_NS)
        if row is None or before is None or after is None or early is None or late is None:
            return None
        turning = row[6:] if np.isfinite(row[6:]).all() else (after[3:6] - before[3:6]) / (2e-9 * TURN_NS)
        return GripperMotion(row[:3], row[3:6], turning, float(np.linalg.norm(late[:3] - early[:3])) / 2.0)

    def _row(self, t_ns: int) -> Array | None:
        """Return apparent gravity, angular velocity and angular acceleration at ``t_ns``, shape (9,), or None."""
        times_ns = self._times_ns
        after = bisect_right(times_ns, t_ns)
        if after == 0 or (after == len(times_ns) and t_ns > times_ns[-1]):
            return None
        if after == len(times_ns):
            return self._rows[-1]
        begin_ns, end_ns = times_ns[after - 1], times_ns[after]
        if end_ns - begin_ns > MOST_GAP_NS:
            return None
        part = (t_ns - begin_ns) / (end_ns - begin_ns)
        return (1.0 - part) * self._rows[after - 1] + part * self._rows[after]
