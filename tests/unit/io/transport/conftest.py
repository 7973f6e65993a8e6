"""Far ends of links."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from link_ends import Device, Driver, FarEnd, TcpDevice


@pytest.fixture(params=["serial", "tcp", "driver"])
def far(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FarEnd]:
    """The far end of a stream of bytes, over each transport that carries one."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        ends = {"serial": Device(tmp_path / "far"), "tcp": TcpDevice(server), "driver": Driver(tmp_path / "far")}
        yield ends[request.param]
        ends[request.param].unplug()


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "port")
    yield device
    device.unplug()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Links try again without a pause."""
    monkeypatch.setattr("slipd.io.transport.link.FIRST_DELAY_S", 0.001)
    monkeypatch.setattr("slipd.io.transport.link.MAX_DELAY_S", 0.001)
