"""Real-time priority: given where it is permitted, and reported where it is not."""

from __future__ import annotations

import os
import subprocess
import sys

from slipd.host.realtime import realtime_priority

SHOW = """
import os, resource, sys
from slipd.host.realtime import realtime_priority
if os.geteuid() == 0:
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
with realtime_priority(10) as refused:
    print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, bool(refused), "LimitRTPRIO" in refused)
print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)
"""


def shown(limit: int) -> list[str]:
    """Return what a process prints that may use priorities up to ``limit``, without the rights of root."""
    command = ["prlimit", f"--rtprio={limit}:{limit}", sys.executable, "-c", SHOW]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def test_without_a_priority_nothing_changes() -> None:
    before = os.sched_getscheduler(0)
    with realtime_priority(0) as refused:
        assert (refused, os.sched_getscheduler(0)) == ("", before)


def test_a_priority_that_is_not_permitted_is_refused_in_words() -> None:
    assert shown(0) == [str(os.SCHED_OTHER), "True", "True", str(os.SCHED_OTHER)]
