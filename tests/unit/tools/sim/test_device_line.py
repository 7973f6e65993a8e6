"""Every kind of line carries bytes both ways, serves the host that came last, and never waits for one."""

from __future__ import annotations

import asyncio
import os
import select
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import zmq
from websockets.asyncio.client import connect

from slipd.tools.sim.device_line import SEND_AHEAD, Line, PtyLine, open_line

PATIENCE_S = 20.0

STALLED: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
"""Of a socket that stops reading: libzmq 4.3.5 may never end its context once the peer has left behind a full queue."""


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # noqa: ASYNC110 - what it waits for is the kernel's
            await asyncio.sleep(0.001)


@asynccontextmanager
async def opened(address: str) -> AsyncIterator[Line]:
    """A line that loses what is sent to nobody, before a host is there and after the last."""
    async with open_line(address) as line:
        assert line.listen() == (False, [])
        line.send([b"to nobody"])
        yield line
        line.send([b"to one who hung up"] * 3)


async def check_talk(line: Line, host: socket.socket) -> None:
    """Both sides hear each other, and datagrams stay apart."""
    host.settimeout(PATIENCE_S)
    host.send(b"go")
    await until(lambda: line.listen()[1] == [b"go"])
    line.send([b"one", b"two"])
    pieces = [b"one", b"two"] if host.type == socket.SOCK_DGRAM else [b"onetwo"]
    assert [host.recv(100) for _ in pieces] == pieces


async def test_a_datagram_socket_answers_the_last_sender(unused_udp_port: int) -> None:
    async with opened(f"udp://127.0.0.1:{unused_udp_port}") as line:
        for _ in range(2):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as host:
                host.connect(("127.0.0.1", unused_udp_port))
                host.send(b"start")
                await until(lambda: line.listen()[0])
                await check_talk(line, host)


async def test_a_stream_socket_serves_the_last_who_came(unused_tcp_port: int) -> None:
    address = f"tcp://127.0.0.1:{unused_tcp_port}"
    async with opened(address) as line:
        with pytest.raises(OSError, match="in use"):
            async with open_line(address):
                pass
        with socket.create_connection(("127.0.0.1", unused_tcp_port), PATIENCE_S) as first:
            await until(lambda: line.listen()[0])
            with socket.create_connection(("127.0.0.1", unused_tcp_port), PATIENCE_S) as last:
                await until(lambda: line.listen()[0])
                assert first.recv(10) == b""
                await check_talk(line, last)
        await asyncio.sleep(0.01)
        assert line.listen() == (False, [])


async def test_a_driver_connects_once_a_daemon_is_there_and_again_after_it_left(tmp_path: Path) -> None:
    path = tmp_path / "gripper"
    async with opened(f"unix://{path}") as line:
        for _ in range(2):
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(str(path))
                server.listen()
                await until(lambda: line.listen()[0])
                daemon, _ = server.accept()
                with daemon:
                    await check_talk(line, daemon)
            path.unlink()
            line.listen()
        assert line.listen() == (False, [])


async def test_a_websocket_server_sends_to_all_clients_and_receives_from_them(unused_tcp_port: int) -> None:
    address = f"ws://127.0.0.1:{unused_tcp_port}"
    async with opened(address) as line, connect(address, proxy=None) as first, connect(address, proxy=None) as second:
        await until(lambda: line.listen()[0])
        await first.send("zero")
        await until(lambda: line.listen()[1] == [b"zero"])
        line.send([b'{"message": 1}', b'{"message": 2}'])
        for host in (first, second):
            assert [await host.recv(), await host.recv()] == ['{"message": 1}', '{"message": 2}']


async def test_a_pusher_drops_what_a_daemon_does_not_read(tmp_path: Path) -> None:
    endpoint = f"ipc://{tmp_path}/readings"
    async with open_line(endpoint) as line:
        assert line.listen() == (True, [])
        assert line.listen() == (False, [])
        line.send([b"to nobody"])
        pull = STALLED.socket(zmq.PULL)
        pull.setsockopt(zmq.RCVHWM, 1)
        pull.bind(endpoint)
        got = []

        def arrived() -> list[bytes]:
            line.send([b"reading"])
            if pull.poll(0):
                got.append(pull.recv())
            return got

        await until(arrived)
        line.send([bytes(60_000)] * 100 * SEND_AHEAD)
        pull.close()
    assert set(got) == {b"reading"}


@pytest.mark.parametrize("address", ["udp://127.0.0.1", "tcp://:5000", "carrier://pigeon:1"])
async def test_an_invalid_address_is_refused(address: str) -> None:
    with pytest.raises(ValueError, match="must"):
        async with open_line(address):
            pass


async def test_a_pseudo_terminal_passes_every_byte_notices_who_opens_it_and_goes_with_the_line(tmp_path: Path) -> None:
    link, everything = tmp_path / "gauges", bytes(range(256))
    link.symlink_to("/dev/pts/gone")
    async with open_line(str(link)) as line:
        for _ in range(2):
            assert line.listen() == (False, [])
            host = os.open(link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            await until(lambda: line.listen()[0])
            os.write(host, everything)
            await until(lambda: line.listen()[1] == [everything])
            line.send([everything[:100], everything[100:]])
            assert os.read(host, 1024) == everything
            os.close(host)
    assert not link.is_symlink()


def test_a_slow_reader_of_a_pseudo_terminal_loses_bytes_and_blocks_nobody(tmp_path: Path) -> None:
    port = PtyLine(tmp_path / "pad")
    host = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.listen() == (True, [])
    written = received = 0
    while not port.dropped:
        port.send([b"x" * 1000])
        written += 1000
        assert written < 10_000_000
    while select.select([host], [], [], 0.0)[0]:
        received += len(os.read(host, 65_536))
    assert received == written - port.dropped
    os.close(host)
    port.close()


def test_a_file_in_the_place_of_a_pseudo_terminal_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "gripper").write_text("precious")
    with pytest.raises(FileExistsError):
        PtyLine(tmp_path / "gripper")
    assert (tmp_path / "gripper").read_text() == "precious"
