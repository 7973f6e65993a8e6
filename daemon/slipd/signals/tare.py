"""Tares: explicit, logged and reversible offsets, with time, author and noise.

Means and spreads ignore readings that are not finite, and are never denormal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from slipd.types.arrays import Array, flushed
from slipd_client.messages import TareReason

LARGEST_READING = 1e12
"""No device reports more (a count has at most 32 bits), and sums of squares stay finite far beyond it."""
MOVING_FACTOR = 5.0
"""Readings whose spread exceeds this multiple of the stated noise have moved; motors and mains hum stay below."""


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


MIN_READINGS = 8
"""Least number of readings of a tare."""
BY_CONFIG = "config"
"""Author of the offset that comes from the config."""
Origin = Literal["config", "observed", "measured", "stored"]
"""Where an offset comes from: the config, the same while the pad was seen to be free, a tare of this run, or an earlier
run."""
_TEXTS: dict[TareReason, str] = {
    "contact": "a contact began",
    "pulled": "the normal force became negative, as if the pad were pulled",
    "moved": "the readings moved",
    "turned": "the finger was turned",
    "silent": "the stream fell silent",
    "ended": "the stream ended",
    "undone": "undone before it was taken",
}
"""Text for each reason to abort a tare."""


@dataclass(frozen=True, slots=True, eq=False)
class Offset:
    """An offset that is subtracted from readings.

    Attributes:
        id: Number of the tare of this stream; 0 is the offset of the config.
        value: Offset in the units and frame of the sensor.
        t_ns: Time of the tare, CLOCK_MONOTONIC (negative before the host started); None for the offset of the config.
        readings: Number of averaged readings.
        by: Client that requested it; "config" for the offset of the config.
        std: Standard deviation of a single reading, shape of ``value``; None for the offset of the config.
        gravity_mps2: Apparent gravity in the pad frame at the tare, shape (3,): the weight in that pose is part of the
            offset. Zeros if the offset holds no weight, as that of the config; None if not known.
        origin: Where it comes from.
    """

    id: int
    value: Array
    t_ns: int | None
    readings: int
    by: str
    std: Array | None
    gravity_mps2: Array | None
    origin: Origin = "measured"

    def age_s(self, t_ns: int) -> float | None:
        """Return its age at ``t_ns``, s; None for the offset of the config."""
        return None if self.t_ns is None else (t_ns - self.t_ns) * 1e-9


class Tare:
    """Offset of one stream.

    Args:
        initial: Initial offset, any shape; readings must have the same shape.
        noise: Stated standard deviation of a reading, by component, shape of ``initial``; 0 or None: not stated. A tare
            is aborted if a component spreads over ``MOVING_FACTOR`` times wider; a press during less than half of an
            accepted tare has moved its offset by less than that.

    Attributes:
        current: The offset in force.
        known: The zero is known by a tare, or because the pad was seen to be free. An offset that the config states
            does not count here; see `slipd.finger.pad_zero`.
        busy: A tare is running.
        on_change: Called after each change of these three, in this order, with the offset now and the one before.
        aborted_reason: Why the newest tare was aborted; None if it was not.
        aborted_text: The same for people, or "".
    """

    def __init__(self, initial: Array, noise: Array | None = None) -> None:
        value = np.array(initial, dtype=np.float64)
        self.current = Offset(0, value, None, 0, BY_CONFIG, None, np.zeros(3), "config")
        self.known = self.busy = False
        self.on_change: list[Callable[[Offset, Offset], None]] = []
        self.aborted_reason: TareReason | None = None
        self.aborted_text = ""
        stated = np.zeros_like(value) if noise is None else np.array(noise, dtype=np.float64)
        self._most_std = most_std(stated)
        self._before: Offset | None = None
        self._count = 0  # the newest id
        self._until_ns = 0
        self._by = ""
        self._gravity: Array | None = None
        self._average = Average(value.shape)

    @property
    def origin(self) -> Origin | None:
        """Where the zero comes from; None: it is not known."""
        return self.current.origin if self.known else None

    def begin(self, t_ns: int, seconds: float, by: str = "", gravity_mps2: Array | None = None) -> None:
        """Start to average readings for ``seconds``; until then the offset in force stays.

        Args:
            t_ns: Now.
            seconds: Averaging time, s.
            by: Client that requests it.
            gravity_mps2: Apparent gravity in the pad frame, shape (3,); None if not known. The finger must not turn
                meanwhile.
        """
        self._until_ns = t_ns + round(seconds * 1e9)
        self._by, self._gravity = by, gravity_mps2
        self._average = Average(self.current.value.shape)
        self.aborted_reason, self.aborted_text = None, ""
        self._set_busy(busy=True)

    def abort(self, reason: TareReason, text: str = "") -> None:
        """Abort a running tare; the offset in force stays.

        Args:
            reason: Why.
            text: The same for people; by default the text of the reason.
        """
        if self.busy:
            self.aborted_reason, self.aborted_text = reason, text or _TEXTS[reason]
            self._set_busy(busy=False)

    def undo(self) -> bool:
        """Abort a running tare, or else restore the offset before the last tare.

        Returns:
            False if there is nothing to undo: only one step back is possible, and no step forward.
        """
        if self.busy:
            self.abort("undone")
            return True
        if self._before is None:
            return False
        before, self._before = self._before, None
        self.put(before)
        return True

    def restore(self, offset: Offset) -> None:
        """Put the offset of an earlier run in force; the present one is that before it."""
        self._count, self._before = offset.id, self.current
        self.put(offset)

    def observe(self, t_ns: int) -> None:
        """Record that the offset in force was right at ``t_ns``: the sensor was free, and read nothing."""
        self.put(replace(self.current, origin="observed", t_ns=t_ns))

    def reject(self, text: str) -> None:
        """Forget the offset of an earlier run, because the readings contradict it; ``text``: how, for people."""
        if self.current.origin == "stored" and self._before is not None:
            self.aborted_text = f"the stored zero does not fit: {text}"
            before, self._before = self._before, None
            self.put(before)

    def put(self, offset: Offset) -> None:
        """Put an offset in force, beside a tare that may be running."""
        before, self.current, self.known = self.current, offset, offset.origin != "config"
        self._notify(before)

    def _set_busy(self, *, busy: bool) -> None:
        self.busy = busy
        self._notify(self.current)

    def _notify(self, before: Offset) -> None:
        for notify in self.on_change:
            notify(self.current, before)

    def apply(self, values: Array, t_ns: int, *, trusted: bool = True) -> Array:
        """Subtract the offset in force; a running tare averages the reading if it is trusted."""
        if self.busy and trusted:
            self._measure(values, t_ns)
        return values - self.current.value

    def _measure(self, values: Array, t_ns: int) -> None:
        average = self._average
        average.add(values)
        if t_ns < self._until_ns or average.count < MIN_READINGS:
            return
        std = average.std
        if (std > self._most_std).any():
            self.abort("moved", self._moved(std))
            return
        self._count += 1
        self._before, self.busy = self.current, False
        self.put(Offset(self._count, average.mean, t_ns, average.count, self._by, std, self._gravity))

    def _moved(self, std: Array) -> str:
        worst = np.unravel_index(np.argmax(std / self._most_std), std.shape)
        noise = self._most_std[worst] / MOVING_FACTOR
        place = ", ".join(map(str, worst))
        return (
            f"the readings moved: component {place} spreads by {std[worst]:.3g}, its noise is {noise:.3g}; hold still"
        )
