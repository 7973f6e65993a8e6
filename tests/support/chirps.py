"""Numbers that look like noise and are the same on every machine, for tests of digits."""

from __future__ import annotations

import math

import numpy as np

from slipd.types.arrays import Array


def chirp(*shape: int, turn: float = 0.37) -> Array:
    """Return the sine of an angle that grows with the square of the number of each value."""
    return np.sin(turn * np.arange(float(math.prod(shape))) ** 2).reshape(shape)
