"""Follows the slow drift of a sensor's zero while nothing touches it, and holds still whenever something may.

A filter that follows the reading itself forgets a held object within its time constant. This one learns only from
readings that are known to be free of contact, and only from those that are long over: a contact that begins is noticed
late, and what came before the notice must not be learned. How much of a slow press it can take for drift is bounded.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from slipd.signals.averaging import LARGEST_READING, flushed

Array = NDArray[np.float64]

#: Readings are learned in means over this long: whole periods of 50, 60 and 100 Hz, so that the mains cancel.
BLOCK_NS = 100_000_000
#: Blocks wait for 2 s before they are learned, and are dropped when a contact is noticed meanwhile: a press that is
#: noticed within that time of its first touch loses nothing.
LOOK_BACK_BLOCKS = 20
#: A pad that was pressed creeps back for seconds, and a hand that let go still trembles: not the sensor's own zero.
HOLD_OFF_NS = 2_000_000_000
#: Over a longer silence nobody knows what touched the finger.
LONGEST_GAP_NS = 1_000_000_000
#: The whole limit takes at least this long, s. With a limit of 1 N that is 1.7 mN/s: ten times a drift of 0.5 N in an
#: hour, and a hundredth of a press of 0.2 N/s.
FULL_SWING_S = 600.0


class DriftCompensation:
    """The drift of one stream since its tare.

    What a press may lose: one that rises by v N/s and is noticed at F N has raised the baseline by at most
    r F / (v − r) − 2 s · r (or nothing), r = limit / 600 s being the fastest that the baseline moves. With a limit of
    1 N and F = 0.3 N, a press of 0.15 N/s or faster loses nothing and one of 0.05 N/s at most 7 mN. One slower than r
    hides for longer than the limit takes: what is lost never exceeds the limit, and only a witness other than the
    force can tell.

    Args:
        tau_s: Time constant with which the baseline follows, s.
        limit: Most that is compensated since the tare, each component, shape (n,), in the unit of the readings.

    Attributes:
        value: What is to be subtracted, shape (n,); a new array each time it changes.
        frozen: Nothing is learned: there is contact, or there may be, or it is not over long enough.

    Raises:
        ValueError: A time constant or a limit that is not positive and finite.
    """

    def __init__(self, tau_s: float, limit: Array) -> None:
        if not 0.0 < tau_s < math.inf:
            raise ValueError(f"tau_s must be positive and finite, not {tau_s}")
        self._limit = np.array(limit, dtype=np.float64)
        if self._limit.ndim != 1 or not ((self._limit > 0.0) & np.isfinite(self._limit)).all():
            raise ValueError(f"limit must be positive and finite, one for each component, not {limit}")
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
        """Share of the limit that is used up since the tare, 0 to 1; at 1 it follows no further."""
        return float((np.abs(self.value) / self._limit).max())

    def update(self, values: Array, t_ns: int, free: bool | None) -> None:
        """Takes a reading from which everything but `value` was subtracted, shape (n,).

        Args:
            values: The reading; one that is no number is passed over.
            t_ns: When it was taken. A time that falls, or leaves out more than a second, is as good as a contact.
            free: Something other than this reading says that nothing touches: True. Contact: False. None: unknown.
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
        """A tare was taken: the drift counts from here."""
        self._before, self.value = self.value, np.zeros_like(self._limit)
        self._drop()

    def restore(self) -> None:
        """The tare was undone: what had drifted until it is subtracted again."""
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
