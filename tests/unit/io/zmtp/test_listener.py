"""Which connections are accepted, how many and for how long, on real sockets; some never send anything."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import resource
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable

import pytest
import zmq
from loop_waits import PATIENCE_S, eventually, open_files
from zeromq_peers import Clients, Plain, introduction, read

from slipd.io.zmtp import listener as listener_module
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.endpoint import Access
from slipd.io.zmtp.listener import MAX_CONNECTIONS, RESERVE, Listener, most_connections, raise_descriptor_limit
from slipd.io.zmtp.peer import Peer

pytestmark = pytest.mark.usefixtures("loop_faults")

MOST = 8
TCP = "tcp://127.0.0.1:*"
ECHO = PeerRules(kind=b"ROUTER", serves=frozenset({b"DEALER"}), max_bytes=1000, most_queued=10)


class Echo(Listener):
    """Returns every message to its sender."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint, ECHO, Access(local_tcp=True))

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        peer.send(tuple(frames))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener_module, "MAX_CONNECTIONS", MOST)
    monkeypatch.setattr(listener_module, "SHARE_OF_ONE", 1.0)


@pytest.fixture(params=["tcp", "ipc"])
def address(request: pytest.FixtureRequest, endpoint: str) -> str:
    return TCP if request.param == "tcp" else endpoint


async def test_as_many_connect_as_there_may_be_and_others_when_those_are_gone(
    address: str, few: None, peer: Clients
) -> None:
    with Echo(address) as listener:
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


async def test_connections_without_a_handshake_keep_nobody_out(
    address: str, few: None, plain: Plain, peer: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener_module, "HANDSHAKE_S", 1000.0)
    with Echo(address) as listener:
        inside = peer(zmq.DEALER, listener.endpoint)
        await eventually(lambda: listener.peers)
        for number in range(3 * MOST):  # over TCP, each from another address
            plain(listener.endpoint, source=f"127.0.0.{2 + number}")
        await eventually(lambda: listener.refused == 2 * MOST + 1)
        assert len(listener.peers) + len(listener._pending) == MOST
        for client in (inside, peer(zmq.DEALER, listener.endpoint)):
            client.socket.send(b"hello")
            await eventually(lambda: client.got == [[b"hello"]])  # noqa: B023


async def test_strangers_are_dropped_by_themselves_and_others_get_in(
    few: None, plain: Plain, peer: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener_module, "HANDSHAKE_S", 0.2)
    with Echo(TCP) as listener:
        for _ in range(MOST):
            plain(listener.endpoint)
        await eventually(lambda: listener.refused == MOST)
        assert not listener._pending
        await eventually(peer(zmq.DEALER, listener.endpoint, IMMEDIATE=1).can_send)


ASK = """
import sys, zmq
with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
    socket.connect(sys.argv[1])
    socket.send(b"hello")
    print(socket.recv().decode())
"""


async def test_one_process_gets_half_of_the_connections_at_most(
    plain: Plain, endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener_module, "MAX_CONNECTIONS", MOST)
    with Echo(endpoint) as listener:
        for _ in range(MOST):
            plain(listener.endpoint)
        await eventually(lambda: listener.refused == MOST // 2)
        assert not listener.full
        other = await asyncio.to_thread(subprocess.run, [sys.executable, "-c", ASK, endpoint], capture_output=True)
        assert other.stdout == b"hello\n"


def reset(connection: socket.socket) -> None:
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def cut(connection: socket.socket) -> None:
    """Let the kernel drop all packets for a socket (a packet filter, ``SO_ATTACH_FILTER`` of socket(7))."""
    program = ctypes.create_string_buffer(struct.pack("=HBBI", 0x06, 0, 0, 0))
    connection.setsockopt(socket.SOL_SOCKET, 26, struct.pack("@HP", 1, ctypes.addressof(program)))


@pytest.mark.parametrize(("end", "least_s"), [(reset, 0.0), (cut, 1.0)])
async def test_Z3_a_connection_that_is_reset_or_whose_cable_is_cut_is_forgotten(
    end: Callable[[socket.socket], None], least_s: float, plain: Plain
) -> None:
    """Cut: packets of the server are dropped before the kernel of the client acknowledges them."""
    with Echo(TCP) as listener:
        connection = plain(listener.endpoint)
        await eventually(lambda: listener._pending)
        connection.sendall(introduction(b"DEALER"))
        await eventually(lambda: listener.peers)
        await asyncio.sleep(0.1)  # nothing may be on its way, or the kernel tries that for some seconds more
        begun_s = time.monotonic()
        end(connection)
        await eventually(lambda: not listener.peers)
        assert time.monotonic() - begun_s > least_s


async def test_nothing_is_left_open_behind_a_listener(plain: Plain, endpoint: str) -> None:
    before = open_files()
    for _ in range(20):
        with Echo(endpoint) as listener:
            plain(endpoint)
            await eventually(lambda: listener._pending)
    assert open_files() == before + 20, "those of the clients"


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
from slipd.io.publisher import Publisher
from slipd.io.request_server import RequestServer
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


def test_Z4_600_idle_connections_never_keep_a_daemon_with_128_descriptors_from_opening_files(plain: Plain) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DAEMON], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as daemon:
        endpoints = daemon.stdout.readline().split()
        for number in range(600):
            plain(endpoints[number % 2])
        opened, _ = daemon.communicate("")
    assert opened.strip().strip("y") == "", opened
    assert len(opened) > 100


async def test_P2_messages_that_wait_are_a_stall_only_if_the_client_reads_and_none_is_sent(
    plain: Plain, endpoint: str
) -> None:
    rules = PeerRules(kind=b"XPUB", serves=frozenset({b"SUB"}), max_bytes=100, most_queued=1000, drops_oldest=True)
    loop = asyncio.get_running_loop()
    with Listener(endpoint, rules) as listener:
        client = plain(endpoint, introduction(b"SUB"))
        await eventually(lambda: listener.peers)
        (peer,) = listener.peers
        for _ in range(900):
            peer.send((bytes(50_000),))
        assert [await listener.stall(PATIENCE_S) for _ in range(3)] == [""] * 3, "it does not read"
        for _ in range(3):
            read(client)
            assert not await listener.stall(PATIENCE_S)
        assert peer.protocol.waiting
        loop.remove_writer(peer.fileno)
        read(client)
        stalled = f"{endpoint} does not send to clients that read (1)"
        assert [await listener.stall(PATIENCE_S) for _ in range(2)] == ["", stalled]
        loop.add_writer(peer.fileno, peer.flush)
        sent_bytes = peer.sent_bytes
        await eventually(lambda: peer.sent_bytes > sent_bytes)
        assert not await listener.stall(PATIENCE_S)


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


async def test_a_reused_descriptor_of_a_closed_peer_is_left_alone(endpoint: str, plain: Plain) -> None:
    """A connection is closed by its socket object, because its descriptor may have been reused."""
    with contextlib.ExitStack() as stack, Echo(endpoint) as listener:
        first = plain(endpoint)
        heirs = [stack.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(3)]
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
