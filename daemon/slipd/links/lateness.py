"""Lateness of the daemon itself: after a stall, what it reads may have waited for as long as the stall."""

from __future__ import annotations

from slipd.events import Event, Tick
from slipd.finger.freshness import PROMPT, Arrival

LATE_NS = 10_000_000
"""Least gap between ticks that counts as a stall. Ticks come every 5 ms; no stream is stale before twice this gap."""

LEAST_CATCH_UP_NS, MOST_CATCH_UP_NS = 100_000_000, 1_000_000_000
"""After a stall a line without readings counts as unread for as long as the stall, within these bounds. A daemon that
has not caught up by then is overloaded, and a dead sensor must not hide behind that."""

LONGEST_WAIT_NS = 1_000_000_000
"""A reading that waited longer is stale: its verdict would come too late."""

SHOWN_NS = 1_000_000_000
"""The worst stall is reported for this long."""


class Lateness:
    """Measures the gaps between ticks.

    Attributes:
        first_ns: Time of the first event; None before it.
        late_ns: The longest stall since the lines were last read empty; 0 without one.
        slewed_ns: How far NTP has slewed CLOCK_MONOTONIC since the first tick.
        paused_ns: Time between the last two events.
    """

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self.late_ns = 0
        self.slewed_ns = self.paused_ns = self._event_ns = 0
        self._ahead_ns: int | None = None  # CLOCK_MONOTONIC of CLOCK_MONOTONIC_RAW at the first tick
        self._tick_ns: int | None = None
        self._since_ns = self._unread_since_ns = self._unread_until_ns = 0
        self._worst: tuple[int, int] = (0, 0)

    def update(self, event: Event, t_ns: int) -> None:
        """Update with the time of an event, before the event is handled."""
        if self.first_ns is None:
            self.first_ns = t_ns
        self.paused_ns, self._event_ns = t_ns - self._event_ns, t_ns
        if self._tick_ns is not None and t_ns - self._tick_ns > LATE_NS:
            self._stall(self._tick_ns, t_ns)
        if isinstance(event, Tick):
            self._tick_ns = t_ns
            if not event.unread:
                self.late_ns = 0
            if event.raw_ns:
                ahead_ns = t_ns - event.raw_ns
                self._ahead_ns = ahead_ns if self._ahead_ns is None else self._ahead_ns
                self.slewed_ns = ahead_ns - self._ahead_ns

    def waited_ns(self, t_ns: int) -> int:
        """Return how long bytes that are read at ``t_ns`` may have waited: since the lines were last read empty."""
        return min(t_ns - self._since_ns, LONGEST_WAIT_NS) if self.late_ns else 0

    def unread_ns(self, t_ns: int) -> int | None:
        """Return for how long until ``t_ns`` a line that brought nothing counts as unread; None: it is empty."""
        if not self.late_ns:
            return None
        return t_ns - self._unread_since_ns if t_ns <= self._unread_until_ns else 0

    def arrival(self, t_ns: int) -> Arrival:
        """Return how bytes that are read at ``t_ns`` reached the daemon."""
        return Arrival(self.waited_ns(t_ns), self.unread_ns(t_ns), late_ns=self.late_ns) if self.late_ns else PROMPT

    def worst_ns(self, t_ns: int) -> int:
        """Return the longest stall of the last second, ns."""
        stall_ns, at_ns = self._worst
        return stall_ns if t_ns - at_ns <= SHOWN_NS else 0

    def _stall(self, tick_ns: int, t_ns: int) -> None:
        stall_ns = t_ns - tick_ns
        if not self.late_ns:
            self._since_ns = tick_ns
        if not self.late_ns or t_ns > self._unread_until_ns:
            self._unread_since_ns = tick_ns
            self._unread_until_ns = t_ns + min(max(stall_ns, LEAST_CATCH_UP_NS), MOST_CATCH_UP_NS)
        self.late_ns = max(self.late_ns, stall_ns)
        if stall_ns > self.worst_ns(t_ns):
            self._worst = (stall_ns, t_ns)
