"""Feed time to the engine, and whether the lines were read since the last tick.

The engine measures by its ticks how late the daemon is. It cannot see whether bytes that arrived meanwhile still wait
to be read: the ticker asks the event loop, and the answer enters with the tick.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from slipd.engine.lateness import LATE_NS
from slipd.events import Tick

#: How often time enters the engine: sessions and staleness (20 ms at the least, by default) are judged by it.
TICK_S = 0.005

#: After a stall the lines count as read empty once so many turns of the loop in a row brought no event: a WebSocket's
#: message takes two turns from its socket to the engine.
QUIET_TURNS = 3

#: First the kernel gets this time to hand over what arrived: its worker fills a pseudo-terminal, and may be late too.
QUIET_AFTER_S = 0.001


class Ticker:
    """Ticks every TICK_S without drifting, and after a stall once more as soon as the lines are read empty.

    Args:
        take: Takes a tick and its time, CLOCK_MONOTONIC.
        taken: Returns how many events entered the engine so far.
    """

    def __init__(self, take: Callable[[Tick, int], None], taken: Callable[[], int]) -> None:
        self._take = take
        self._taken = taken
        self._unread = False
        self._ticked_ns: int | None = None

    async def run(self) -> None:
        """Tick until cancelled."""
        loop = asyncio.get_running_loop()
        due_s, quiet = loop.time(), False
        while True:
            self._tick(quiet=quiet)
            due_s = max(due_s + TICK_S, loop.time())
            if self._unread:
                quiet = await self._quiet()
            else:
                await asyncio.sleep(due_s - loop.time())

    def _tick(self, *, quiet: bool) -> None:
        t_ns = time.monotonic_ns()  # read first, so that the time in suspend is never negative
        suspended_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - t_ns
        late = self._ticked_ns is not None and t_ns - self._ticked_ns > LATE_NS
        self._unread = late or (self._unread and not quiet)
        self._ticked_ns = t_ns
        self._take(Tick(suspended_ns, self._unread), t_ns)

    async def _quiet(self) -> bool:
        """Turn the loop until nothing enters the engine; False where that did not happen within TICK_S.

        Each turn asks the system which lines hold something, and reads from all that do.
        """
        loop = asyncio.get_running_loop()
        await asyncio.sleep(QUIET_AFTER_S)
        until_s = loop.time() + TICK_S  # the sleep itself may have taken longer
        turns = 0
        while turns < QUIET_TURNS and loop.time() < until_s:
            taken = self._taken()
            await asyncio.sleep(0)
            turns = turns + 1 if self._taken() == taken else 0
        return turns >= QUIET_TURNS
