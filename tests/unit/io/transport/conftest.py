"""Real pseudo-terminals that can be plugged and unplugged, and links that read them."""

from __future__ import annotations

import asyncio
import os
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

    def plug(self) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        os.close(slave)

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
    return LinkSpec("left.wrench", "serial", str(device.path), 460800)


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
