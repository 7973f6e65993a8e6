"""Transform from the frame and sign of the force sensor to the force on the finger in the pad frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.types.arrays import Array, cross_matrix


class Mounting:
    """Mounting of a force sensor behind its pad.

    Args:
        xyz_m: Position of the sensor's origin in the pad frame, shape (3,), m.
        quat_xyzw: Rotation that takes sensor coordinates to pad coordinates, as a unit quaternion (x, y, z, w).
        sign: +1 if the sensor reports the load on the finger, −1 if it reports the load by the finger.

    Attributes:
        matrix: Transforms (F, M) of the sensor, N and N·m about its origin, to (F, M) on the finger in the pad frame,
            about the pad's origin: F = s R F_sensor, M = s (R M_sensor + r × R F_sensor). Shape (6, 6); read-only.

    Raises:
        ValueError: Values are not finite, the quaternion is zero, or the sign is not ±1.
    """

    def __init__(
        self,
        xyz_m: Sequence[float] = (0.0, 0.0, 0.0),
        quat_xyzw: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
        sign: int = 1,
    ) -> None:
        if sign not in (1, -1):
            raise ValueError(f"sign must be +1 or -1, got {sign}")
        largest = max(map(abs, quat_xyzw))
        if not all(map(math.isfinite, (*xyz_m, *quat_xyzw))) or largest == 0.0:
            raise ValueError("xyz_m and quat_xyzw must be finite, and the quaternion not zero")
        quaternion = np.array(quat_xyzw, dtype=np.float64) / largest  # its squares neither underflow nor overflow
        rotation = Rotation.from_quat(quaternion).as_matrix()
        turned_lever = cross_matrix(xyz_m) @ rotation
        self.matrix: Array = sign * np.block([[rotation, np.zeros((3, 3))], [turned_lever, rotation]])
        self.matrix.flags.writeable = False
