"""Array types that every room shares, and numbers that may not be known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

LEAST_VALUE = 1e-30
"""Far below the resolution of any device in any unit. Arithmetic on denormals is ten times slower."""


def finite_or_none(value: float | None) -> float | None:
    """Return a finite number as a float; None for NaN, an infinity, or None."""
    return None if value is None or not math.isfinite(value) else float(value)


def finite_list(values: Array | None) -> list[float] | None:
    """Return an array, shape (n,), as a list; None for None, and where a number is not finite."""
    if values is None:
        return None
    numbers: list[float] = values.tolist()
    return numbers if all(map(math.isfinite, numbers)) else None


def finite_fields(fields: dict[str, Any]) -> dict[str, Any]:
    """Set each field to None that is a float, or a list of floats, and not finite; return the same fields."""
    for name, value in fields.items():
        if isinstance(value, float):
            if not math.isfinite(value):
                fields[name] = None
        elif type(value) is list and value and isinstance(value[0], float) and not all(map(math.isfinite, value)):
            fields[name] = None
    return fields


def cross_matrix(vector: Sequence[float] | Array) -> Array:
    """Return the matrix of ``vector ×``, shape (3, 3)."""
    x, y, z = vector
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def rotation_matrix(quat_xyzw: Sequence[float]) -> Array:
    """Return the matrix of a rotation, shape (3, 3), to the last bit as SciPy's `Rotation` does.

    Importing that class would add 8 % to the time in which the daemon starts, and to its memory (11 MB).

    Args:
        quat_xyzw: The rotation as a quaternion, not zero, of any length.
    """
    x, y, z, w = quat_xyzw
    length = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / length, y / length, z / length, w / length
    x2, y2, z2, w2 = x * x, y * y, z * z, w * w
    return np.array(
        (
            (x2 - y2 - z2 + w2, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
            (2.0 * (x * y + z * w), -x2 + y2 - z2 + w2, 2.0 * (y * z - x * w)),
            (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -x2 - y2 + z2 + w2),
        )
    )


def flushed(values: Array) -> Array:
    """Return a copy of ``values`` (any shape) with magnitudes below `LEAST_VALUE` set to zero."""
    return np.where(np.abs(values) < LEAST_VALUE, 0.0, values)
