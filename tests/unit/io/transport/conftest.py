"""Real pseudo-terminals that can be plugged and unplugged, and links that read them."""

from __future__ import annotations

import asyncio
import os
import socket
import tty
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from loop_waits import eventually, loop_faults

from slipd.events import Event, LinkSpec
from slipd.io.transport import Links

__all__ = ["eventually", "loop_faults"]  # fixtures

Serving = Callable[..., AbstractAsyncContextManager[tuple[Links, list[Event]]]]


class Device:
    """The device side of a serial port whose path stays while pseudo-terminals come and go."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._master = -1

    @property
    def spec(self) -> LinkSpec:
        return LinkSpec("left.wrench", "serial", str(self.path), 460800)

    def plug(self) -> bool:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        os.close(slave)
        return True

    def unplug(self) -> None:
        if self._master >= 0:
            os.close(self._master)
            self._master = -1
        self.path.unlink(missing_ok=True)

    def send(self, data: bytes) -> None:
        assert os.write(self._master, data) == len(data)

    def read(self) -> bytes:
        """Return all bytes that can be read now."""
        data = b""
        try:
            while chunk := os.read(self._master, 65536):
                data += chunk
        except OSError:  # nothing more, or nobody has the port open
            pass
        return data


class SocketDevice:
    """The far end of a stream over a socket: a device with a TCP port, or a driver that connects to the daemon."""

    def __init__(self, spec: LinkSpec) -> None:
        self.spec = spec
        self._socket: socket.socket | None = None

    def unplug(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def send(self, data: bytes) -> None:
        assert self._socket is not None
        assert self._socket.send(data) == len(data)

    def read(self) -> bytes:
        """Return all bytes that can be read now."""
        data = b""
        try:
            while self._socket is not None and (chunk := self._socket.recv(65536)):
                data += chunk
        except BlockingIOError:
            pass
        return data


class TcpDevice(SocketDevice):
    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        super().__init__(LinkSpec("left.wrench", "tcp", f"tcp://localhost:{self._server.getsockname()[1]}"))

    def plug(self) -> bool:
        """Accept the link, and return whether there is one."""
        try:
            self._socket, _ = self._server.accept()
        except BlockingIOError:
            return False
        self._socket.setblocking(False)
        return True

    def remove(self) -> None:
        self.unplug()
        self._server.close()


class Driver(SocketDevice):
    def __init__(self, path: Path) -> None:
        super().__init__(LinkSpec("left.wrench", "local", f"unix://{path}"))
        self._path = path

    def plug(self) -> bool:
        """Connect, and return whether the link is there."""
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        if made.connect_ex(str(self._path)) != 0:
            made.close()
            return False
        made.setblocking(False)
        self._socket = made
        return True


@pytest.fixture(params=["serial", "tcp", "driver"])
def far(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Device | TcpDevice | Driver]:
    """The far end of a stream of bytes, over each transport that carries one."""
    if request.param == "tcp":
        device = TcpDevice()
        yield device
        device.remove()
        return
    other = Device(tmp_path / "far") if request.param == "serial" else Driver(tmp_path / "far")
    yield other
    other.unplug()


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "port")
    yield device
    device.unplug()


@pytest.fixture
def other_device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "other")
    yield device
    device.unplug()


@pytest.fixture
def spec(device: Device) -> LinkSpec:
    return device.spec


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Links try again without a pause."""
    monkeypatch.setattr("slipd.io.transport.link.FIRST_DELAY_S", 0.001)
    monkeypatch.setattr("slipd.io.transport.link.MAX_DELAY_S", 0.001)


@pytest.fixture
async def serving(loop_faults: list[dict[str, Any]]) -> Serving:
    @asynccontextmanager
    async def serve(
        *specs: LinkSpec, on_event: Callable[[Event], None] | None = None
    ) -> AsyncIterator[tuple[Links, list[Event]]]:
        events: list[Event] = []

        def keep(event: Event) -> None:
            events.append(event)
            if on_event is not None:
                on_event(event)

        async with asyncio.TaskGroup() as tasks, Links(tasks, specs, keep) as links:
            yield links, events

    return serve
