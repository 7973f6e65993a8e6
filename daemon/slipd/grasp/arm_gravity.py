"""Which way gravity points in the gripper frame, by the motion of the arm."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slipd.signals.gravity import STANDARD_GRAVITY_MPS2
from slipd.types.samples import ArmSample

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
    """Follows gravity: the mean of the apparent gravity, turned along with the angular velocity of the gripper.

    Attributes:
        apparent_mps2: Apparent gravity at the last reading: gravity minus the acceleration of the gripper, m/s².
        velocity_radps: Angular velocity then.
        acceleration_radps2: Angular acceleration then; zeros where it is not reported.
    """

    def __init__(self) -> None:
        self.apparent_mps2: Sequence[float] = (0.0, 0.0, 0.0)
        self.velocity_radps: Sequence[float] = (0.0, 0.0, 0.0)
        self.acceleration_radps2: Sequence[float] = (0.0, 0.0, 0.0)
        self._mean: Triple = (0.0, 0.0, 0.0)
        self._seen_s, self._t_ns = 0.0, 0

    def update(self, sample: ArmSample, t_ns: int) -> None:
        """Follow a reading of ``t_ns``, whose values are finite; ignore one of the same time as the one before."""
        if t_ns == self._t_ns:
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
        self._t_ns, self.apparent_mps2, self.velocity_radps = t_ns, sample.gravity_mps2, sample.angular_velocity_radps
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
