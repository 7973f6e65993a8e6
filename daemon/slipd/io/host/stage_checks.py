"""Progress of each stage between two looks: the links, the engine, the publisher and the request server."""

from __future__ import annotations

from collections.abc import Callable

from slipd.io.host.watchdog import Check
from slipd.io.transport import Links
from slipd.io.zmtp.listener_progress import ListenerProgress

ANSWER_S = 0.5
"""Longest wait for the greeting of an own endpoint, s: several times what a loaded machine needs."""


def stage_checks(
    links: Links, tick_count: Callable[[], int], publisher: ListenerProgress, requests: ListenerProgress
) -> dict[str, Check]:
    """Return the check of each stage.

    Args:
        links: The links to the devices.
        tick_count: Returns how many ticks the engine has handled.
        publisher: Progress of the publisher.
        requests: Progress of the request server.
    """
    return {
        "links": _LinksCheck(links).check,
        "engine": _EngineCheck(tick_count).check,
        "publishing": lambda: publisher.stall(ANSWER_S),
        "requests": lambda: requests.stall(ANSWER_S),
    }


class _LinksCheck:
    def __init__(self, links: Links) -> None:
        self._links = links

    async def check(self) -> str:
        unread = self._links.unread()
        return f"bytes of {', '.join(unread)} are not read" if unread else ""


class _EngineCheck:
    def __init__(self, tick_count: Callable[[], int]) -> None:
        self._tick_count = tick_count
        self._seen = tick_count()

    async def check(self) -> str:
        before, self._seen = self._seen, self._tick_count()
        return "" if self._seen > before else "it handles no ticks"
