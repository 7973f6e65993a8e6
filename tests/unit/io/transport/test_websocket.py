from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import TYPE_CHECKING

import pytest
from websockets.asyncio.server import ServerConnection, serve
from websockets.utils import accept_key

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport.link_connection import READ_BYTES
from slipd.io.transport.websocket import (
    MAX_HANDSHAKE_BYTES,
    MAX_MESSAGE_BYTES,
    PIECE_BYTES,
    WebsocketConnection,
    open_websocket,
)

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually

PATIENCE_S = 60.0

Handler = Callable[[ServerConnection], Awaitable[None]]


def link_to(port: int) -> LinkSpec:
    return LinkSpec("left.pad", "websocket", f"ws://127.0.0.1:{port}")


def kinds(events: list[Event]) -> list[type]:
    return [type(event) for event in events]


def received(events: list[Event]) -> list[bytes]:
    return [event.data for event in events if isinstance(event, Bytes)]


@asynccontextmanager
async def sensor_server(*messages: str, port: int = 0) -> AsyncIterator[int]:
    """Send the messages to each client, and stay connected."""

    async def handle(client: ServerConnection) -> None:
        for message in messages:
            await client.send(message)
        await client.wait_closed()

    async with serve(handle, "127.0.0.1", port, compression=None) as server:
        yield next(iter(server.sockets)).getsockname()[1]


