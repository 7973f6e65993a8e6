"""Rotations and vectors as tuples, for a client that loads no NumPy.

A quaternion x, y, z, w is the orientation of a frame in another one: it takes coordinates of the first to the second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from slipd_client.errors import CallError

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)

STANDARD_GRAVITY_MPS2 = 9.80665
STANDARD_DOWN: Vector = (0.0, 0.0, -STANDARD_GRAVITY_MPS2)
"""Gravity in a frame whose Z points up."""

UNIT_TOLERANCE = 0.01
"""Largest difference of the length of a unit quaternion from 1."""


def unit(rotation: Sequence[float], what: str) -> Quaternion:
    """Return a rotation with length 1.

    Raises:
        CallError: Its length is not near 1; the text begins with ``what``.
    """
    length = math.hypot(*rotation)
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise CallError(f"{what} must be a unit quaternion x y z w, got one of length {length:.4g}")
    x, y, z, w = (number / length for number in rotation)
    return x, y, z, w


def product(one: Sequence[float], other: Sequence[float]) -> Quaternion:
    """Return the rotation that first does ``other``, then ``one``."""
    (ax, ay, az, aw), (bx, by, bz, bw) = one, other
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(rotation: Sequence[float]) -> Quaternion:
    """Return the inverse of a rotation."""
    x, y, z, w = rotation
    return -x, -y, -z, w


def rotated(rotation: Sequence[float], vector: Sequence[float]) -> Vector:
    """Return a vector of the rotated frame in the frame in which it is rotated."""
    x, y, z, _ = product(product(rotation, (*vector, 0.0)), conjugate(rotation))
    return x, y, z


def rotation_vector(rotation: Quaternion) -> Vector:
    """Return axis times angle of a rotation, rad, for angles up to half a turn."""
    x, y, z, w = rotation
    sine = math.sqrt(x * x + y * y + z * z)
    angle = 2.0 * math.atan2(math.copysign(sine, w), abs(w))
    scale = angle / sine if sine > 1e-12 else math.copysign(2.0, w)
    return scale * x, scale * y, scale * z


def of_rotation_vector(turn: Vector) -> Quaternion:
    """Return the rotation with this axis times angle, rad."""
    angle = math.sqrt(sum(each * each for each in turn))
    scale = math.sin(angle / 2.0) / angle if angle > 1e-12 else 0.5
    return scale * turn[0], scale * turn[1], scale * turn[2], math.cos(angle / 2.0)


def plus(one: Sequence[float], other: Sequence[float]) -> Vector:
    """Return the sum of two vectors."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def cross(one: Sequence[float], other: Sequence[float]) -> Vector:
    """Return the cross product of two vectors."""
    (ax, ay, az), (bx, by, bz) = one, other
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
