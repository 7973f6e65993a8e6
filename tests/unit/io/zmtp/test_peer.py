"""One connection, seen from outside: libzmq clients, and plain sockets that violate the protocol."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.loop_time_accounts import TimeAccount, TimeAccounts
from slipd.io.zmtp.peer import MOST_FRAMES, Peer, PeerRules
from slipd.io.zmtp.wire import COMMAND, MORE, encode_command, encode_frame, encode_greeting, encode_metadata

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Peer as Client

pytestmark = pytest.mark.usefixtures("loop_faults")

KEPT = 5
RULES = PeerRules(
    kind=b"ROUTER",
    serves=frozenset({b"DEALER", b"SUB"}),
    max_bytes=1000,
    max_frames=2,
    most_queued=KEPT,
)
GREETING = encode_greeting(b"NULL", as_server=False)
READY = encode_command(b"READY", encode_metadata({b"Socket-Type": b"DEALER"}))
INTRODUCTION = GREETING + encode_frame(READY, COMMAND)
PING = encode_frame(encode_command(b"PING", b"\0\0mark"), COMMAND)
PONG = encode_frame(encode_command(b"PONG", b"mark"), COMMAND)


class Server:
    """Keep the messages of its peers."""

    def __init__(self, endpoint: str, rules: PeerRules = RULES) -> None:
        self.got: list[list[bytes]] = []
        self.listener = Listener(endpoint, rules, lambda _, frames: self.got.append(frames))

    @property
    def peer(self) -> Peer:
        (peer,) = self.listener.peers
        return peer


@pytest.fixture
def raw(endpoint: str) -> Iterator[Callable[[bytes], socket.socket]]:
    """Open a plain connection and send bytes."""
    with contextlib.ExitStack() as stack:

        def connect(data: bytes) -> socket.socket:
            connection = stack.enter_context(socket.socket(socket.AF_UNIX))
            connection.connect(endpoint.removeprefix("ipc://"))
            connection.sendall(data)
            connection.setblocking(False)
            return connection

        yield connect


Raw = Callable[[bytes], socket.socket]


def received(connection: socket.socket) -> bytes:
    try:
        return connection.recv(65536)
    except BlockingIOError:
        return b""


async def test_bytes_may_arrive_one_by_one(endpoint: str, raw: Raw, eventually: Eventually) -> None:
    server = Server(endpoint)
    with server.listener:
        connection = raw(b"")
        for byte in INTRODUCTION + encode_frame(b"hello") + encode_frame(bytes(500)):
            connection.send(bytes((byte,)))
            if byte % 16 == 0:
                await asyncio.sleep(0)
        await eventually(lambda: server.got == [[b"hello"], [bytes(500)]])


@pytest.mark.parametrize(
    "data",
    [
        b"GET / HTTP/1.1\r\n".ljust(64),
        GREETING + encode_frame(b"before the handshake"),
        GREETING + encode_frame(b"\x09READY", COMMAND),
        GREETING + encode_frame(encode_command(b"READY"), COMMAND),
        GREETING + encode_frame(encode_command(b"READY", encode_metadata({b"Socket-Type": b"PUB"})), COMMAND),
        GREETING
        + encode_frame(
            encode_command(b"READY", encode_metadata({b"Socket-Type": b"DEALER", b"Identity": b"\0own"})), COMMAND
        ),
        INTRODUCTION + b"\x80\x00",
        INTRODUCTION + encode_frame(bytes(1001)),
        INTRODUCTION + encode_frame(encode_command(b"ERROR", b"\x00"), COMMAND),
        INTRODUCTION + encode_frame(b"part", MORE) * (MOST_FRAMES + 1),
    ],
    ids=["http", "early", "cut", "no type", "PUB", "reserved name", "flags", "long", "error", "endless"],
)
async def test_who_breaks_the_protocol_is_disconnected(
    data: bytes, endpoint: str, raw: Raw, eventually: Eventually
) -> None:
    server = Server(endpoint)
    with server.listener:
        raw(data)
        await eventually(lambda: server.listener.refused == 1)
        assert not server.listener.peers
        assert server.got == []
        connection = raw(INTRODUCTION + encode_frame(b"another"))
        await eventually(lambda: server.got == [[b"another"]])
        assert connection


async def test_of_a_long_message_the_first_frames_are_kept_and_the_next_message_is_whole(
    endpoint: str, peer: Callable[..., Client], eventually: Eventually
) -> None:
    server = Server(endpoint)
    with server.listener:
        client = peer(zmq.DEALER, endpoint)
        client.socket.send_multipart([b"%d" % number for number in range(MOST_FRAMES)])
        client.socket.send(b"next")
        await eventually(lambda: len(server.got) == 2)
    assert server.got == [[b"0", b"1", b"2"], [b"next"]]


async def test_a_ping_is_answered_and_a_stock_client_with_heartbeats_stays(
    endpoint: str, raw: Raw, peer: Callable[..., Client], eventually: Eventually
) -> None:
    server = Server(endpoint)
    with server.listener:
        stock = peer(zmq.DEALER, endpoint, HEARTBEAT_IVL=10, HEARTBEAT_TIMEOUT=60_000, RECONNECT_IVL=-1)
        plain = raw(INTRODUCTION + PING)
        heard = b""

        def pong() -> bool:
            nonlocal heard
            heard += received(plain)
            return heard.endswith(PONG)

        await eventually(pong)
        await asyncio.sleep(0.1)
        stock.socket.send(b"still there")
        await eventually(lambda: server.got == [[b"still there"]])


@pytest.mark.parametrize("drops_oldest", [False, True])
async def test_what_a_peer_does_not_read_is_bounded_and_pings_add_nothing(
    drops_oldest: bool, endpoint: str, raw: Raw, eventually: Eventually
) -> None:
    rules = PeerRules(
        kind=b"XPUB", serves=frozenset({b"DEALER"}), max_bytes=1000, most_queued=KEPT, drops_oldest=drops_oldest
    )
    server = Server(endpoint, rules)
    with server.listener:
        connection = raw(INTRODUCTION)
        await eventually(lambda: server.listener.peers)
        sent = [server.peer.send((b"%06d" % number + bytes(50_000),)) for number in range(100)]
        assert server.peer.waiting == KEPT + 1
        rest = len(server.peer._outbox._rest)
        connection.send(PING * 100)
        await asyncio.sleep(0.05)
        assert len(server.peer._outbox._rest) == rest
        heard = bytearray()

        def all_heard() -> bool:
            heard.extend(received(connection))
            return server.peer.waiting == 0 and not received(connection)

        await eventually(all_heard)
        last = bytes(heard)
    numbers = [int(last[at : at + 6]) for at in range(len(last) - 6) if last[at : at + 6].isdigit()]
    if drops_oldest:
        assert all(sent)
        assert numbers[-KEPT:] == list(range(100 - KEPT, 100))
    else:
        assert sum(sent) == len(numbers) < 100
        assert numbers == list(range(len(numbers)))


async def test_a_flood_waits_at_its_sender_and_others_have_their_turns(
    endpoint: str, raw: Raw, peer: Callable[..., Client], eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With almost no share of the time: unread bytes stay in the kernel, however much the sender sends."""
    monkeypatch.setattr(TimeAccounts, "of", lambda _, name: TimeAccount(name, 1e-3))
    server = Server(endpoint)
    with server.listener:
        flood = raw(INTRODUCTION)
        await eventually(lambda: server.listener.peers)
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
