"""Compensate the slow drift of a sensor's zero while nothing touches it; freeze whenever something may.

A filter that follows the readings themselves forgets a held object within its time constant. This one learns only from
readings that are known to be free of contact, and only after a delay: a contact is detected late, and the readings
before its detection must not be learned. The part of a slow press that it can mistake for drift is bounded.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from slipd.signals.tare import LARGEST_READING
from slipd.types.arrays import Array, flushed

BLOCK_NS = 100_000_000
"""Readings are averaged over blocks before they are learned: whole periods of 50, 60 and 100 Hz cancel mains hum."""
LOOK_BACK_BLOCKS = 20
"""Blocks wait for 2 s before they are learned, and are dropped if a contact is detected meanwhile: a press that is
detected within that time loses nothing."""
HOLD_OFF_NS = 2_000_000_000
"""Wait after a contact: a released pad creeps back for seconds, and a hand that lets go still trembles."""
LONGEST_GAP_NS = 1_000_000_000
"""After a longer gap it is not known what touched the finger meanwhile."""
FULL_SWING_S = 600.0
"""Least time for the whole limit, s. With a limit of 1 N the baseline moves by at most 1.7 mN/s: ten times a drift of
0.5 N an hour, and a hundredth of a press of 0.2 N/s."""


class DriftCompensation:
    """The drift of one stream since its tare.

    What a press may lose: let r = limit / 600 s be the fastest rate of the baseline. A press that rises by v N/s and is
    detected at F N has raised the baseline by at most r F / (v − r) − 2 s · r (or nothing). With a limit of 1 N and
    F = 0.3 N, a press of 0.15 N/s or faster loses nothing, and one of 0.05 N/s at most 7 mN. A press slower than r is
    not detected before the limit is reached: the loss never exceeds the limit, and only another sensor can detect it.

    Args:
        tau_s: Time constant with which the baseline follows, s.
        limit: Largest compensation since the tare, by component, shape (n,), in the unit of the readings.

    Attributes:
        value: Drift to subtract, shape (n,); a new array each time it changes.
        frozen: Nothing is learned: there is or may be contact, or it ended too recently.
    """

    def __init__(self, tau_s: float, limit: Array) -> None:
        self._limit = limit
        block_s = BLOCK_NS * 1e-9
        self._share = -math.expm1(-block_s / tau_s)
        self._most = self._limit * (block_s / FULL_SWING_S)
        self.value = np.zeros_like(self._limit)
        self._before = self.value
        self.frozen = True
        self._resume_ns = 0
        self._last_ns: int | None = None
        self._waiting: deque[Array] = deque()
        self._sum = np.zeros_like(self._limit)
        self._count = 0
        self._block_end_ns = 0

    @property
    def total(self) -> float:
        """Fraction of the limit used since the tare, 0 to 1; at 1 the drift is followed no further."""
        return float((np.abs(self.value) / self._limit).max())

    def update(self, values: Array, t_ns: int, free: bool | None) -> None:
        """Update with a reading.

        Args:
            values: The reading without the drift correction, shape (n,); one that is not finite is ignored.
            t_ns: Time of the reading. A step back, or a gap of more than a second, counts as a contact.
            free: True if something other than this reading shows that nothing touches the finger; False in contact;
                None if not known.
        """
        last_ns, self._last_ns = self._last_ns, t_ns
        if not free or last_ns is None or not 0 <= t_ns - last_ns <= LONGEST_GAP_NS:
            self._freeze(t_ns)
            return
        if self.frozen:
            if t_ns < self._resume_ns:
                return
            self.frozen = False
            self._block_end_ns = t_ns + BLOCK_NS
        if math.hypot(*values.tolist()) <= LARGEST_READING:  # false for NaN and infinity
            self._sum += values
            self._count += 1
        if t_ns >= self._block_end_ns:
            self._close_block(t_ns)

    def reset(self) -> None:
        """Restart from zero after a tare."""
        self._before, self.value = self.value, np.zeros_like(self._limit)
        self._drop()

    def restore(self) -> None:
        """Restore the drift before the last tare, because the tare was undone."""
        self.value = self._before
        self._drop()

    def _freeze(self, t_ns: int) -> None:
        self._resume_ns = t_ns + HOLD_OFF_NS
        if not self.frozen:
            self.frozen = True
            self._drop()

    def _drop(self) -> None:
        self._waiting.clear()
        self._sum[:] = 0.0
        self._count = 0

    def _close_block(self, t_ns: int) -> None:
        self._block_end_ns = t_ns + BLOCK_NS
        if self._count == 0:
            return
        self._waiting.append(self._sum / self._count)
        self._sum[:] = 0.0
        self._count = 0
        if len(self._waiting) > LOOK_BACK_BLOCKS:
            step = np.clip(self._share * (self._waiting.popleft() - self.value), -self._most, self._most)
            self.value = flushed(np.clip(self.value + step, -self._limit, self._limit))
