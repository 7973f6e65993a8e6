"""The times of a recorded run of which nothing is known: entries were lost, or the daemon did not run."""

from __future__ import annotations

from typing import NamedTuple

GAP_S = 0.1
"""Least time without an event that is a gap: ticks enter the engine every 5 ms, and a busy machine delays them."""


class Gap(NamedTuple):
    """The time between two events that are too far apart, s from the begin."""

    begin_s: float
    end_s: float


class EventGaps:
    """Finds the gaps from the times of all events. What was reported before a gap does not hold in it.

    Args:
        begin_ns: Where the times of the gaps begin to count, CLOCK_MONOTONIC.

    Attributes:
        found: The gaps so far, in order.
    """

    def __init__(self, begin_ns: int = 0) -> None:
        self.found: list[Gap] = []
        self._begin_ns = begin_ns
        self._newest_s: float | None = None

    def add(self, t_ns: int) -> bool:
        """Add the time of an event, before the messages that it causes; return whether a gap ends there."""
        t_s = (t_ns - self._begin_ns) * 1e-9
        before_s, self._newest_s = self._newest_s, t_s
        if before_s is None or t_s - before_s <= GAP_S:
            return False
        self.found.append(Gap(before_s, t_s))
        return True
