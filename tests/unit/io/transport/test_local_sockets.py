"""Sockets for other processes: readings that are pushed, and the driver of a gripper (see also test_streams)."""

from __future__ import annotations

import asyncio
import socket
import stat
from pathlib import Path

import msgpack
import pytest
import zmq
from link_ends import pieces, serving
from loop_waits import PATIENCE_S, eventually
from zeromq_peers import Clients

from slipd.errors import LinkError
from slipd.events import LinkSpec, LinkUp
from slipd.io.transport.sockets import MAX_MESSAGE_BYTES, open_driver_socket

pytestmark = pytest.mark.usefixtures("loop_faults")


async def test_each_message_is_delivered_as_one_piece_and_nothing_is_written(endpoint: str, peer: Clients) -> None:
    """Of a message in many parts no more than two are judged, and one that is too long is refused."""
    sent = [*(bytes([n % 256]) * n for n in range(500)), bytes(MAX_MESSAGE_BYTES)]
    first = peer(zmq.PUSH, endpoint).socket  # it waits for the daemon
    async with serving(LinkSpec("left.wrench", "external", endpoint)) as (links, events):
        for data in sent:
            first.send(data)
        first.send_multipart([b"part"] * 1000)
        await eventually(lambda: len(pieces(events)) == len(sent) + 2)
        first.send(bytes(MAX_MESSAGE_BYTES + 1))
        peer(zmq.PUSH, endpoint).socket.send(b"of another")
        await eventually(lambda: pieces(events)[-1] == b"of another")
        assert not links.write("left.wrench", b"zero")
    assert links.losses == {"left.wrench": (1, 0)}
    assert events[0] == LinkUp("left.wrench", endpoint)
    assert pieces(events) == [*sent, b"part", b"part", b"of another"]


def connect(path: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.settimeout(PATIENCE_S)
    made.connect(str(path))
    return made


async def test_a_second_driver_is_turned_away_while_the_first_lives(tmp_path: Path, quick: None) -> None:
    path = tmp_path / "gripper"
    async with serving(LinkSpec("gripper", "local", f"unix://{path}"), waits=False) as (links, events):
        await eventually(path.exists)
        assert (stat.S_IMODE(path.stat().st_mode), events) == (0o700, [])
        with connect(path) as first:
            await eventually(lambda: events)
            for _ in range(3):
                with connect(path) as second:
                    notice = await asyncio.to_thread(second.recv, 1000)
                    assert msgpack.unpackb(notice) == {"v": 1, "refused": "another driver is connected"}
                    assert await asyncio.to_thread(second.recv, 1000) == b""
            first.send(b"still here")
            await eventually(lambda: pieces(events, "gripper") == [b"still here"])
            assert links.write("gripper", b"go")
    await eventually(lambda: not path.exists())


@pytest.mark.parametrize(
    ("address", "words"),
    [("unix://relative", "must be absolute, such as unix:///run"), ("unix:///nowhere/at/all", "there is no directory")],
)
async def test_an_address_that_cannot_be_served_is_refused_as_for_any_endpoint(address: str, words: str) -> None:
    """The other rules are tested with `slipd.io.zmtp.endpoint`."""
    with pytest.raises(LinkError, match=words):
        await open_driver_socket(LinkSpec("gripper", "local", address), bytes)
