"""The daemon's clock as its replies show it, with a bound of the error. Deadlines of requests are in that clock.

A reply's ``t_ns`` was read after the request left and before the reply arrived, which bounds the offset between the two
clocks. Every further reply narrows the bounds, and time widens them again, because no two clocks run at the same rate.
"""

from __future__ import annotations

DRIFT_PPM = 200
"""Bound of the relative rate of two clocks: twice that of two ordinary crystals at their worst (50 ppm each)."""


class ServerClock:
    """Bounds of (the daemon's CLOCK_MONOTONIC − this machine's), ns; on one machine both are the same clock.

    Before the first reply, and after `forget`, the clock is unknown: every conversion returns None.
    """

    def __init__(self) -> None:
        self._low_ns = 0
        self._high_ns = 0
        self._observed_ns: int | None = None

    def observe(self, sent_ns: int, received_ns: int, server_ns: int) -> None:
        """Note that the daemon's clock showed ``server_ns`` at some instant between the other two."""
        drift_ns = _drift_ns(received_ns - sent_ns)
        low_ns, high_ns = server_ns - received_ns - drift_ns, server_ns - sent_ns + drift_ns
        if self._observed_ns is not None:
            grown_ns = _drift_ns(abs(received_ns - self._observed_ns))
            narrowed = max(low_ns, self._low_ns - grown_ns), min(high_ns, self._high_ns + grown_ns)
            if narrowed[0] <= narrowed[1]:  # else a clock was stepped, and the bounds so far are wrong
                low_ns, high_ns = narrowed
        self._low_ns, self._high_ns, self._observed_ns = low_ns, high_ns, received_ns

    def forget(self) -> None:
        """Make the clock unknown: another daemon answers."""
        self._observed_ns = None

    def error_ns(self, now_ns: int) -> int | None:
        """Return how far `local_ns` may be off either way at ``now_ns``; None while the clock is unknown."""
        if self._observed_ns is None:
            return None
        return -(-(self._high_ns - self._low_ns) // 2) + _drift_ns(abs(now_ns - self._observed_ns))

    def local_ns(self, server_ns: int) -> int | None:
        """Return this machine's clock at ``server_ns``, e.g. a message's ``t_ns``; None while the offset is unknown."""
        return None if self._observed_ns is None else server_ns - (self._low_ns + self._high_ns) // 2

    def earliest_ns(self, now_ns: int) -> int | None:
        """Return the least that the daemon's clock may show at ``now_ns``; None while it is unknown.

        A deadline counted from here is never later than intended.
        """
        return None if self._observed_ns is None else now_ns + self._low_ns - _drift_ns(abs(now_ns - self._observed_ns))


def _drift_ns(passed_ns: int) -> int:
    return -(-passed_ns * DRIFT_PPM // 1_000_000)
