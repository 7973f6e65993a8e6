"""Mean and spread of readings: readings that are not finite are ignored, and results are never denormal."""

from __future__ import annotations

import numpy as np

from slipd.types.arrays import Array

LARGEST_READING = 1e12
"""No device reports more (a count has at most 32 bits), and sums of squares stay finite far beyond it."""
LEAST_VALUE = 1e-30
"""Far below the resolution of any device in any unit. Arithmetic on denormals is ten times slower."""
MOVING_FACTOR = 5.0
"""Readings whose spread exceeds this multiple of the stated noise have moved; motors and mains hum stay below."""


def flushed(values: Array) -> Array:
    """Return a copy of ``values`` (any shape) with magnitudes below `LEAST_VALUE` set to zero."""
    return np.where(np.abs(values) < LEAST_VALUE, 0.0, values)


def most_std(noise: Array) -> Array:
    """Return the largest standard deviation at rest, by component, from the stated ``noise``; 0 means not stated."""
    return np.where(noise > 0.0, MOVING_FACTOR * noise, np.inf)


class Average:
    """Running mean and standard deviation.

    Args:
        shape: Shape of a reading.

    Attributes:
        count: Number of readings.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.count = 0
        self._first = np.zeros(shape)
        self._sum = np.zeros(shape)
        self._squares = np.zeros(shape)

    def add(self, values: Array) -> None:
        """Add a reading; ignore it if a component is not finite or impossibly large."""
        if not (np.abs(values) <= LARGEST_READING).all():
            return
        if self.count == 0:
            self._first = values.copy()
        beside = values - self._first  # small compared to a large offset, so that the squares keep their digits
        self._sum += beside
        self._squares += beside * beside
        self.count += 1

    @property
    def mean(self) -> Array:
        """Mean of the readings, of which there must be at least one."""
        return flushed(self._first + self._sum / self.count)

    @property
    def std(self) -> Array:
        """Standard deviation of one reading, by component; there must be at least two readings."""
        scatter = self._squares - self._sum * self._sum / self.count
        return flushed(np.sqrt(np.maximum(scatter, 0.0) / (self.count - 1)))
