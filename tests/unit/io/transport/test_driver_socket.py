from __future__ import annotations

import asyncio
import os
import socket
import stat
from pathlib import Path
from typing import TYPE_CHECKING

import msgpack
import pytest

from slipd.errors import LinkError
from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport.driver_socket import open_driver_socket
from slipd.io.zmtp.endpoint import MAX_IPC_PATH_BYTES

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


def is_served(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        return visitor.connect_ex(str(path)) == 0


def received(events: list[Event]) -> bytes:
    return b"".join(event.data for event in events if isinstance(event, Bytes))


async def test_the_link_is_open_while_a_driver_is_connected(
    spec: LinkSpec, path: Path, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(spec) as (links, events):
        for round_ in range(3):
            await eventually(path.exists)
            assert mode(path) == 0o600
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


async def test_the_socket_of_a_dead_daemon_is_replaced(
    spec: LinkSpec, path: Path, serving: Serving, eventually: Eventually
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(path))
    async with serving(spec) as (_, events):
        await eventually(lambda: is_served(path))
        await eventually(lambda: events)


def test_a_file_that_is_not_a_socket_is_left_alone(spec: LinkSpec, path: Path) -> None:
    path.write_bytes(b"precious")
    with pytest.raises(LinkError, match="this file is not a socket"):
        asyncio.run(open_driver_socket(spec, bytes))
    assert path.read_bytes() == b"precious"


async def test_a_socket_that_another_program_serves_is_left_alone(spec: LinkSpec, path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        other.bind(str(path))
        other.listen(0)
        for _ in range(3):  # its queue fills up
            with pytest.raises(LinkError, match="another program serves this socket"):
                await open_driver_socket(spec, bytes)
    assert lies_there(path)


@pytest.fixture
def open_to_all(tmp_path: Path) -> Path:
    tmp_path.chmod(0o777)
    return tmp_path


async def test_a_directory_in_which_others_could_serve_a_driver_is_refused(open_to_all: Path) -> None:
    with pytest.raises(LinkError, match="other users may change its directory"):
        await open_driver_socket(LinkSpec("gripper", "local", f"unix://{open_to_all}/gripper"), bytes)
    assert not lies_there(open_to_all / "gripper")


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("unix://relative", "must be an absolute path of at most 107 bytes, such as unix:///run/slipd/gripper"),
        ("unix:///" + "x" * MAX_IPC_PATH_BYTES, "107 bytes"),
        ("unix:///nowhere/at/all", "there is no directory /nowhere/at"),
    ],
)
async def test_an_address_that_cannot_be_served_is_refused_with_an_example(address: str, words: str) -> None:
    with pytest.raises(LinkError, match=words):
        await open_driver_socket(LinkSpec("gripper", "local", address), bytes)


async def test_the_umask_is_left_as_it_was(spec: LinkSpec) -> None:
    before = os.umask(0o022)
    try:
        with pytest.raises(LinkError):
            await open_driver_socket(LinkSpec("gripper", "local", "unix:///proc/gripper"), bytes)
        assert os.umask(0o022) == 0o022
    finally:
        os.umask(before)
