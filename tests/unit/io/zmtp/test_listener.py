"""Which connections are accepted, how many and for how long, on real sockets; some never send anything."""

from __future__ import annotations

import asyncio
import contextlib
import resource
import socket
import struct
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd.io.zmtp import listener as listener_module
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.endpoint import Access
from slipd.io.zmtp.listener import (
    MAX_CONNECTIONS,
    RESERVE,
    Listener,
    most_connections,
    raise_descriptor_limit,
)
from slipd.io.zmtp.peer import Peer
from slipd.io.zmtp.wire import COMMAND, encode_command, encode_frame, encode_greeting, encode_metadata

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Context
    from zeromq_peers import Peer as Client

pytestmark = pytest.mark.usefixtures("loop_faults")

MOST = 8
PATIENCE_S = 30.0
TCP = "tcp://127.0.0.1:*"
LOCAL = Access(local_tcp=True)
ECHO = PeerRules(kind=b"ROUTER", serves=frozenset({b"DEALER"}), max_bytes=1000, most_queued=10)

Strangers = Callable[[str], socket.socket]
Clients = Callable[..., "Client"]


class Echo(Listener):
    """Returns every message to its sender."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint, ECHO, LOCAL)

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        peer.send(tuple(frames))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener_module, "MAX_CONNECTIONS", MOST)
    monkeypatch.setattr(listener_module, "SHARE_OF_ONE", 1.0)


@pytest.fixture
def strangers() -> Iterator[Strangers]:
    """Connections that never send anything."""
    with contextlib.ExitStack() as stack:

        def connect(endpoint: str) -> socket.socket:
            ipc = endpoint.startswith("ipc://")
            stranger = stack.enter_context(socket.socket(socket.AF_UNIX if ipc else socket.AF_INET))
            stranger.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                path, port = endpoint.removeprefix("ipc://"), endpoint.rpartition(":")[2]
                stranger.connect(path if ipc else ("127.0.0.1", int(port)))
            return stranger

        yield connect


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("kind", ["tcp", "ipc"])
async def test_as_many_connect_as_there_may_be_and_others_when_those_are_gone(
    kind: str, peer: Clients, endpoint: str, eventually: Eventually
) -> None:
    with Echo(TCP if kind == "tcp" else endpoint) as listener:
        first = [peer(zmq.DEALER, listener.endpoint) for _ in range(MOST)]
        await eventually(lambda: listener.full)
        late = peer(zmq.DEALER, listener.endpoint)
        late.socket.send(b"let me in")
        await asyncio.sleep(0.1)
        assert late.got == []
        for number, each in enumerate(first):
            each.socket.send(b"%d" % number)
            await eventually(lambda: each.got == [[b"%d" % number]])  # noqa: B023
        for each in first:
            each.socket.close()
        await eventually(lambda: late.got == [[b"let me in"]])


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("kind", ["tcp", "ipc"])
async def test_connections_without_a_handshake_keep_nobody_out(
    kind: str,
    strangers: Strangers,
    peer: Clients,
    endpoint: str,
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(listener_module, "HANDSHAKE_S", 1000.0)
    with Echo(TCP if kind == "tcp" else endpoint) as listener:
        inside = peer(zmq.DEALER, listener.endpoint)
        await eventually(lambda: listener.peers)
        for _ in range(3 * MOST):
            strangers(listener.endpoint)
        await eventually(lambda: listener.refused == 2 * MOST + 1)
        assert len(listener.peers) + len(listener._pending) == MOST
        for client in (inside, peer(zmq.DEALER, listener.endpoint)):
            client.socket.send(b"hello")
            await eventually(lambda: client.got == [[b"hello"]])  # noqa: B023


@pytest.mark.usefixtures("few")
async def test_strangers_are_dropped_by_themselves_and_others_get_in(
    strangers: Strangers, peer: Clients, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener_module, "HANDSHAKE_S", 0.2)
    with Echo(TCP) as listener:
        for _ in range(MOST):
            strangers(listener.endpoint)
        await eventually(lambda: listener.refused == MOST)
        assert not listener._pending
        client = peer(zmq.DEALER, listener.endpoint, IMMEDIATE=1)
        await eventually(lambda: client.socket.poll(0, zmq.POLLOUT))


async def test_one_process_gets_half_of_the_connections_at_most(
    strangers: Strangers, endpoint: str, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener_module, "MAX_CONNECTIONS", MOST)
    with Echo(endpoint) as listener:
        theirs = [strangers(listener.endpoint) for _ in range(MOST)]
        await eventually(lambda: listener.refused == MOST // 2)
        assert not listener.full
        command = [sys.executable, "-c", ASK, listener.endpoint]
        other = await asyncio.to_thread(subprocess.run, command, capture_output=True)
        assert other.stdout == b"hello\n"
        assert len(theirs) == MOST


ASK = """
import sys, zmq
with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
    socket.connect(sys.argv[1])
    socket.send(b"hello")
    print(socket.recv().decode())
