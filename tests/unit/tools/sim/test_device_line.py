from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
import zmq
from websockets.asyncio.client import connect

from slipd.tools.sim.device_line import SEND_AHEAD, Line, open_line

PATIENCE_S = 20.0

STALLED: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
"""Of a socket that stops reading: libzmq 4.3.5 may never end its context once the peer has left behind a full queue."""


async def heard(line: Line, count: int) -> list[bytes]:
    """Return the next pieces written to the line."""
    found: list[bytes] = []
    async with asyncio.timeout(PATIENCE_S):
        while sum(map(len, found)) < count:
            found += line.listen()[1]
            await asyncio.sleep(0.001)
    return found


async def until_opened(line: Line) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not line.listen()[0]:  # noqa: ASYNC110 - there is no event
            await asyncio.sleep(0.001)


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # noqa: ASYNC110 - what it waits for is the kernel's
            await asyncio.sleep(0.001)


async def test_a_pseudo_terminal_is_created_and_removed(tmp_path: Path) -> None:
    path = tmp_path / "gauges"
    async with open_line(str(path)) as line:
        assert line.listen() == (False, [])
        host = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        await until_opened(line)
        os.write(host, b"go")
        assert await heard(line, 2) == [b"go"]
        line.send([b"\x00one", b"\xfftwo"])
        assert os.read(host, 100) == b"\x00one\xfftwo"
        os.close(host)
    assert not path.is_symlink()


async def test_a_datagram_socket_answers_the_last_sender(unused_udp_port: int) -> None:
    async with open_line(f"udp://127.0.0.1:{unused_udp_port}") as line:
        line.send([b"to nobody"])
        for _ in range(2):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as host:
                host.connect(("127.0.0.1", unused_udp_port))
                host.settimeout(PATIENCE_S)
                host.send(b"start")
                await until_opened(line)
                line.send([b"one", b"two"])
                assert [host.recv(100), host.recv(100)] == [b"one", b"two"]
                host.send(b"more")
                assert await heard(line, 4) == [b"more"]
        line.send([b"to one who hung up"] * 3)


async def test_a_stream_socket_serves_the_last_who_came(unused_tcp_port: int) -> None:
    async with open_line(f"tcp://127.0.0.1:{unused_tcp_port}") as line:
        line.send([b"to nobody"])
        with ExitStack() as stack:
            hosts = []
            for _ in range(2):
                hosts.append(stack.enter_context(socket.create_connection(("127.0.0.1", unused_tcp_port), PATIENCE_S)))
                await until_opened(line)
            assert hosts[0].recv(10) == b""
            hosts[1].send(b"go")
            assert await heard(line, 2) == [b"go"]
            line.send([b"one", b"two"])
            assert hosts[1].recv(10) == b"onetwo"
        await asyncio.sleep(0.01)
        assert line.listen() == (False, [])
        line.send([b"to one who hung up"])


async def test_a_websocket_server_sends_to_all_clients_and_receives_from_them(unused_tcp_port: int) -> None:
    address = f"ws://127.0.0.1:{unused_tcp_port}"
    async with open_line(address) as line:
        line.send([b"to nobody"])
        async with connect(address, proxy=None) as first, connect(address, proxy=None) as second:
            await until_opened(line)
            await first.send("zero")
            assert await heard(line, 4) == [b"zero"]
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
        begin_s = time.monotonic()
        line.send([bytes(60_000)] * 100 * SEND_AHEAD)
        assert time.monotonic() - begin_s < PATIENCE_S
        pull.close()
    assert set(got) == {b"reading"}


@pytest.mark.parametrize("address", ["udp://127.0.0.1", "tcp://:5000", "carrier://pigeon:1"])
async def test_an_invalid_address_is_refused(address: str) -> None:
    with pytest.raises(ValueError, match="must"):
        async with open_line(address):
            pass


async def test_an_address_in_use_is_reported(unused_tcp_port: int) -> None:
    address = f"tcp://127.0.0.1:{unused_tcp_port}"
    async with open_line(address):
        with pytest.raises(OSError, match="in use"):
            async with open_line(address):
                pass


async def test_a_driver_connects_once_a_daemon_is_there_and_again_after_it_left(tmp_path: Path) -> None:
    path = str(tmp_path / "gripper")
    async with open_line(f"unix://{path}") as line:
        assert line.listen() == (False, [])
        line.send([b"to nobody"])
        for _ in range(2):
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(path)
                server.listen()
                await until_opened(line)
                daemon, _ = server.accept()
                with daemon:
                    daemon.settimeout(PATIENCE_S)
                    daemon.send(b"go")
                    assert await heard(line, 2) == [b"go"]
                    line.send([b"one", b"two"])
                    assert daemon.recv(100) == b"onetwo"
            (tmp_path / "gripper").unlink()
            line.listen()
        assert line.listen() == (False, [])
