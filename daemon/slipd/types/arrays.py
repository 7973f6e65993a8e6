"""Array types that every room shares, and numbers that may not be known."""

from __future__ import annotations

import math
from collections.abc import Sequence

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


def cross_matrix(vector: Sequence[float] | Array) -> Array:
    """Return the matrix of ``vector ×``, shape (3, 3)."""
    x, y, z = vector
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def flushed(values: Array) -> Array:
    """Return a copy of ``values`` (any shape) with magnitudes below `LEAST_VALUE` set to zero."""
    return np.where(np.abs(values) < LEAST_VALUE, 0.0, values)
