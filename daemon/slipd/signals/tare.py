"""Tare that is explicit, readable and reversible: what was subtracted, when, and since when it holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Fewer readings than this make a mean that is noise.
MIN_READINGS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Offset:
    """What is subtracted.

    Attributes:
        id: Counts the tares of this stream; 0 is the offset of the config.
        value: Offset in the sensor's own units and frame.
        t_ns: When it was taken; None for the offset of the config.
        readings: How many readings it is the mean of.
    """

    id: int
    value: Array
    t_ns: int | None
    readings: int


class Tare:
    """The offset of one stream.

    Args:
        initial: Offset to begin with, any shape; readings must have that shape.
    """

    def __init__(self, initial: Array) -> None:
        self.current = Offset(0, np.array(initial, dtype=np.float64), None, 0)
        self._before: Offset | None = None
        self._taken = 0
        self._until_ns: int | None = None
        self._sum = np.zeros_like(self.current.value)
        self._count = 0

    @property
    def busy(self) -> bool:
        """A tare is being measured."""
        return self._until_ns is not None

    def begin(self, t_ns: int, seconds: float) -> None:
        """Starts to average readings for ``seconds``; the offset in force stays until then."""
        self._until_ns = t_ns + round(seconds * 1e9)
        self._sum[...] = 0.0
        self._count = 0

    def abort(self) -> None:
        """Gives up a measurement; the offset in force stays."""
        self._until_ns = None

    def undo(self) -> bool:
        """Puts the offset before the last tare back in force; False where there is none."""
        if self._before is None:
            return False
        self.current, self._before = self._before, None
        return True

    def apply(self, values: Array, t_ns: int, *, trusted: bool = True) -> Array:
        """Subtracts the offset in force, and takes a trusted reading into a tare that is being measured."""
        if self._until_ns is not None and trusted:
            self._measure(values, t_ns)
        return values - self.current.value

    def _measure(self, values: Array, t_ns: int) -> None:
        if np.isfinite(values).all():
            self._sum += values
            self._count += 1
        if self._until_ns is not None and t_ns >= self._until_ns and self._count >= MIN_READINGS:
            self._taken += 1
            self._before = self.current
            self.current = Offset(self._taken, self._sum / self._count, t_ns, self._count)
            self._until_ns = None