"""


@pytest.mark.parametrize("how", ["reset", "cable cut"])
async def test_Z3_a_connection_that_is_reset_or_whose_cable_is_cut_is_forgotten(
    how: str, clients: Context, eventually: Eventually
) -> None:
    """Cut: packets of the server are dropped before the kernel of the client acknowledges them."""
    with Echo(TCP) as listener, clients.socket(zmq.DEALER) as dealer:
        monitor = dealer.get_monitor_socket(zmq.EVENT_CONNECTED | zmq.EVENT_HANDSHAKE_SUCCEEDED)
        dealer.setsockopt(zmq.RECONNECT_IVL, -1)
        dealer.connect(listener.endpoint)
        await eventually(lambda: monitor.poll(0))
        _, descriptor = struct.unpack("=Hi", monitor.recv_multipart()[0])
        await eventually(lambda: listener.peers)
        await asyncio.sleep(0.1)  # nothing may be on its way, or the kernel tries that for some seconds more
        connection = socket.socket(fileno=descriptor)
        begun_s = time.monotonic()
        if how == "reset":
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            dealer.close(linger=0)
        else:
            drop_all(connection)
        await eventually(lambda: not listener.peers)
        assert how == "reset" or time.monotonic() - begun_s > 1.0
        connection.detach()
        if not dealer.closed:
            dealer.disable_monitor()
        monitor.close()


def drop_all(connection: socket.socket) -> None:
    """Let the kernel drop all packets for a socket (a packet filter, ``SO_ATTACH_FILTER`` of socket(7))."""
    import ctypes

    program = ctypes.create_string_buffer(struct.pack("=HBBI", 0x06, 0, 0, 0))
    connection.setsockopt(socket.SOL_SOCKET, 26, struct.pack("@HP", 1, ctypes.addressof(program)))


async def test_nothing_is_left_open_behind_a_listener(
    strangers: Strangers, endpoint: str, eventually: Eventually
) -> None:
    def open_files() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    theirs = []
    before = open_files()
    for _ in range(20):
        with Echo(endpoint) as listener:
            theirs.append(strangers(endpoint))
            await eventually(lambda: listener._pending)
    assert open_files() == before + len(theirs)


@pytest.mark.parametrize(("limit", "most"), [(64, 1), (128, 16), (1024, 240), (4096, MAX_CONNECTIONS)])
def test_two_endpoints_full_of_connections_leave_the_reserve(
    limit: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener_module.resource, "getrlimit", lambda _: (limit, limit))
    assert most_connections() == most
    assert limit <= RESERVE or 2 * most <= limit - RESERVE


def test_the_soft_limit_is_raised_to_the_hard_one() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(256, hard), hard))
        raise_descriptor_limit()
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (hard, hard)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


DAEMON = """
import asyncio, resource, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (128, 128))
from slipd.io.bus.publisher import Publisher
from slipd.io.bus.request_server import RequestServer
from slipd.io.zmtp.endpoint import Access

async def main():
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    opened, access = [], Access(local_tcp=True)
    with Publisher("tcp://127.0.0.1:*", access) as publisher, RequestServer(
        "tcp://127.0.0.1:*", lambda *_: None, access
    ) as server:
        print(publisher.endpoint, server.endpoint, flush=True)
        left = 100  # once all are connected
        while left:
            left -= reader.at_eof()
            try:
                files = [open("/dev/null") for _ in range(16)]
                for file in files:
                    file.close()
                opened.append("y")
            except OSError:
                opened.append("n")
            await asyncio.sleep(0.001)
    print("".join(opened), flush=True)

