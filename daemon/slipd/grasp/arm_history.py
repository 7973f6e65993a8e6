"""The motion of the arm lately: what the gripper felt in the last third of a second, and which way gravity points."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from slipd.grasp.object_estimate import Felt
from slipd.signals.gravity import STANDARD_GRAVITY_MPS2
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample

KEPT_NS = 400_000_000
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
        self._rows: list[Array] = []  # γ, ω, α; NaN: unknown

    @property
    def newest_ns(self) -> int:
        """Time of the newest reading; 0 before the first."""
        return self._times_ns[-1] if self._times_ns else 0

    def add(self, sample: ArmSample, t_ns: int) -> None:
        """Add the reading of ``t_ns``; if it is not newer than the newest one, drop all earlier readings first."""
        if t_ns <= self.newest_ns:
            self.forget()
        turning = sample.angular_acceleration_radps2
        parts = sample.gravity_mps2, sample.angular_velocity_radps, (np.nan,) * 3 if turning is None else turning
        self._times_ns.append(t_ns)
        self._rows.append(np.concatenate(parts))
        old = bisect_right(self._times_ns, t_ns - KEPT_NS)
        del self._times_ns[:old], self._rows[:old]

    def forget(self) -> None:
        """Forget all readings."""
        self._times_ns.clear()
        self._rows.clear()

    def gravity(self, t_ns: int) -> Array | None:
        """Return the apparent gravity at ``t_ns``, shape (3,), m/s²; None where it is not known."""
        row = self._at(t_ns)
        return None if row is None else row[:3]

    def felt(self, t_ns: int) -> Felt | None:
        """Return what the gripper felt at ``t_ns``; None where readings before or after it are missing."""
        row, before, after = self._at(t_ns), self._at(t_ns - TURN_NS), self._at(t_ns + TURN_NS)
        early, late = self._at(t_ns - TIMING_NS), self._at(t_ns + TIMING_NS)
        if row is None or before is None or after is None or early is None or late is None:
            return None
        turning = row[6:] if np.isfinite(row[6:]).all() else (after[3:6] - before[3:6]) / (2e-9 * TURN_NS)
        return Felt(row[:3], row[3:6], turning, float(np.linalg.norm(late[:3] - early[:3])) / 2.0)

    def _at(self, t_ns: int) -> Array | None:
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


SETTLING_S = 1.0
"""The direction is unknown until this much of the motion has been observed."""
MEMORY_S = 4.0
"""At a speed v the error is v / MEMORY_S, because the speed is the integral of what is not gravity."""
ERROR_MPS2 = 0.25
"""Error of gravity at a speed of 1 m/s."""
MOST_GAP_S = 0.1
"""After a longer gap between readings the turn is not known, and the direction is estimated again from the start."""

Triple = tuple[float, float, float]


class ArmGravity:
    """Follows gravity: the mean of what the gripper feels, turned along with its angular velocity.

    Attributes:
        felt_mps2: What the gripper felt at the last reading, m/s².
        velocity_radps: Angular velocity then.
        acceleration_radps2: Angular acceleration then; zeros where it is not reported.
    """

    def __init__(self) -> None:
        self.felt_mps2: Sequence[float] = (0.0, 0.0, 0.0)
        self.velocity_radps: Sequence[float] = (0.0, 0.0, 0.0)
        self.acceleration_radps2: Sequence[float] = (0.0, 0.0, 0.0)
        self._mean: Triple = (0.0, 0.0, 0.0)
        self._seen_s, self._t_ns = 0.0, 0

    def update(self, sample: ArmSample, t_ns: int) -> None:
        """Follow a reading of ``t_ns``; one with a status, such as values that are not finite, is left out."""
        if sample.status:
            return
        passed_s = (t_ns - self._t_ns) * 1e-9
        x, y, z = sample.gravity_mps2
        if not 0.0 < passed_s <= MOST_GAP_S:
            self._mean, self._seen_s = (x, y, z), 0.0
        else:
            self._seen_s += passed_s
            gx, gy, gz = turn_back(self._mean, self.velocity_radps, sample.angular_velocity_radps, passed_s)
            part = passed_s / max(min(self._seen_s, MEMORY_S), passed_s)
            self._mean = gx + part * (x - gx), gy + part * (y - gy), gz + part * (z - gz)
        self._t_ns, self.felt_mps2, self.velocity_radps = t_ns, sample.gravity_mps2, sample.angular_velocity_radps
        self.acceleration_radps2 = sample.angular_acceleration_radps2 or (0.0, 0.0, 0.0)

    def gravity(self) -> Triple | None:
        """Return gravity in the gripper frame, m/s²; None where it is not known."""
        length = math.hypot(*self._mean)
        if self._seen_s < SETTLING_S or length == 0.0:
            return None
        scale = STANDARD_GRAVITY_MPS2 / length
        x, y, z = self._mean
        return scale * x, scale * y, scale * z


def turn_back(vector: Triple, before_radps: Sequence[float], after_radps: Sequence[float], passed_s: float) -> Triple:
    """Return the coordinates of a constant vector after the frame has turned.

    Args:
        vector: The vector in the frame as it was.
        before_radps: Angular velocity of the frame then.
        after_radps: Its angular velocity now; between both it counts as the mean.
        passed_s: Time between both, s.

    Source: Rodrigues' formula for the turn by −ω t.
    """
    wx, wy, wz = (-0.5 * passed_s * (a + b) for a, b in zip(before_radps, after_radps, strict=True))
    angle = math.sqrt(wx * wx + wy * wy + wz * wz)
    sine = math.sin(angle) / angle if angle > 1e-9 else 1.0
    bend = 0.5 * (math.sin(0.5 * angle) / (0.5 * angle)) ** 2 if angle > 1e-9 else 0.5
    x, y, z = vector
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    dx, dy, dz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
    return x + sine * cx + bend * dx, y + sine * cy + bend * dy, z + sine * cz + bend * dz


def felt_at(place_m: Array, motions: Array) -> Array:
    """Return the specific force at a place of a gripper that turns: γ − α × r − ω × (ω × r), shape (n, 3), m/s².

    Args:
        place_m: The place r from the origin of the gripper frame, shape (3,).
        motions: Gravity minus acceleration, angular velocity and angular acceleration, shape (n, 9).
    """
    x, y, z = place_m
    turning, crossed = motions[:, 3:6], np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))  # α @ crossed is α × r
    inward = turning * (turning @ place_m)[:, None] - np.outer((turning**2).sum(axis=1), place_m)
    found: Array = motions[:, :3] - motions[:, 6:9] @ crossed - inward
    return found
