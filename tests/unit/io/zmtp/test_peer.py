"""One connection, seen from outside: libzmq clients, and plain sockets that do not read or send too much."""

from __future__ import annotations

import asyncio
import contextlib
import re

import pytest
import zmq
from loop_waits import eventually
from zeromq_peers import Clients, Plain, introduction, read

from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import Peer, TimeAccount, TimeAccounts
from slipd.io.zmtp.wire import COMMAND, encode_command, encode_frame

pytestmark = pytest.mark.usefixtures("loop_faults")

KEPT = 5
RULES = PeerRules(b"ROUTER", frozenset({b"DEALER"}), max_bytes=1000, max_frames=2, most_queued=KEPT)
INTRODUCTION = introduction(b"DEALER")
PING = encode_frame(encode_command(b"PING", b"\0\0mark"), COMMAND)
PONG = encode_frame(encode_command(b"PONG", b"mark"), COMMAND)


class Server(Listener):
    """Keeps the messages of its peers."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint, RULES)
        self.got: list[list[bytes]] = []

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        self.got.append(frames)


async def test_all_pings_of_a_peer_that_reads_are_answered(endpoint: str, plain: Plain) -> None:
    heard = bytearray()
    with Server(endpoint):
        connection = plain(endpoint, INTRODUCTION + PING * 100)
        await eventually(lambda: heard.extend(read(connection)) or heard.count(PONG) == 100)


async def test_what_a_peer_does_not_read_is_bounded_and_pings_add_nothing(endpoint: str, plain: Plain) -> None:
    heard = bytearray()
    with Server(endpoint) as server:
        connection = plain(endpoint, INTRODUCTION)
        await eventually(lambda: server.peers)
        (slow,) = server.peers
        sent = sum(slow.send((b"%06d" % number + bytes(50_000),)) for number in range(100))
        assert slow.protocol.waiting == KEPT + 1
        connection.send(PING * 100)
        await asyncio.sleep(0.05)
        await eventually(lambda: heard.extend(read(connection)) or (not slow.protocol.waiting and not read(connection)))
    assert [int(number) for number in re.findall(rb"\d{6}", heard)] == list(range(sent))
    assert PONG not in heard


async def test_a_flood_waits_at_its_sender_and_others_have_their_turns(
    endpoint: str, plain: Plain, peer: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With almost no share of the time: unread bytes stay in the kernel, however much the sender sends."""
    monkeypatch.setattr(TimeAccounts, "of", lambda _, name: TimeAccount(name, 1e-3))
    frame, sent = encode_frame(bytes(1000)), 0
    with Server(endpoint) as server:
        flood = plain(endpoint, INTRODUCTION)
        await eventually(lambda: server.peers)
        for _ in range(200):
            with contextlib.suppress(BlockingIOError):
                sent += flood.send((frame * 1000)[sent % len(frame) :])
            await asyncio.sleep(0)
        assert sent < len(frame) * 1000 * 50  # of 200 times that
        calm = peer(zmq.DEALER, endpoint)
        calm.socket.send(b"calm")
        await eventually(lambda: [b"calm"] in server.got)
