"""Tells a gap, a duplicate and a restart apart by a device's running number."""

from __future__ import annotations

from slipd.devices.health import DecoderHealth

#: A number so little behind the newest is a reading that came late or twice; one further behind is a restart.
LATE_WITHIN = 32

#: A gap so short may end at the first number by chance, as the number wraps; a longer leap to it is a restart.
SHORT_GAP = 32

#: A longer gap is none: 40 minutes at 7 kHz. A number that leaps further begins anew, and what it leaps is not counted.
FURTHEST_GAP = 1 << 24


class Numbering:
    """Watches the running number of one stream.

    Args:
        span: The number is sent modulo this.
        health: Receives ``lost``, ``duplicates`` and ``restarts``.
        first: Number with which the device begins after a restart; a jump to it is a restart however near.
        in_order: Readings cannot overtake each other on this line, so that a second old number that goes on from the
            first shows the newest to have been wrong: a weak checksum passes a damaged number now and then.
    """

    def __init__(self, span: int, health: DecoderHealth, *, first: int = 0, in_order: bool = False) -> None:
        self._span = span
        self._health = health
        self._first = first
        self._in_order = in_order
        self._newest: int | None = None
        self._old: int | None = None

    def take(self, number: int) -> bool:
        """Take the number of a reading; False where the reading is old and must not be handed on."""
        newest = self._newest
        if newest is not None:
            ahead = (number - newest) % self._span
            behind = self._span - ahead
            if ahead == 0 or (behind <= LATE_WITHIN and number != self._first):
                goes_on = self._old is not None and number == (self._old + 1) % self._span
                self._old = number
                if not (self._in_order and goes_on):
                    self._health.duplicates += 1
                    return False
                self._newest = number
                return True
            gap = ahead <= min(self._span // 2, FURTHEST_GAP) and (number != self._first or ahead <= SHORT_GAP)
            if gap:
                self._health.lost += ahead - 1
            else:
                self._health.restarts += 1
        self._newest, self._old = number, None
        return True

    def go_on(self, first: int, count: int) -> bool:
        """Take ``count`` numbers running that follow the newest; False, and none is taken, where they do not."""
        if self._newest is None or first != self._newest + 1 or first + count > self._span:
            return False
        self._newest, self._old = first + count - 1, None
        return True

    def forget(self) -> None:
        """Begin anew: what comes next follows nothing."""
        self._newest = self._old = None
