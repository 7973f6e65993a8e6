"""The far ends of links, which can be plugged and unplugged, links that read them, and what these reported."""

from __future__ import annotations

import asyncio
import os
import socket
import tty
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from loop_waits import eventually

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import Links


class FarEnd:
    """The far end of a stream of bytes."""

    def __init__(self, spec: LinkSpec) -> None:
        self.spec = spec
        self.fd = -1

    def plug(self) -> bool:
        """Connect, and return whether the link is there."""
        raise NotImplementedError

    def unplug(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1

    def send(self, data: bytes) -> None:
        assert os.write(self.fd, data) == len(data)

    def read(self) -> bytes:
        """Return bytes that can be read now; none if nobody has the other end open."""
        try:
            return os.read(self.fd, 1 << 20)
        except OSError:
            return b""


class Device(FarEnd):
    """A device at a serial port, whose path stays while pseudo-terminals come and go."""

    def __init__(self, path: Path) -> None:
        super().__init__(LinkSpec("left.wrench", "serial", str(path), 460800))
        self.path = path

    def plug(self) -> bool:
        self.fd, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.fd, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        os.close(slave)
        return True

    def unplug(self) -> None:
        super().unplug()
        self.path.unlink(missing_ok=True)


class TcpDevice(FarEnd):
    """A device with a TCP port."""

    def __init__(self, server: socket.socket) -> None:
        super().__init__(LinkSpec("left.wrench", "tcp", f"tcp://localhost:{server.getsockname()[1]}"))
        self._server = server
        server.setblocking(False)

    def plug(self) -> bool:
        try:
            self.fd = self._server.accept()[0].detach()
        except BlockingIOError:
            return False
        os.set_blocking(self.fd, False)
        return True


class Driver(FarEnd):
    """A driver that connects to the daemon."""

    def __init__(self, path: Path) -> None:
        super().__init__(LinkSpec("left.wrench", "local", f"unix://{path}"))
        self._path = str(path)

    def plug(self) -> bool:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as made:
            if made.connect_ex(self._path) != 0:
                return False
            made.setblocking(False)
            self.fd = made.detach()
        return True


@asynccontextmanager
async def serving(
    *ends: LinkSpec | FarEnd, on_event: Callable[[Event], object] = id, waits: bool = True
) -> AsyncIterator[tuple[Links, list[Event]]]:
    """Run links: far ends are plugged in, and each link has reported something before the block begins."""
    events: list[Event] = []

    def keep(event: Event) -> None:
        events.append(event)
        on_event(event)

    specs = [end.spec if isinstance(end, FarEnd) else end for end in ends]
    async with asyncio.TaskGroup() as tasks, Links(tasks, specs, keep) as links:
        for end in ends:
            if isinstance(end, FarEnd):
                await eventually(end.plug)
        if waits:
            await eventually(lambda: len(events) >= len(ends))
        yield links, events


def kinds(events: list[Event]) -> list[type]:
    return [type(event) for event in events]


def pieces(events: list[Event], link: str = "left.wrench") -> list[bytes]:
    """Return all bytes of a link as they were delivered."""
    return [event.data for event in events if isinstance(event, Bytes) and event.link == link]


def received(events: list[Event], link: str = "left.wrench") -> bytes:
    """Return all bytes of a link."""
    return b"".join(pieces(events, link))


def ups(events: list[Event]) -> int:
    """Return how often a link went up."""
    return kinds(events).count(LinkUp)


def downs(events: list[Event]) -> list[str]:
    """Return why links went down."""
    return [event.reason for event in events if isinstance(event, LinkDown)]
