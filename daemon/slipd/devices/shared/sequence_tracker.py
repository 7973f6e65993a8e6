"""Gaps, duplicates and restarts in the sequence numbers of a device."""

from __future__ import annotations

from slipd.devices.shared.device_interface import DecoderHealth

LATE_WITHIN = 32
"""A number at most this far behind the newest is a late or repeated reading; one further behind is a restart."""

SHORT_GAP = 32
"""A gap at most this long may end at the first number by chance, when the number wraps; a longer one is a restart."""

FURTHEST_GAP = 1 << 24
"""Longest gap: 40 minutes at 7 kHz. A longer jump is a restart, and the numbers it skips are not counted as lost."""


class SequenceTracker:
    """Track the sequence number of one stream.

    Args:
        span: The number is sent modulo this.
        health: Receives ``lost``, ``duplicates`` and ``restarts``.
        first: Number with which the device begins after a restart; a jump to it is a restart, however short.
        in_order: Readings cannot overtake each other on this line. Two consecutive old numbers then show that the
            newest number was wrong: a weak checksum sometimes accepts a damaged number.
        late_within: A number at most this far behind the newest is late or repeated; 0: any falling number is a
            restart.
    """

    def __init__(
        self,
        span: int,
        health: DecoderHealth,
        *,
        first: int = 0,
        in_order: bool = False,
        late_within: int = LATE_WITHIN,
    ) -> None:
        self._span = span
        self._health = health
        self._first = first
        self._in_order = in_order
        self._late_within = late_within
        self._newest: int | None = None
        self._old: int | None = None

    def accept(self, number: int) -> bool:
        """Track the number of a reading; return False if the reading is old and must be dropped."""
        newest = self._newest
        if newest is not None:
            ahead = (number - newest) % self._span
            behind = self._span - ahead
            if ahead == 0 or (behind <= self._late_within and number != self._first):
                follows_old = self._old is not None and number == (self._old + 1) % self._span
                self._old = number
                if not (self._in_order and follows_old):
                    self._health.duplicates += 1
                    return False
                self._newest = number
                return True
            is_gap = ahead <= min(self._span // 2, FURTHEST_GAP) and (number != self._first or ahead <= SHORT_GAP)
            if is_gap:
                self._health.lost += ahead - 1
            else:
                self._health.restarts += 1
        self._newest, self._old = number, None
        return True

    def accept_run(self, first: int, count: int) -> bool:
        """Track ``count`` consecutive numbers if they follow the newest; return False, and change nothing, if not."""
        if self._newest is None or first != self._newest + 1 or first + count > self._span:
            return False
        self._newest, self._old = first + count - 1, None
        return True

    def forget(self) -> None:
        """Start again: the next number follows nothing."""
        self._newest = self._old = None
