"""Move bytes between devices and the engine, with asyncio.

`Links` is all that other rooms use. `link` keeps one link open, over a transport: `serial_port`, `websocket`, or
`sockets` (TCP and UDP; other programs that push readings or drive a gripper). `link_connection` has what they share.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from types import TracebackType

from slipd.events import Event, LinkSpec
from slipd.io.transport.link import Link, Opener, Probe

__all__ = ["Links"]


class Links:
    """All links of the daemon, each kept open by a task of the given group, for the duration of ``async with``.

    Args:
        tasks: Owner of the tasks. An exception of ``on_event`` ends the task of the link and so reaches the group.
        specs: The links, whose names differ.
        on_event: Called with LinkUp, Bytes and LinkDown of every link, in the callback that read the bytes.

    Raises:
        ValueError: A transport is unknown.
    """

    def __init__(self, tasks: asyncio.TaskGroup, specs: Iterable[LinkSpec], on_event: Callable[[Event], None]) -> None:
        self._group = tasks
        self._links = {spec.name: _link(spec, on_event) for spec in specs}
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def losses(self) -> dict[str, tuple[int, int]]:
        """Link name → writes dropped as the link was down or its device did not read, and datagrams lost unread."""
        return {name: (link.refused_writes, link.overruns) for name, link in self._links.items()}

    def unread(self) -> list[str]:
        """Return the links on which bytes wait, as at the last call, although none were delivered since."""
        return [name for name, link in self._links.items() if link.unread()]

    def write(self, link: str, data: bytes) -> bool:
        """Send bytes on a link at once, or drop them; never block.

        Returns:
            Whether they were sent. Nothing is queued for a link that is down or a device that does not read.
        """
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
    """Return a link over its transport, which is imported only if it is used.

    Raises:
        ValueError: The transport is unknown.
    """
    probe: Probe | None = None
    opener: Opener
    match spec.transport:
        case "serial":
            from slipd.io.transport.serial_port import open_serial as opener
            from slipd.io.transport.serial_port import probe
        case "tcp":
            from slipd.io.transport.sockets import open_tcp as opener
        case "udp":
            from slipd.io.transport.sockets import open_udp as opener
        case "websocket":
            from slipd.io.transport.websocket import open_websocket as opener
        case "external":
            from slipd.io.transport.sockets import open_push_socket as opener
        case "local":
            from slipd.io.transport.sockets import open_driver_socket as opener
        case _:
            raise ValueError(
                f"transport must be serial, tcp, udp, websocket, external or local, got {spec.transport!r}"
            )
    return Link(spec, opener, on_event, probe)
