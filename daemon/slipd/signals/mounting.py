"""From the force sensor's own frame and sign to the force on the finger in the pad frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


class Mounting:
    """How a force sensor sits behind its pad.

    Args:
        xyz_m: Position of the sensor's origin in the pad frame, shape (3,), m.
        quat_xyzw: Rotation that takes sensor coordinates to pad coordinates, as a unit quaternion (x, y, z, w).
        sign: +1 where the sensor reports the load on the finger, −1 where it reports the load by it.

    Raises:
        ValueError: Values that are not finite, a quaternion of length 0, a sign other than ±1.
    """

    def __init__(
        self,
        xyz_m: Sequence[float] = (0.0, 0.0, 0.0),
        quat_xyzw: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
        sign: int = 1,
    ) -> None:
        if sign not in (1, -1):
            raise ValueError(f"sign must be +1 or -1, not {sign}")
        if not all(map(math.isfinite, (*xyz_m, *quat_xyzw))) or not math.hypot(*quat_xyzw) > 0.0:
            raise ValueError("xyz_m and quat_xyzw must be finite, and the quaternion not zero")
        rotation = Rotation.from_quat(np.asarray(quat_xyzw, dtype=np.float64)).as_matrix()
        x, y, z = xyz_m
        lever = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))  # r × F as a matrix
        self._force = sign * rotation
        self._torque = sign * np.hstack((lever @ rotation, rotation))

    def to_pad(self, force_n: Array, torque_nm: Array) -> tuple[Array, Array]:
        """Moves a wrench to the pad frame: F = s R F_sensor, M = s (R M_sensor + r × R F_sensor).

        Args:
            force_n: Force in the sensor frame, shape (3,), N.
            torque_nm: Torque about the sensor's origin, shape (3,), N·m.

        Returns:
            Force on the finger (3,), N, and torque about the pad's origin (3,), N·m, both in the pad frame; what is
            infinite makes NaN of what it enters.
        """
        with np.errstate(invalid="ignore"):
            return self._force @ force_n, self._torque @ np.concatenate((force_n, torque_nm))
