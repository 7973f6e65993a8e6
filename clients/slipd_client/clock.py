"""The daemon's clock as its replies show it, with a bound of the error: deadlines are told in that clock.

A reply's ``t_ns`` was read after the request left and before the reply arrived. That bounds the offset between
the two clocks; every further reply narrows the bounds, and time widens them again, since no two clocks run alike.
"""

from __future__ import annotations

DRIFT_PPM = 200
"""How fast two clocks may part: twice what two ordinary crystals do at their worst (50 ppm each)."""


class ServerClock:
    """Bounds of (daemon's CLOCK_MONOTONIC − this machine's), ns; on one machine both are the same clock."""

    def __init__(self) -> None:
        self._low_ns = 0
        self._high_ns = 0
        self._heard_ns: int | None = None

    def hear(self, sent_ns: int, received_ns: int, server_ns: int) -> None:
        """Take in that the daemon's clock showed ``server_ns`` at some instant between the other two."""
        drift_ns = _drift_ns(received_ns - sent_ns)
        low_ns, high_ns = server_ns - received_ns - drift_ns, server_ns - sent_ns + drift_ns
        if self._heard_ns is not None:
            grown_ns = self._grown_ns(received_ns)
            narrowed = max(low_ns, self._low_ns - grown_ns), min(high_ns, self._high_ns + grown_ns)
            if narrowed[0] <= narrowed[1]:  # else a clock has stepped: what was known before is wrong
                low_ns, high_ns = narrowed
        self._low_ns, self._high_ns, self._heard_ns = low_ns, high_ns, received_ns

    def forget(self) -> None:
        """Nothing is known any more: another daemon answers."""
        self._heard_ns = None

    def error_ns(self, now_ns: int) -> int | None:
        """How far `server_ns` may be off either way at ``now_ns``; None while nothing is known."""
        if self._heard_ns is None:
            return None
        return -(-(self._high_ns - self._low_ns) // 2) + self._grown_ns(now_ns)

    def server_ns(self, now_ns: int) -> int:
        """What the daemon's clock shows when this machine's shows ``now_ns``."""
        return now_ns + (self._low_ns + self._high_ns) // 2

    def local_ns(self, server_ns: int) -> int:
        """What this machine's clock shows when the daemon's shows ``server_ns``, e.g. a message's ``t_ns``."""
        return server_ns - (self._low_ns + self._high_ns) // 2

    def earliest_ns(self, now_ns: int) -> int:
        """The least that the daemon's clock may show at ``now_ns``: a deadline from here is never too late."""
        return now_ns + self._low_ns - self._grown_ns(now_ns)

    def _grown_ns(self, now_ns: int) -> int:
        return 0 if self._heard_ns is None else _drift_ns(abs(now_ns - self._heard_ns))


def _drift_ns(passed_ns: int) -> int:
    return -(-passed_ns * DRIFT_PPM // 1_000_000)
