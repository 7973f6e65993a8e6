"""How the host runs the event loop: with a real-time priority, or awake all the time.

Other programs of the robot PC do not delay a warning of a loop with priority. Waking up takes time, and what a process
computes just after it slept takes several times as long as what it computes while awake (docs/measured/bench.md): a
loop may poll instead, which costs a whole processor.
"""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterator
from selectors import EpollSelector, SelectorKey

HOW_TO_PERMIT = (
    "permit it with LimitRTPRIO=49 in the systemd unit, with a line 'slipd - rtprio 49' in /etc/security/limits.d, or"
    " with --ulimit rtprio=49 for a container; see docs/service.md"
)


@contextlib.contextmanager
def realtime_priority(priority: int) -> Iterator[str]:
    """Schedule this thread by SCHED_FIFO for the duration of ``with``; threads and processes that it starts are not.

    Args:
        priority: Priority, 1 to 49; 0: none.

    Yields:
        Why it was not permitted, for people; "" if it was, or if none is asked for.
    """
    if not priority:
        yield ""
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        yield f"realtime.priority = {priority} is not permitted to this user, and slipd runs without: {HOW_TO_PERMIT}"
        return
    try:
        yield ""
    finally:  # without the flag, this needs a right that only root has
        os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))


class PollingSelector(EpollSelector):
    """A selector for asyncio that waits as its base does, or polls.

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
