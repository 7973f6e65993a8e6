"""Tare that is explicit, readable and reversible: what was subtracted, when, by whom, and how still it was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.signals.averaging import MOVING_FACTOR, Average, most_std

Array = NDArray[np.float64]

#: Fewer readings than this make a mean that is noise.
MIN_READINGS = 8
#: Who gave the offset that no tare gave.
BY_CONFIG = "config"


@dataclass(frozen=True, slots=True, eq=False)
class Offset:
    """What is subtracted.

    Attributes:
        id: Counts the tares of this stream; 0 is the offset of the config.
        value: Offset in the sensor's own units and frame.
        t_ns: When it was taken; None for the offset of the config.
        readings: How many readings it is the mean of.
        by: Who asked for it; "config" for the offset of the config.
        std: Standard deviation of one of those readings, shape of ``value``; None for the offset of the config.
        gravity_mps2: Apparent gravity in the pad frame where it was taken, shape (3,): the weight there is part of
            the offset. Zeros where no weight is part of it, as in the offset of the config; None: not known.
    """

    id: int
    value: Array
    t_ns: int | None
    readings: int
    by: str
    std: Array | None
    gravity_mps2: Array | None


class Tare:
    """The offset of one stream.

    Args:
        initial: Offset to begin with, any shape; readings must have that shape.
        noise: Stated standard deviation of a reading, each component, shape of ``initial``; 0: not stated. A tare in
            which a component spreads over ``MOVING_FACTOR`` times wider is given up; what presses for less than half
            of one that is taken has moved its offset by less than that. None: not stated at all.

    Attributes:
        current: The offset in force.
        aborted_reason: Why the newest tare was given up, for people; "" where it was not.

    Raises:
        ValueError: A noise that is negative or not finite, or of another shape than the offset.
    """

    def __init__(self, initial: Array, noise: Array | None = None) -> None:
        value = np.array(initial, dtype=np.float64)
        self.current = Offset(0, value, None, 0, BY_CONFIG, None, np.zeros(3))
        self.aborted_reason = ""
        stated = np.zeros_like(value) if noise is None else np.array(noise, dtype=np.float64)
        if stated.shape != value.shape or not ((stated >= 0.0) & np.isfinite(stated)).all():
            raise ValueError(f"noise must be finite, not negative, and of shape {value.shape}; it is {noise}")
        self._most_std = most_std(stated)
        self._before: Offset | None = None
        self._taken = 0
        self._until_ns: int | None = None
        self._by = ""
        self._gravity: Array | None = None
        self._average = Average(value.shape)

    @property
    def busy(self) -> bool:
        """A tare is being measured."""
        return self._until_ns is not None

    def begin(self, t_ns: int, seconds: float, by: str = "", gravity_mps2: Array | None = None) -> None:
        """Starts to average readings for ``seconds``; the offset in force stays until then.

        Args:
            t_ns: Now.
            seconds: How long, s.
            by: Who asks for it.
            gravity_mps2: Apparent gravity in the pad frame, shape (3,); None where it is not known. A finger that is
                turned meanwhile moves its readings.
        """
        self._until_ns = t_ns + round(seconds * 1e9)
        self._by, self._gravity = by, gravity_mps2
        self._average = Average(self.current.value.shape)
        self.aborted_reason = ""

    def abort(self, reason: str = "given up") -> None:
        """Gives up a measurement for a reason that people can read; the offset in force stays."""
        if self._until_ns is not None:
            self._until_ns = None
            self.aborted_reason = reason

    def undo(self) -> bool:
        """Gives up a measurement that runs, else puts the offset before the last tare back in force.

        Returns:
            False where there is nothing to undo: it goes one step back, not two, and never forward again.
        """
        if self.busy:
            self.abort("undone before it was taken")
            return True
        if self._before is None:
            return False
        self.current, self._before = self._before, None
        return True

    def apply(self, values: Array, t_ns: int, *, trusted: bool = True) -> Array:
        """Subtracts the offset in force, and takes a trusted reading into a tare that is being measured."""
        if self._until_ns is not None and trusted:
            self._measure(values, t_ns, self._until_ns)
        return values - self.current.value

    def _measure(self, values: Array, t_ns: int, until_ns: int) -> None:
        average = self._average
        average.add(values)
        if t_ns < until_ns or average.count < MIN_READINGS:
            return
        std = average.std
        if (std > self._most_std).any():
            self.abort(self._moved(std))
            return
        self._taken += 1
        self._before = self.current
        self.current = Offset(self._taken, average.mean, t_ns, average.count, self._by, std, self._gravity)
        self._until_ns = None

    def _moved(self, std: Array) -> str:
        worst = np.unravel_index(np.argmax(std / self._most_std), std.shape)
        noise = self._most_std[worst] / MOVING_FACTOR
        place = ", ".join(map(str, worst))
        return (
            f"the readings moved: component {place} spreads by {std[worst]:.3g}, its noise is {noise:.3g}; hold still"
        )
