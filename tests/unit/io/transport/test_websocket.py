"""A WebSocket of a sensor's server, and servers that break the protocol."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable

import pytest
from link_ends import downs, kinds, pieces, received, serving
from loop_waits import PATIENCE_S, eventually
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.utils import accept_key

from slipd.events import LinkDown, LinkSpec, LinkUp
from slipd.io.transport.link_connection import READ_BYTES
from slipd.io.transport.websocket import (
    MAX_HANDSHAKE_BYTES,
    MAX_MESSAGE_BYTES,
    WebsocketConnection,
)

pytestmark = pytest.mark.usefixtures("loop_faults")

Handler = Callable[[ServerConnection], Awaitable[None]]


def link_to(server: Server | asyncio.Server) -> LinkSpec:
    port = next(iter(server.sockets)).getsockname()[1]
    return LinkSpec("left.wrench", "websocket", f"ws://127.0.0.1:{port}")


@contextlib.asynccontextmanager
async def sensor_server(handle: Handler) -> AsyncIterator[LinkSpec]:
    async with serve(handle, "127.0.0.1", 0, compression=None) as server:
        yield link_to(server)


def saying(*messages: str) -> Handler:
    """Send the messages to each client, and stay connected."""

    async def handle(client: ServerConnection) -> None:
        for message in messages:
            await client.send(message)
        await client.wait_closed()

    return handle


@contextlib.asynccontextmanager
async def websocket_server(frames: bytes, *, reads: bool = True) -> AsyncIterator[LinkSpec]:
    """Complete the handshake and send raw frames; without ``reads``, nothing after the request is read."""
    over = asyncio.Event()

    async def handle(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        request = (await reader.readuntil(b"\r\n\r\n")).decode()
        key = request.partition("Sec-WebSocket-Key: ")[2].partition("\r")[0]
        answer = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        with contextlib.suppress(ConnectionError):
            writer.write(f"{answer}Sec-WebSocket-Accept: {accept_key(key)}\r\n\r\n".encode() + frames)
            await (reader.read() if reads else over.wait())
        writer.transport.abort()

    async with await asyncio.start_server(handle, "127.0.0.1", 0, limit=1024) as server:
        yield link_to(server)
        over.set()
    await asyncio.sleep(0.01)


async def test_messages_are_delivered_as_one_stream_in_order() -> None:
    messages = [
        '{"message": "Welcome"}',
        "µ-strain",
        "",
        *(f'{{"message": {n}}}' for n in range(500)),
        "x" * 30_000,
        "y" * 130_000,
    ]
    content = "".join(messages).encode()
    async with sensor_server(saying(*messages)) as spec, serving(spec) as (_, events):
        await eventually(lambda: len(received(events)) == len(content))
    assert events[0] == LinkUp("left.wrench", spec.address)
    assert received(events) == content


async def test_a_ping_is_answered_a_write_is_refused_and_the_end_is_a_proper_farewell() -> None:
    codes: list[int | None] = []

    async def handle(client: ServerConnection) -> None:
        await (await client.ping())
        await client.send("answered")
        await client.wait_closed()
        codes.append(client.close_code)

    async with sensor_server(handle) as spec:
        async with serving(spec) as (links, events):
            await eventually(lambda: received(events) == b"answered")
            assert not links.write("left.wrench", b"zero")
        await eventually(lambda: codes)
    assert (codes, links.losses) == ([1000], {"left.wrench": (1, 0)})


async def test_a_message_in_fragments_is_handed_on() -> None:
    frames = b"\x01\x02{}" + b"\x89\x00" + b"\x00\x01x" + b"\x80\x00" + b"\x82\x01y"
    async with websocket_server(frames) as spec, serving(spec) as (_, events):
        await eventually(lambda: received(events) == b"{}xy")


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        *((answer, ": ") for answer in (b"", b"SSH-2.0-OpenSSH_9\r\n", b"HTTP/1.1 404 Not Found\r\n\r\n", bytes(5000))),
        (b"HTTP/1.1 404 No\r\n\r\n" + bytes(MAX_HANDSHAKE_BYTES), "the answer has more than 65536 bytes"),
    ],
    ids=["nothing", "SSH", "HTTP", "zeros", "endless"],
)
async def test_another_protocol_on_the_port_is_reported(answer: bytes, words: str) -> None:
    async def handle(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(answer)
        writer.close()

    async with await asyncio.start_server(handle, "127.0.0.1", 0) as server:
        spec = link_to(server)
        async with serving(spec) as (_, events):
            assert kinds(events) == [LinkDown]
    assert downs(events)[0].startswith(f"{spec.address}: ")
    assert words in downs(events)[0]


@pytest.mark.parametrize("address", ["127.0.0.1:5000", "http://127.0.0.1", "ws://", "ws://[::1", "ws://host:port"])
async def test_an_invalid_address_is_reported(address: str) -> None:
    async with serving(LinkSpec("left.wrench", "websocket", address)) as (_, events):
        assert "one is ws://host:5000" in downs(events)[0]


async def test_a_message_beyond_all_measure_ends_the_connection() -> None:
    fits, beyond = "x" * MAX_MESSAGE_BYTES, "x" * (MAX_MESSAGE_BYTES + 1)
    async with sensor_server(saying(fits, beyond)) as spec, serving(spec) as (_, events):
        await eventually(lambda: downs(events))
    assert pieces(events) == [fits.encode()]
    assert "exceeds limit" in downs(events)[0]


@pytest.mark.parametrize("frame", [b"\x82\x00", b"\x82\x01{", b"\x89\x00", b"\x89\x7d" + bytes(125), b"\x8a\x00"])
async def test_a_flood_leaves_the_loop_its_turns_and_keeps_nothing(
    frame: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    flood = frame * (100_000 // len(frame))
    count = Counter[str]()
    real_read = WebsocketConnection._read

    def turn() -> None:
        count["turns"] += 1
        asyncio.get_running_loop().call_soon(turn)

    def read(self: WebsocketConnection) -> None:
        count.update(reads=1, taken=self._read_bytes)
        real_read(self)
        assert len(self._rest) <= 8 * READ_BYTES  # of the pongs that nobody reads

    turn()
    monkeypatch.setattr(WebsocketConnection, "_read", read)
    async with websocket_server(flood, reads=False) as spec, serving(spec):
        await eventually(lambda: count["taken"] >= len(flood) // 2)
        assert count["turns"] >= count["reads"]


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
async def test_the_reason_why_a_server_closed_the_connection_is_reported(frames: bytes, words: str) -> None:
    async with websocket_server(frames) as spec, serving(spec) as (_, events):
        await eventually(lambda: downs(events))
    assert words in downs(events)[0]


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipd.io.transport.websocket.PING_INTERVAL_S", 0.02)
    monkeypatch.setattr("slipd.io.transport.websocket.PING_TIMEOUT_S", 0.05)


async def test_a_server_that_does_not_answer_pings_is_lost(impatient: None) -> None:
    async with websocket_server(b"", reads=False) as spec, serving(spec) as (_, events):
        await eventually(lambda: downs(events))
    silent_s = float(downs(events)[0].partition("no answer for ")[2].partition(" s")[0])
    assert 0.0 <= silent_s < PATIENCE_S


async def test_C4_a_stall_of_the_daemon_is_no_silence_of_a_server_that_answers_pings(impatient: None) -> None:
    async with sensor_server(saying()) as spec, serving(spec) as (_, events):
        for _ in range(3):
            time.sleep(0.2)  # noqa: ASYNC251 - nothing of this process runs
            await asyncio.sleep(0.1)
        assert kinds(events) == [LinkUp]
