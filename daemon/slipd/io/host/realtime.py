"""Real-time priority of the event loop, so that other programs of the robot PC do not delay a warning."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

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
