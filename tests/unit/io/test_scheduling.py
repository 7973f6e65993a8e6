"""Real-time priority where it is permitted."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from slipd.io.event_loop import realtime_priority

SHOW = """
import os, resource, sys
from slipd.io.event_loop import realtime_priority
if os.geteuid() == 0:
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
with realtime_priority(10) as refused:
    print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, bool(refused), "LimitRTPRIO" in refused)
print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)
"""

GIVEN = """
import os, sys, threading
from slipd.io.event_loop import realtime_priority
show = lambda: print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(0).sched_priority)
with realtime_priority(10) as refused:
    if refused:
        sys.exit("not permitted")
    show()
    thread = threading.Thread(target=show); thread.start(); thread.join()
    if os.fork() == 0:
        show(); sys.stdout.flush(); os._exit(0)
    os.wait()
show()
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


def test_only_this_thread_is_scheduled_and_what_it_starts_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *call: calls.append(call))
    with realtime_priority(10) as refused:
        assert refused == ""
    assert calls == [
        (0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(10)),
        (0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0)),
    ]


def test_a_priority_is_that_of_the_thread_alone_and_ends_with_the_run() -> None:
    done = subprocess.run([sys.executable, "-u", "-c", GIVEN], capture_output=True, text=True)
    if "not permitted" in done.stderr:
        pytest.skip("this user may not use real-time priorities")
    usual = f"{os.SCHED_OTHER} 0"
    assert done.stdout.splitlines() == [f"{os.SCHED_FIFO} 10", usual, usual, usual], done.stderr
