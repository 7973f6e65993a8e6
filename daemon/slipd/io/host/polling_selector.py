"""A selector for asyncio that may poll instead of sleeping, so that the event loop is awake when a reading comes.

Waking up takes time, and what a process computes just after it slept takes several times as long as what it computes
while awake (docs/bench.md). Polling costs a whole processor.
"""

from __future__ import annotations

import math
import time
from selectors import EpollSelector, SelectorKey


class PollingSelector(EpollSelector):
    """Waits as its base does, or polls.

    Attributes:
        polls: It polls instead of sleeping.
    """

    def __init__(self) -> None:
        super().__init__()
        self.polls = False

    def select(self, timeout: float | None = None) -> list[tuple[SelectorKey, int]]:
        """Return the events; wait for one up to ``timeout``, s, and without end where it is None."""
        if not self.polls:
            return super().select(timeout)
        end_s = math.inf if timeout is None else time.monotonic() + timeout
        events = super().select(0)
        while not events and time.monotonic() < end_s:
            events = super().select(0)
        return events
