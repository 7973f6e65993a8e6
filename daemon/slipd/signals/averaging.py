"""The mean of readings that may be bad: what is no number stays out, and what comes out is never denormal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: No device counts or measures further (a count has at most 32 bits), and sums of squares stay finite far beyond.
LARGEST_READING = 1e12
#: Far below the resolution of any device in any of its units. Arithmetic on denormals is ten times slower.
LEAST_VALUE = 1e-30
#: Readings that spread by more than this many times the stated noise moved: motors and mains stay below.
MOVING_FACTOR = 5.0


def flushed(values: Array) -> Array:
    """A copy of ``values`` (any shape) in which all that is as good as zero is zero."""
    return np.where(np.abs(values) < LEAST_VALUE, 0.0, values)


def most_std(noise: Array) -> Array:
    """How far readings that are still spread at most, each component; ``noise`` is stated, 0 where it is not."""
    return np.where(noise > 0.0, MOVING_FACTOR * noise, np.inf)


class Average:
    """Mean and spread of readings that come one by one.

    Args:
        shape: Shape of a reading.

    Attributes:
        count: Readings taken.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.count = 0
        self._first = np.zeros(shape)
        self._sum = np.zeros(shape)
        self._squares = np.zeros(shape)

    def add(self, values: Array) -> None:
        """Takes a reading; one with a component that is not finite, or impossibly large, is passed over."""
        if not (np.abs(values) <= LARGEST_READING).all():
            return
        if self.count == 0:
            self._first = values.copy()
        beside = values - self._first  # small beside a large offset, so that the squares keep their digits
        self._sum += beside
        self._squares += beside * beside
        self.count += 1

    @property
    def mean(self) -> Array:
        """Mean of the readings taken; at least one was."""
        return flushed(self._first + self._sum / self.count)

    @property
    def std(self) -> Array:
        """Standard deviation of one reading, each component; at least two were taken."""
        scatter = self._squares - self._sum * self._sum / self.count
        return flushed(np.sqrt(np.maximum(scatter, 0.0) / (self.count - 1)))
