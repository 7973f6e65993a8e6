"""The event loop of a run: its ticks, which feed time to the engine, and how the host runs it.

The engine measures with its ticks how late the daemon is. It cannot see whether bytes that arrived during a stall still
wait to be read. The ticker finds out from the event loop, and the answer enters the engine with the tick.

Other programs of the robot PC do not delay a warning of a loop with real-time priority.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections.abc import Callable, Iterator

from slipd.events import Tick
from slipd.finger.freshness import LATE_NS

TICK_S = 0.005
"""Period of the ticks, s; sessions and staleness (20 ms or more by default) are checked at each."""

QUIET_TURNS = 3
"""After a stall the lines count as read when this many consecutive turns of the loop brought no event: a WebSocket
message takes two turns from its socket to the engine."""

QUIET_AFTER_S = 0.001
"""Wait before the first turn, s. The kernel hands over the bytes of a pseudo-terminal from a worker, which may also be
late after a stall. 1 ms is a choice: how late that worker runs has not been measured."""

WALL_STEP_NS = 1_000_000
"""Smaller moves of the wall clock against CLOCK_MONOTONIC are not followed: NTP steps by 128 ms or more, and slews
both clocks."""

AT_ONCE_NS = 50_000
"""Clocks whose readings lie further apart are not compared: the process was interrupted in between."""


class Ticker:
    """Tick every TICK_S without drift, and after a stall once more as soon as all lines have been read.

    Args:
        handle: Called with each tick and its time, CLOCK_MONOTONIC ns.
        event_count: Returns how many events have entered the engine.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.
    """

    def __init__(
        self, handle: Callable[[Tick, int], None], event_count: Callable[[], int], wall_minus_monotonic_ns: int
    ) -> None:
        self._handle = handle
        self._event_count = event_count
        self._begun_ns = wall_minus_monotonic_ns
        self._moved_ns = 0  # as in the ticks
        self._unread = False
        self._ticked_ns: int | None = None

    async def run(self) -> None:
        """Tick until cancelled; an exception of ``handle`` goes to the loop's exception handler and ends the ticks.

        Each tick is a callback: a task that sleeps would turn the loop twice for it.
        """
        self._loop = asyncio.get_running_loop()
        self._due_s = self._loop.time()
        self._next = self._loop.call_soon(self._tick)
        try:
            await self._loop.create_future()
        finally:
            self._next.cancel()

    def _tick(self) -> None:
        t_ns = time.monotonic_ns()  # read first, so that the time in suspend is never negative
        suspended_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - t_ns
        raw_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)
        wall_ns = time.time_ns() - t_ns
        if time.monotonic_ns() - t_ns > AT_ONCE_NS:
            raw_ns = 0
        elif abs(wall_ns - (self._moved_ns or self._begun_ns)) > WALL_STEP_NS:
            self._moved_ns = wall_ns
        if self._ticked_ns is not None and t_ns - self._ticked_ns > LATE_NS:
            self._unread = True
        self._ticked_ns = t_ns
        self._handle(Tick(suspended_ns, self._unread, raw_ns, self._moved_ns), t_ns)
        self._due_s = max(self._due_s + TICK_S, self._loop.time())
        if self._unread:
            self._next = self._loop.call_later(QUIET_AFTER_S, self._begin_turns)
        else:
            self._next = self._loop.call_at(self._due_s, self._tick)

    def _begin_turns(self) -> None:
        """Turn the loop until nothing enters the engine, for at most TICK_S; each turn reads lines that have bytes."""
        until_s = self._loop.time() + TICK_S  # not before: the wait itself may have taken longer
        self._next = self._loop.call_soon(self._turn, until_s, self._event_count(), 0)

    def _turn(self, until_s: float, before: int, quiet: int) -> None:
        """End one more turn, and tick after the last.

        Args:
            until_s: Time of the loop after which there are no more turns.
            before: Number of events that had entered the engine before this turn.
            quiet: Number of turns without an event until then.
        """
        events = self._event_count()
        quiet = quiet + 1 if events == before else 0
        if quiet < QUIET_TURNS and self._loop.time() < until_s:
            self._next = self._loop.call_soon(self._turn, until_s, events, quiet)
        else:
            self._unread = quiet < QUIET_TURNS
            self._tick()


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