@asynccontextmanager
async def websocket_server(frames: bytes, *, reads: bool = True) -> AsyncIterator[int]:
    """Complete the handshake and send raw frames; without ``reads``, nothing after the request is read."""
    clients: list[asyncio.Task[None] | None] = []

    async def handle(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        clients.append(asyncio.current_task())
        key = re.search(r"Sec-WebSocket-Key: (.*)\r", (await reader.readuntil(b"\r\n\r\n")).decode())
        assert key is not None
        answer = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        try:
            writer.write(f"{answer}Sec-WebSocket-Accept: {accept_key(key[1])}\r\n\r\n".encode() + frames)
            await (reader.read() if reads else asyncio.Event().wait())
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            writer.transport.abort()

    server = await asyncio.start_server(handle, "127.0.0.1", 0, limit=1024)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for client in filter(None, clients):
            client.cancel()
        await asyncio.sleep(0.01)


def raw_server(answer: bytes) -> AbstractAsyncContextManager[int]:
    """A server of another protocol."""

    @asynccontextmanager
    async def run() -> AsyncIterator[int]:
        async def handle(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(answer)
            writer.close()

        server = await asyncio.start_server(handle, "127.0.0.1", 0)
        async with server:
            yield server.sockets[0].getsockname()[1]

    return run()


async def test_messages_are_delivered_as_one_stream_in_order(serving: Serving, eventually: Eventually) -> None:
    messages = ['{"message": "Welcome"}', "µ-strain", "", *(f'{{"message": {n}}}' for n in range(500)), "x" * 30_000]
    content = "".join(messages).encode()
    async with sensor_server(*messages) as port, serving(link_to(port)) as (_, events):
        await eventually(lambda: len(b"".join(received(events))) == len(content))
    assert events[0] == LinkUp("left.pad", f"ws://127.0.0.1:{port}")
    assert b"".join(received(events)) == content
    assert max(map(len, received(events))) <= PIECE_BYTES


async def test_a_ping_of_the_server_is_answered(serving: Serving, eventually: Eventually) -> None:
    async def handle(client: ServerConnection) -> None:
        await (await client.ping())
        await client.send("answered")
        await client.wait_closed()

    async with (
        serve(handle, "127.0.0.1", 0) as server,
        serving(link_to(next(iter(server.sockets)).getsockname()[1])) as (_, events),
    ):
        await eventually(lambda: received(events) == [b"answered"])


async def test_a_message_in_fragments_is_handed_on(serving: Serving, eventually: Eventually) -> None:
    async with (
        websocket_server(b"\x01\x02{}" + b"\x89\x00" + b"\x00\x01x" + b"\x80\x00" + b"\x82\x01y") as port,
        serving(link_to(port)) as (_, events),
    ):
        await eventually(lambda: b"".join(received(events)) == b"{}xy")


@pytest.mark.parametrize("answer", [b"", b"SSH-2.0-OpenSSH_9\r\n", b"HTTP/1.1 404 Not Found\r\n\r\n", bytes(5000)])
async def test_another_protocol_on_the_port_is_reported(
    answer: bytes, serving: Serving, eventually: Eventually
) -> None:
    async with raw_server(answer) as port, serving(link_to(port)) as (_, events):
        await eventually(lambda: events)
    assert kinds(events) == [LinkDown]
    assert f"ws://127.0.0.1:{port}: " in events[0].reason


@pytest.mark.parametrize("address", ["127.0.0.1:5000", "http://127.0.0.1", "ws://", "ws://[::1", "ws://host:port"])
async def test_an_invalid_address_is_reported(address: str, serving: Serving, eventually: Eventually) -> None:
    async with serving(LinkSpec("left.pad", "websocket", address)) as (_, events):
        await eventually(lambda: events)
    assert "one is ws://host:5000" in events[0].reason


async def test_a_message_beyond_all_measure_ends_the_connection(serving: Serving, eventually: Eventually) -> None:
    fits, beyond = "x" * MAX_MESSAGE_BYTES, "x" * (MAX_MESSAGE_BYTES + 1)
    async with sensor_server(fits, beyond) as port, serving(link_to(port)) as (_, events):
        await eventually(lambda: LinkDown in kinds(events))
    assert b"".join(received(events)[: MAX_MESSAGE_BYTES // PIECE_BYTES]) == fits.encode()
    assert "exceeds limit" in next(event.reason for event in events if isinstance(event, LinkDown))


@pytest.mark.parametrize("frame", [b"\x82\x00", b"\x82\x01{", b"\x89\x00", b"\x89\x7d" + bytes(125), b"\x8a\x00"])
async def test_a_flood_leaves_the_loop_its_turns_and_keeps_nothing(
    frame: bytes, serving: Serving, eventually: Eventually
) -> None:
    flood = frame * (100_000 // len(frame))
    turns, reads, taken = 0, 0, 0

    def turn() -> None:
        nonlocal turns
        turns += 1
        asyncio.get_running_loop().call_soon(turn)

    real_read = WebsocketConnection._read

    def read(self: WebsocketConnection) -> None:
        nonlocal reads, taken
        reads += 1
        taken += self._read_bytes
        real_read(self)
        assert len(self._rest) <= 8 * READ_BYTES  # of the pongs that nobody reads

    turn()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WebsocketConnection, "_read", read)
        async with websocket_server(flood, reads=False) as port, serving(link_to(port)):
            await eventually(lambda: taken >= len(flood) // 2)
            assert turns >= reads


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        (b"\x88\x06\x03\xe8\nINF", "the server closed it: 1000"),
        (b"\x88\x00", "the server closed it: 1005"),
        (b"\xff\x00", "violates the protocol"),
        (b"\x82\xff" + bytes(12), "violates the protocol"),
        (b"\x80\x00", "violates the protocol"),
    ],
)
async def test_the_reason_why_a_server_closed_the_connection_is_reported(
    frames: bytes, words: str, serving: Serving, eventually: Eventually
) -> None:
    async with websocket_server(frames) as port, serving(link_to(port)) as (_, events):
        await eventually(lambda: LinkDown in kinds(events))
    assert words in next(event.reason for event in events if isinstance(event, LinkDown))


@pytest.mark.parametrize("silent", [True, False])
async def test_a_server_that_does_not_answer_pings_is_lost(
    silent: bool, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipd.io.transport.websocket.PING_INTERVAL_S", 0.02)
    monkeypatch.setattr("slipd.io.transport.websocket.PING_TIMEOUT_S", 0.05)
    server = websocket_server(b"", reads=False) if silent else sensor_server()
    async with server as port, serving(link_to(port)) as (_, events):
        if silent:
            await eventually(lambda: LinkDown in kinds(events))
            reason = next(event.reason for event in events if isinstance(event, LinkDown))
            silent_s = float(reason.partition("no answer for ")[2].partition(" s")[0])
            assert 0.0 <= silent_s < PATIENCE_S
        else:
            await eventually(lambda: events)
            await asyncio.sleep(0.3)
            assert kinds(events) == [LinkUp]


async def test_C4_a_stall_of_the_daemon_is_no_silence_of_a_server(
    serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipd.io.transport.websocket.PING_INTERVAL_S", 0.02)
    monkeypatch.setattr("slipd.io.transport.websocket.PING_TIMEOUT_S", 0.05)
    async with sensor_server() as port, serving(link_to(port)) as (_, events):
        await eventually(lambda: events)
        for _ in range(3):
            time.sleep(0.2)  # noqa: ASYNC251 - nothing of this process runs
            await asyncio.sleep(0.05)
        assert kinds(events) == [LinkUp]


async def test_an_endless_answer_to_the_handshake_is_refused(serving: Serving, eventually: Eventually) -> None:
    async with (
        raw_server(b"HTTP/1.1 404 No\r\n\r\n" + bytes(MAX_HANDSHAKE_BYTES)) as port,
        serving(link_to(port)) as (_, events),
    ):
        await eventually(lambda: events)
    assert "the answer has more than 65536 bytes" in events[0].reason


async def test_a_proxy_of_the_environment_is_not_asked(
    serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch, unused_tcp_port: int
) -> None:
    for name in ("http_proxy", "all_proxy", "socks_proxy"):
        monkeypatch.setenv(name, f"http://127.0.0.1:{unused_tcp_port}")
    monkeypatch.delenv("no_proxy", raising=False)
    async with sensor_server("direct") as port, serving(link_to(port)) as (_, events):
        await eventually(lambda: received(events) == [b"direct"])


async def test_a_write_is_refused_and_counted(serving: Serving, eventually: Eventually) -> None:
    async with sensor_server() as port, serving(link_to(port)) as (links, events):
        await eventually(lambda: events)
        assert not links.write("left.pad", b"zero")
        assert links.refused_writes == {"left.pad": 1}


async def test_the_end_of_a_link_is_a_proper_farewell(serving: Serving, eventually: Eventually) -> None:
    codes: list[int | None] = []

    async def handle(client: ServerConnection) -> None:
        await client.wait_closed()
        codes.append(client.close_code)

    async with serve(handle, "127.0.0.1", 0) as server:
        async with serving(link_to(next(iter(server.sockets)).getsockname()[1])) as (_, events):
            await eventually(lambda: events)
        await eventually(lambda: codes)
    assert codes == [1000]


async def test_a_connection_that_the_server_ends_meanwhile_is_closed_all_the_same() -> None:
    """Its last message is delivered in pieces, and its close frame waits after them."""
    message = b"\x82\x7e" + (30_000).to_bytes(2, "big") + bytes(30_000)
    pieces: asyncio.Queue[bytes] = asyncio.Queue()
    async with websocket_server(message + b"\x88\x00") as port:
        connection = await open_websocket(link_to(port), pieces.put_nowait)
        await pieces.get()
        assert connection._undelivered
        await connection.close()
        assert connection._opened.fileno() == -1
