from __future__ import annotations

import socket
import stat
from pathlib import Path
from typing import TYPE_CHECKING

import msgpack
import pytest

from slipd.errors import LinkError
from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport.driver_socket import open_driver_socket

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually

PATIENCE_S = 30.0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "gripper"


@pytest.fixture
def spec(path: Path) -> LinkSpec:
    return LinkSpec("gripper", "local", f"unix://{path}")


def connect(path: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.settimeout(PATIENCE_S)
    made.connect(str(path))
    return made


def lies_there(path: Path) -> bool:
    return path.exists()


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def received(events: list[Event]) -> bytes:
    return b"".join(event.data for event in events if isinstance(event, Bytes))


async def test_the_link_is_open_while_a_driver_is_connected(
    spec: LinkSpec, path: Path, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(spec) as (links, events):
        for round_ in range(3):
            await eventually(path.exists)
            assert mode(path) == 0o700
            assert not links.write("gripper", b"nobody is there")
            with connect(path) as driver:
                await eventually(lambda: LinkUp in map(type, events))
                assert links.write("gripper", b"go")
                assert driver.recv(10) == b"go"
                driver.send(b"gone")
                await eventually(lambda: received(events) == b"gone")
            await eventually(lambda: type(events[-1]) is LinkDown)
            assert "the other side closed it" in events[-1].reason, round_
            events.clear()
    assert not lies_there(path)


async def test_a_second_driver_is_turned_away_while_the_first_lives(
    spec: LinkSpec, path: Path, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(spec) as (links, events):
        await eventually(path.exists)
        with connect(path) as first:
            await eventually(lambda: events)
            for _ in range(3):
                with connect(path) as second:
                    second.setblocking(False)
                    heard = bytearray()

                    def hung_up(second: socket.socket = second, heard: bytearray = heard) -> bool:
                        try:
                            data = second.recv(1000)
                        except BlockingIOError:
                            return False
                        heard.extend(data)
                        return not data

                    await eventually(hung_up)
                    assert msgpack.unpackb(heard) == {"v": 1, "refused": "another driver is connected"}
            first.send(b"still here")
            await eventually(lambda: received(events) == b"still here")
            assert links.write("gripper", b"go")
        await eventually(lambda: type(events[-1]) is LinkDown)


async def test_a_driver_is_waited_for_without_an_event_and_without_end(
    spec: LinkSpec, path: Path, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (_, events):
        await eventually(path.exists)
        assert events == []
    assert not lies_there(path)


@pytest.mark.parametrize(
    ("address", "words"),
    [("unix://relative", "must be absolute, such as unix:///run"), ("unix:///nowhere/at/all", "there is no directory")],
)
async def test_an_address_that_cannot_be_served_is_refused_as_for_any_endpoint(address: str, words: str) -> None:
    """The other rules are tested with `slipd.io.zmtp.endpoint`."""
    with pytest.raises(LinkError, match=words):
        await open_driver_socket(LinkSpec("gripper", "local", address), bytes)
