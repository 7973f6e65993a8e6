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


def flushed(values: Array) -> Array:
    """Return a copy of ``values`` (any shape) with magnitudes below `LEAST_VALUE` set to zero."""
    return np.where(np.abs(values) < LEAST_VALUE, 0.0, values)
