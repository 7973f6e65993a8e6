"""Feed the watchdog of systemd, but only while every stage of the daemon makes progress.

A thread of its own, or a bare timer, would feed it while nothing is read. So the loop feeds it, after each stage has
shown progress since the last time: lines read, the engine stepped, messages sent, requests taken.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping

from slipd.io.transport import Links
from slipd.io.zmtp.listener import Listener

ANSWER_S = 0.5
"""Longest wait for the greeting of an own endpoint, s: several times what a loaded machine needs."""

FEEDS_PER_TIMEOUT = 4
"""Feeds within the timeout of the watchdog: one may fail, as for a stage that was looked at between two of its steps,
even if every endpoint is waited for."""

Check = Callable[[], Awaitable[str]]
"""Returns why a stage made no progress since the last call; "" if it did."""

_log = logging.getLogger(__name__)


class Watchdog:
    """Feed the watchdog for as long as every stage makes progress.

    Args:
        feed: Feeds the watchdog.
        timeout_s: Time after which an unfed watchdog ends the process, s.
        stages: Check of each stage, by name.
    """

    def __init__(self, feed: Callable[[], None], timeout_s: float, stages: Mapping[str, Check]) -> None:
        self._feed = feed
        self._period_s = timeout_s / FEEDS_PER_TIMEOUT
        self._stages = stages

    async def run(self) -> None:
        """Check and feed until cancelled."""
        while True:
            await asyncio.sleep(self._period_s)
            stalled = [f"{name}: {why}" for name, check in self._stages.items() if (why := await check())]
            if stalled:
                _log.error("%s: the watchdog is not fed: no progress (%s)", "watchdog", "; ".join(stalled))
            else:
                self._feed()


def stage_checks(
    links: Links, tick_count: Callable[[], int], publisher: Listener, requests: Listener
) -> dict[str, Check]:
    """Return the check of each stage.

    Args:
        links: The links to the devices.
        tick_count: Returns how many ticks the engine has handled.
        publisher: The publisher.
        requests: The request server.
    """
    seen = tick_count()

    async def check_links() -> str:
        unread = links.unread()
        return f"bytes of {', '.join(unread)} are not read" if unread else ""

    async def check_engine() -> str:
        nonlocal seen
        before, seen = seen, tick_count()
        return "" if seen > before else "it handles no ticks"

    return {
        "links": check_links,
        "engine": check_engine,
        "publishing": lambda: publisher.stall(ANSWER_S),
        "requests": lambda: requests.stall(ANSWER_S),
    }
