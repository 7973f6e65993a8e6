from __future__ import annotations

import asyncio
import contextlib
import resource
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd.zeromq import gate as gate_module
from slipd.zeromq.draining import Drain
from slipd.zeromq.endpoint import Access, open_server
from slipd.zeromq.gate import (
    BACKLOG,
    MAX_CONNECTIONS,
    RESERVE,
    Gate,
    drop_all,
    most_connections,
    raise_descriptor_limit,
)

if TYPE_CHECKING:
    from zeromq_peers import Context, Eventually, Peer

pytestmark = pytest.mark.usefixtures("loop_faults")

MOST = 8


@pytest.fixture
def server(context: Context) -> Iterator[tuple[zmq.Socket[bytes], str]]:
    server, endpoint = open_server(context, zmq.ROUTER, "tcp://127.0.0.1:*", {}, Access(local_tcp=True))
    yield server, endpoint
    server.close()


@pytest.fixture
def strangers() -> Iterator[Callable[[str], socket.socket]]:
    """Connections that never say a word."""
    with contextlib.ExitStack() as stack:

        def connect(endpoint: str) -> socket.socket:
            stranger = stack.enter_context(socket.socket())
            stranger.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                stranger.connect(("127.0.0.1", int(endpoint.rpartition(":")[2])))
            return stranger

        yield connect


async def test_the_gate_closes_on_too_many_and_opens_when_they_are_gone(
    server: tuple[zmq.Socket[bytes], str], strangers: Callable[[str], socket.socket], eventually: Eventually
) -> None:
    with Gate(server[0], MOST) as gate:
        first = [strangers(server[1]) for _ in range(MOST)]
        await eventually(lambda: gate.closed)
        kept_out = strangers(server[1])
        await asyncio.sleep(0.1)
        with pytest.raises(OSError, match="not connected"):
            kept_out.getpeername()
        for each in first:
            each.close()
        await eventually(lambda: not gate.closed)
        late = strangers(server[1])
        await eventually(lambda: _is_connected(late))
        assert gate.times_closed == 1


def _is_connected(stranger: socket.socket) -> bool:
    with contextlib.suppress(OSError):
        stranger.getpeername()
        return True
    return False


async def test_a_closed_gate_costs_those_who_are_in_nothing(
    server: tuple[zmq.Socket[bytes], str],
    strangers: Callable[[str], socket.socket],
    peer: Callable[..., Peer],
    eventually: Eventually,
) -> None:
    router, endpoint = server
    drain = Drain(router, lambda frames: router.send_multipart(frames), max_frames=2)
    drain.start()
    with Gate(router, MOST) as gate:
        inside = peer(zmq.DEALER, endpoint)
        inside.socket.send(b"0")
        await eventually(lambda: inside.got)
        for _ in range(MOST):
            strangers(endpoint)
        await eventually(lambda: gate.closed)
        for number in range(1, 20):
            inside.socket.send(b"%d" % number)
            await eventually(lambda: len(inside.got) > number)  # noqa: B023
    drain.stop()


async def test_Z3_a_connection_that_is_reset_or_whose_cable_is_cut_is_forgotten(
    server: tuple[zmq.Socket[bytes], str],
    strangers: Callable[[str], socket.socket],
    clients: Context,
    eventually: Eventually,
) -> None:
    """Cut: what comes from the server is dropped before the client's kernel confirms it."""
    with Gate(server[0], MOST) as gate:
        rude = strangers(server[1])
        await eventually(lambda: gate._connections)
        rude.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        rude.close()
        await eventually(lambda: not gate._connections)
        with clients.socket(zmq.DEALER) as dealer:
            monitor = dealer.get_monitor_socket(zmq.EVENT_CONNECTED | zmq.EVENT_HANDSHAKE_SUCCEEDED)
            dealer.setsockopt(zmq.RECONNECT_IVL, -1)
            dealer.connect(server[1])
            await eventually(lambda: monitor.poll(0))
            _, descriptor = struct.unpack("=Hi", monitor.recv_multipart()[0])
            await eventually(lambda: monitor.poll(0))
            await eventually(lambda: gate._connections)
            await asyncio.sleep(0.1)  # nothing may be on its way, or the kernel tries that for some seconds more
            connection = socket.socket(fileno=descriptor)
            drop_all(connection)
            cut_s = time.monotonic()
            await eventually(lambda: not gate._connections)
            assert time.monotonic() - cut_s > 1.0
            connection.detach()
            dealer.disable_monitor()
            monitor.close()


async def test_strangers_are_dropped_by_themselves_and_the_gate_opens(
    server: tuple[zmq.Socket[bytes], str],
    strangers: Callable[[str], socket.socket],
    peer: Callable[..., Peer],
    eventually: Eventually,
) -> None:
    """They have as long as a handshake may take."""
    with Gate(server[0], MOST) as gate:
        for _ in range(MOST):
            strangers(server[1])
        await eventually(lambda: gate.closed)
        client = peer(zmq.DEALER, server[1], IMMEDIATE=1)
        await eventually(lambda: not gate.closed)
        await eventually(lambda: client.socket.poll(0, zmq.POLLOUT))


async def test_nothing_is_left_open_behind_a_gate(context: Context, eventually: Eventually) -> None:
    def open_files() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    def once() -> None:
        server, _ = open_server(context, zmq.ROUTER, "tcp://127.0.0.1:*", {}, Access(local_tcp=True))
        with Gate(server, MOST):
            pass
        server.close()

    once()
    await asyncio.sleep(0.1)
    before = open_files()
    for _ in range(20):
        once()
    await eventually(lambda: open_files() <= before)


@pytest.mark.parametrize(("limit", "most"), [(64, 1), (128, 16), (1024, 240), (4096, MAX_CONNECTIONS)])
def test_two_endpoints_full_of_connections_leave_the_reserve(
    limit: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gate_module.resource, "getrlimit", lambda _: (limit, limit))
    assert most_connections() == most
    assert limit <= RESERVE or 2 * (most + BACKLOG) <= limit - RESERVE + BACKLOG


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
import zmq
from slipd.bus.publisher import Publisher
from slipd.bus.requests import RequestServer
from slipd.zeromq.endpoint import Access

async def main():
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    context, opened = zmq.Context(), []
    access = Access(local_tcp=True)
    with Publisher(context, "tcp://127.0.0.1:*", access) as publisher, RequestServer(
        context, "tcp://127.0.0.1:*", lambda *_: None, access
    ) as server:
        print(publisher.endpoint, server.endpoint, flush=True)
        while not reader.at_eof():
            try:
                files = [open("/dev/null") for _ in range(16)]
                for file in files:
                    file.close()
                opened.append("y")
            except OSError:
                opened.append("n")
            await asyncio.sleep(0.001)
    context.term()
    print("".join(opened), flush=True)

asyncio.run(main())
"""


def test_Z4_600_idle_connections_do_not_keep_a_daemon_with_128_descriptors_from_opening_files(
    strangers: Callable[[str], socket.socket],
) -> None:
    """But for the moment of the storm in which the gate closes."""
    with subprocess.Popen(
        [sys.executable, "-c", DAEMON], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as daemon:
        assert daemon.stdout is not None
        endpoints = daemon.stdout.readline().split()
        for number in range(600):
            strangers(endpoints[number % 2])
        time.sleep(1.0)  # less than strangers have before they are dropped by themselves
        opened, _ = daemon.communicate("")
    assert opened.strip().endswith("y" * 50), opened