asyncio.run(main())
"""


def test_Z4_600_idle_connections_never_keep_a_daemon_with_128_descriptors_from_opening_files(
    strangers: Strangers,
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DAEMON], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as daemon:
        assert daemon.stdout is not None
        endpoints = daemon.stdout.readline().split()
        for number in range(600):
            strangers(endpoints[number % 2])
        opened, _ = daemon.communicate("")
    assert opened.strip().strip("y") == "", opened
    assert len(opened) > 100


class Stalled:
    """A listener, and a client for which more messages wait than the kernel takes."""

    def __init__(self, listener: Listener, client: socket.socket) -> None:
        self.client, self.listener = client, listener
        (self.peer,) = listener.peers

    async def look(self) -> str:
        return await self.listener.stall(PATIENCE_S)

    def read_all(self) -> None:
        """Read what the kernel has."""
        with contextlib.suppress(BlockingIOError):
            while self.client.recv(65536):
                pass


@pytest.fixture
async def stalled(endpoint: str, eventually: Eventually) -> AsyncIterator[Stalled]:
    rules = PeerRules(kind=b"XPUB", serves=frozenset({b"SUB"}), max_bytes=100, most_queued=1000, drops_oldest=True)
    ready = encode_command(b"READY", encode_metadata({b"Socket-Type": b"SUB"}))
    with Listener(endpoint, rules) as listener, socket.socket(socket.AF_UNIX) as client:
        client.connect(endpoint.removeprefix("ipc://"))
        client.sendall(encode_greeting(b"NULL", as_server=False) + encode_frame(ready, COMMAND))
        client.setblocking(False)
        await eventually(lambda: listener.peers)
        found = Stalled(listener, client)
        for _ in range(900):
            found.peer.send((bytes(50_000),))
        assert found.peer.waiting > 500
        yield found


async def test_P2_messages_that_wait_are_a_stall_only_if_the_client_reads_and_none_is_sent(
    stalled: Stalled, eventually: Eventually
) -> None:
    assert [await stalled.look() for _ in range(3)] == [""] * 3, "it does not read"
    for _ in range(3):
        stalled.read_all()
        assert not await stalled.look()
    loop, peer = asyncio.get_running_loop(), stalled.peer
    assert peer.waiting
    loop.remove_writer(peer.fileno)
    stalled.read_all()
    assert [await stalled.look(), await stalled.look()] == ["", "messages are not sent to clients that read (1)"]
    loop.add_writer(peer.fileno, peer.flush)
    sent_bytes = peer.sent_bytes
    await eventually(lambda: peer.sent_bytes > sent_bytes)
    assert not await stalled.look()


async def test_P2_a_listener_that_neither_greets_nor_accepts_is_stalled(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def never(*_: object) -> bool:
        return False

    with Echo(endpoint) as listener:
        assert not await listener.stall(PATIENCE_S)
        monkeypatch.setattr(listener_module, "greets", never)
        assert await listener.stall(PATIENCE_S) == f"{endpoint} greets no client"
        listener.accepted += 1
        assert not await listener.stall(PATIENCE_S)


async def test_a_reused_descriptor_of_a_closed_peer_is_left_alone(endpoint: str, eventually: Eventually) -> None:
    """A connection is closed by its socket object, because its descriptor may have been reused."""
    with contextlib.ExitStack() as stack, Echo(endpoint) as listener:
        first, *heirs = (stack.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(4))
        first.connect(endpoint.removeprefix("ipc://"))
        await eventually(lambda: listener._pending)
        (gone,) = listener._pending
        first.shutdown(socket.SHUT_RDWR)  # keeps its own descriptor
        await eventually(lambda: gone.closed)
        for each in heirs:
            each.connect(endpoint.removeprefix("ipc://"))
        await eventually(lambda: len(listener._pending) == len(heirs))
        assert gone.fileno in {each.fileno for each in listener._pending}
        gone.close("once more")
        gone.flush()
        assert not gone.send((b"to nobody",))
        await asyncio.sleep(0.05)
        assert len(listener._pending) == len(heirs)
