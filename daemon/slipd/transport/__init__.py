"""Thin asyncio shells that move bytes between devices and the engine.

`Links` is the whole room from outside: the files below say how one link stays open (`link`) and what lies beneath it
(`serial`, `tcp`, `udp`, `websocket`, `external`, `local`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from types import TracebackType

from slipd.events import Event, LinkSpec
from slipd.transport.link import Link, Look, Opener

__all__ = ["Links"]


class Links:
    """Every link of the daemon, each kept open by one task of the given group, from ``async with`` to its end.

    Args:
        tasks: Owner of the tasks. What ``on_event`` raises ends the link's task and so reaches the group.
        specs: The links.
        on_event: Called with LinkUp, Bytes and LinkDown of every link, within the callback in which bytes were read.

    Raises:
        ValueError: Two links have one name, or a transport is unknown.
    """

    def __init__(self, tasks: asyncio.TaskGroup, specs: Iterable[LinkSpec], on_event: Callable[[Event], None]) -> None:
        self._group = tasks
        self._links: dict[str, Link] = {}
        for spec in specs:
            if spec.name in self._links:
                raise ValueError(f"two links are named {spec.name!r}; names must differ")
            self._links[spec.name] = _link(spec, on_event)
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def refused_writes(self) -> dict[str, int]:
        """Link name → writes dropped because the link was down or its device did not read."""
        return {name: link.refused_writes for name, link in self._links.items()}

    @property
    def overruns(self) -> dict[str, int]:
        """Link name → datagrams that were lost before they could be read."""
        return {name: link.overruns for name, link in self._links.items()}

    def write(self, link: str, data: bytes) -> bool:
        """Send bytes on a link now or never; never blocks.

        Returns:
            Whether they were taken. Nothing is kept for a link that is down or a device that does not read.

        Raises:
            ValueError: There is no such link.
        """
        if link not in self._links:
            raise ValueError(f"no link is named {link!r}; there are {', '.join(self._links) or 'none'}")
        return self._links[link].write(data)

    async def __aenter__(self) -> Links:
        for name, link in self._links.items():
            self._tasks.append(self._group.create_task(link.run(), name=f"link {name}"))
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for task in self._tasks:
            task.cancel()
        if self._tasks:
            await asyncio.wait(self._tasks)


def _link(spec: LinkSpec, on_event: Callable[[Event], None]) -> Link:
    """A link over its transport, imported on demand: a rig without such devices does not wait for their library.

    Raises:
        ValueError: The transport is unknown.
    """
    look: Look | None = None
    opener: Opener
    match spec.transport:
        case "serial":
            from slipd.transport.serial_port import look
            from slipd.transport.serial_port import open_serial as opener
        case "tcp":
            from slipd.transport.tcp import open_tcp as opener
        case "udp":
            from slipd.transport.udp import open_udp as opener
        case "websocket":
            from slipd.transport.websocket import open_websocket as opener
        case "external":
            from slipd.transport.push_socket import open_push_socket as opener
        case "local":
            from slipd.transport.driver_socket import open_driver_socket as opener
        case _:
            raise ValueError(
                f"unknown transport {spec.transport!r}; there are serial, tcp, udp, websocket, external and local"
            )
    return Link(spec, opener, on_event, look)
