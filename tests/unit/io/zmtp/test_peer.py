"""One connection, seen from outside: libzmq clients, and plain sockets that do not read or send too much."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.loop_time_accounts import TimeAccount, TimeAccounts
from slipd.io.zmtp.peer import Peer
from slipd.io.zmtp.wire import COMMAND, encode_command, encode_frame, encode_greeting, encode_metadata

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Peer as Client

pytestmark = pytest.mark.usefixtures("loop_faults")

KEPT = 5
RULES = PeerRules(b"ROUTER", frozenset({b"DEALER"}), max_bytes=1000, max_frames=2, most_queued=KEPT)
READY = encode_command(b"READY", encode_metadata({b"Socket-Type": b"DEALER"}))
INTRODUCTION = encode_greeting(b"NULL", as_server=False) + encode_frame(READY, COMMAND)
PING = encode_frame(encode_command(b"PING", b"\0\0mark"), COMMAND)
PONG = encode_frame(encode_command(b"PONG", b"mark"), COMMAND)

Raw = Callable[[bytes], socket.socket]


class Server(Listener):
    """Keeps the messages of its peers."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint, RULES)
        self.got: list[list[bytes]] = []

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        self.got.append(frames)


@pytest.fixture
def server(endpoint: str) -> Server:
    return Server(endpoint)


@pytest.fixture
def raw(endpoint: str) -> Iterator[Raw]:
    """Open a plain connection and send bytes."""
    with contextlib.ExitStack() as stack:

        def connect(data: bytes) -> socket.socket:
            connection = stack.enter_context(socket.socket(socket.AF_UNIX))
            connection.connect(endpoint.removeprefix("ipc://"))
            connection.sendall(data)
            connection.setblocking(False)
            return connection

        yield connect


def received(connection: socket.socket) -> bytes:
    try:
        return connection.recv(65536)
    except BlockingIOError:
        return b""


async def test_who_breaks_the_protocol_is_disconnected_and_the_next_is_served(
    server: Server, raw: Raw, eventually: Eventually
) -> None:
    with server:
        wrong = raw(INTRODUCTION + encode_frame(bytes(1001)))
        await eventually(lambda: server.refused == 1)
        heard = b""
        with contextlib.suppress(ConnectionError):
            while data := wrong.recv(65536):
                heard += data
        assert heard.startswith(b"\xff")
        assert not server.peers
        connection = raw(INTRODUCTION + encode_frame(b"another"))
        await eventually(lambda: server.got == [[b"another"]])
        connection.close()
        await eventually(lambda: not server.peers)


async def test_a_stock_client_sends_long_messages_and_its_heartbeats_are_answered(
    server: Server, peer: Callable[..., Client], endpoint: str, eventually: Eventually
) -> None:
    with server:
        client = peer(zmq.DEALER, endpoint, HEARTBEAT_IVL=10, HEARTBEAT_TIMEOUT=60_000, RECONNECT_IVL=-1)
        client.socket.send_multipart([b"%d" % number for number in range(10_000)])
        await eventually(lambda: server.got == [[b"0", b"1", b"2"]])
        await asyncio.sleep(0.1)
        client.socket.send(b"still there")
        await eventually(lambda: server.got[1:] == [[b"still there"]])


async def test_all_pings_of_a_peer_that_reads_are_answered(server: Server, raw: Raw, eventually: Eventually) -> None:
    with server:
        connection, heard = raw(INTRODUCTION + PING * 100), bytearray()
        await eventually(lambda: heard.extend(received(connection)) or heard.count(PONG) == 100)


async def test_what_a_peer_does_not_read_is_bounded_and_pings_add_nothing(
    server: Server, raw: Raw, eventually: Eventually
) -> None:
    with server:
        connection = raw(INTRODUCTION)
        await eventually(lambda: server.peers)
        (slow,) = server.peers
        sent = sum(slow.send((b"%06d" % number + bytes(50_000),)) for number in range(100))
        assert slow.waiting == KEPT + 1
        connection.send(PING * 100)
        await asyncio.sleep(0.05)
        heard = bytearray()
        await eventually(lambda: heard.extend(received(connection)) or (not slow.waiting and not received(connection)))
    assert [int(heard[at : at + 6]) for at in range(len(heard) - 6) if heard[at : at + 6].isdigit()] == list(
        range(sent)
    )
    assert PONG not in heard


async def test_a_flood_waits_at_its_sender_and_others_have_their_turns(
    server: Server,
    raw: Raw,
    peer: Callable[..., Client],
    endpoint: str,
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With almost no share of the time: unread bytes stay in the kernel, however much the sender sends."""
    monkeypatch.setattr(TimeAccounts, "of", lambda _, name: TimeAccount(name, 1e-3))
    with server:
        flood = raw(INTRODUCTION)
        await eventually(lambda: server.peers)
        frame, sent = encode_frame(bytes(1000)), 0
        data = frame * 1000
        for _ in range(200):
            with contextlib.suppress(BlockingIOError):
                sent += flood.send(data[sent % len(frame) :])
            await asyncio.sleep(0)
        assert sent < len(data) * 50  # of 200 times that
        calm = peer(zmq.DEALER, endpoint)
        calm.socket.send(b"calm")
        await eventually(lambda: [b"calm"] in server.got)
