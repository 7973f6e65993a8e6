"""Sockets for other processes: readings that are pushed, and the driver of a gripper (see also test_streams)."""

from __future__ import annotations

import asyncio
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import msgpack
import pytest
import zmq

from slipd.errors import LinkError
from slipd.events import Bytes, Event, LinkSpec, LinkUp
from slipd.io.transport.local_sockets import MAX_MESSAGE_BYTES, open_driver_socket, open_push_socket

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually

PATIENCE_S = 30.0

Pusher = Callable[[], zmq.Socket[bytes]]


@pytest.fixture
def spec(tmp_path: Path) -> LinkSpec:
    return LinkSpec("left.wrench", "external", f"ipc://{tmp_path}/readings")


@pytest.fixture
def pusher(spec: LinkSpec) -> Iterator[Pusher]:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    all_made = []

    def connect() -> zmq.Socket[bytes]:
        made = context.socket(zmq.PUSH)
        made.setsockopt(zmq.LINGER, 0)
        made.connect(spec.address)
        all_made.append(made)
        return made

    yield connect
    for made in all_made:
        made.close()
    context.term()


def received(events: list[Event]) -> list[bytes]:
    return [event.data for event in events if isinstance(event, Bytes)]


async def test_each_message_is_delivered_as_one_piece(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    sent = [bytes([n % 256]) * n for n in range(500)]
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        first = pusher()
        for data in sent:
            first.send(data)
        await eventually(lambda: len(received(events)) == len(sent))
        pusher().send(b"of another")
        await eventually(lambda: len(received(events)) > len(sent))
    assert events[0] == LinkUp("left.wrench", spec.address)
    assert received(events) == [*sent, b"of another"]


async def test_a_pusher_that_waits_for_the_daemon_is_read_when_it_comes(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    pusher().send(b"early")
    for _ in range(2):
        async with serving(spec) as (_, events):
            await eventually(lambda: received(events))
        pusher().send(b"between two runs")


async def test_a_message_that_is_too_long_is_refused_and_others_are_delivered(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        pusher().send(bytes(MAX_MESSAGE_BYTES + 1))
        pusher().send(bytes(MAX_MESSAGE_BYTES))
        await eventually(lambda: received(events))
    assert [len(data) for data in received(events)] == [MAX_MESSAGE_BYTES]


async def test_of_a_message_in_many_parts_no_more_than_two_are_judged(
    spec: LinkSpec, pusher: Pusher, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        push = pusher()
        push.send_multipart([b"part"] * 1000)
        push.send(b"whole")
        await eventually(lambda: b"whole" in received(events))
    assert received(events) == [b"part", b"part", b"whole"]


async def test_a_failing_consumer_of_readings_gets_no_more_of_them(spec: LinkSpec, pusher: Pusher) -> None:
    got = []

    def fail(data: bytes) -> None:
        got.append(data)
        raise ArithmeticError("a fault of ours")

    push = pusher()
    for data in (b"1", b"2"):
        push.send(data)
    connection = await open_push_socket(spec, fail)
    with pytest.raises(ArithmeticError):
        await connection.until_lost()
    await connection.close()
    assert got == [b"1"]


async def test_a_missing_directory_is_reported(serving: Serving, eventually: Eventually, tmp_path: Path) -> None:
    spec = LinkSpec("left.wrench", "external", f"ipc://{tmp_path}/none/readings")
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        assert f"there is no directory {tmp_path}/none" in events[0].reason
        (tmp_path / "none").mkdir()
        await eventually(lambda: isinstance(events[-1], LinkUp))


async def test_a_write_is_refused_and_counted(spec: LinkSpec, serving: Serving, eventually: Eventually) -> None:
    async with serving(spec) as (links, events):
        await eventually(lambda: events)
        assert not links.write("left.wrench", b"zero")
        assert links.refused_writes == {"left.wrench": 1}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "gripper"


@pytest.fixture
def driver_spec(path: Path) -> LinkSpec:
    return LinkSpec("gripper", "local", f"unix://{path}")


def lies_there(path: Path) -> bool:
    return path.exists()


def connect(path: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.settimeout(PATIENCE_S)
    made.connect(str(path))
    return made


async def test_a_second_driver_is_turned_away_while_the_first_lives(
    driver_spec: LinkSpec, path: Path, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(driver_spec) as (links, events):
        await eventually(path.exists)
        assert mode(path) == 0o700
        assert events == []
        with connect(path) as first:
            await eventually(lambda: events)
            for _ in range(3):
                with connect(path) as second:
                    notice = await asyncio.to_thread(second.recv, 1000)
                    assert msgpack.unpackb(notice) == {"v": 1, "refused": "another driver is connected"}
                    assert await asyncio.to_thread(second.recv, 1000) == b""
            first.send(b"still here")
            await eventually(lambda: received(events) == [b"still here"])
            assert links.write("gripper", b"go")
    assert not lies_there(path)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize(
    ("address", "words"),
    [("unix://relative", "must be absolute, such as unix:///run"), ("unix:///nowhere/at/all", "there is no directory")],
)
async def test_an_address_that_cannot_be_served_is_refused_as_for_any_endpoint(address: str, words: str) -> None:
    """The other rules are tested with `slipd.io.zmtp.endpoint`."""
    with pytest.raises(LinkError, match=words):
        await open_driver_socket(LinkSpec("gripper", "local", address), bytes)
