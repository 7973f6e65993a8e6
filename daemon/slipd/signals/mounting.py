"""Transform from the frame and sign of the force sensor to the force on the finger in the pad frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slipd.types.arrays import Array, cross_matrix, rotation_matrix


def mounting_matrix(xyz_m: Sequence[float], quat_xyzw: Sequence[float], sign: int = 1) -> Array:
    """Return the matrix of a force sensor's mounting behind its pad, shape (6, 6).

    It transforms (F, M) of the sensor, N and N·m about its origin, to (F, M) on the finger in the pad frame, about the
    pad's origin: F = s R F_sensor, M = s (R M_sensor + r × R F_sensor).

    Args:
        xyz_m: Position r of the sensor's origin in the pad frame, shape (3,), m.
        quat_xyzw: Rotation R that takes sensor coordinates to pad coordinates, a quaternion (x, y, z, w) of any length
            above 0.
        sign: s: +1 if the sensor reports the load on the finger, −1 if it reports the load by the finger.
    """
    largest = max(map(abs, quat_xyzw))
    rotation = rotation_matrix([part / largest for part in quat_xyzw])  # squares neither underflow nor overflow
    turned_lever = cross_matrix(xyz_m) @ rotation
    matrix: Array = sign * np.block([[rotation, np.zeros((3, 3))], [turned_lever, rotation]])
    return matrix
