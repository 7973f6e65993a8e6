"""Wall clock of a run, and the time of what never happens."""

from __future__ import annotations

from datetime import UTC, datetime

NEVER_NS = 2**63 - 1
"""Deadline of what waits for no time."""
_SPAN_S = 10**11
"""Largest wall time in a name, in the year 5138; a replayed file may contain any time."""


class WallClock:
    """Relate CLOCK_MONOTONIC to the wall clock.

    The wall clock moves against CLOCK_MONOTONIC while the host sleeps, and when somebody sets it.

    Args:
        minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.

    Attributes:
        minus_monotonic_ns: Likewise now.
    """

    def __init__(self, minus_monotonic_ns: int) -> None:
        self.minus_monotonic_ns = minus_monotonic_ns

    def at_ns(self, t_ns: int) -> int:
        """Return the wall time at ``t_ns``, ns since 1970."""
        return t_ns + self.minus_monotonic_ns

    def stamp(self, t_ns: int) -> str:
        """Return the wall time at ``t_ns`` for the name of a file, such as "20261122T221300Z"."""
        return datetime.fromtimestamp(self.at_ns(t_ns) // 10**9 % _SPAN_S, UTC).strftime("%Y%m%dT%H%M%SZ")
