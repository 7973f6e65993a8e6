from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import pytest

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import address, tcp
from slipd.io.transport.byte_delivery import READ_BYTES

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually

HUGE = 20_000_000  # bytes; more than the kernel's buffers take


class Controller:
    """The device side: a server that keeps the streams of its clients."""

    def __init__(self) -> None:
        self.clients: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = []
        self.port = 0

    @property
    def spec(self) -> LinkSpec:
        return LinkSpec("left.pad", "tcp", f"tcp://localhost:{self.port}")

    async def meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.clients.append((reader, writer))


@asynccontextmanager
async def controller(port: int = 0) -> AsyncIterator[Controller]:
    device = Controller()
    server = await asyncio.start_server(device.meet, "127.0.0.1", port)
    device.port = server.sockets[0].getsockname()[1]
    try:
        yield device
    finally:
        server.close()
        for _, writer in device.clients:
            writer.transport.abort()
        await asyncio.sleep(0)


def received(events: list[Event]) -> bytes:
    return b"".join(event.data for event in events if isinstance(event, Bytes))


def kinds(events: list[Event]) -> list[type]:
    return [type(event) for event in events]


async def test_bytes_pass_both_ways_unchanged(serving: Serving, eventually: Eventually) -> None:
    every = bytes(range(256)) * 40
    async with controller() as device, serving(device.spec) as (links, events):
        await eventually(lambda: events and device.clients)
        reader, writer = device.clients[0]
        writer.write(every)
        assert links.write("left.pad", every)
        assert await reader.readexactly(len(every)) == every
        await eventually(lambda: len(received(events)) == len(every))
    assert events[0] == LinkUp("left.pad", device.spec.address)
    assert received(events) == every


async def test_no_piece_is_longer_than_the_loop_can_bear(serving: Serving, eventually: Eventually) -> None:
    async with controller() as device, serving(device.spec) as (_, events):
        await eventually(lambda: device.clients)
        device.clients[0][1].write(bytes(1_000_000))
        await eventually(lambda: len(received(events)) == 1_000_000)
    assert max(len(event.data) for event in events if isinstance(event, Bytes)) <= READ_BYTES


async def test_commands_leave_at_once_and_a_cut_cable_is_noticed(eventually: Eventually) -> None:
    async with controller() as device:
        connection = await tcp.open_tcp(device.spec, print)
        await eventually(lambda: device.clients)
        opened = connection._socket
        assert opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        assert opened.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        noticed_s = opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE)
        probe_s = opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL)
        assert noticed_s + probe_s * opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT) <= 3
        assert opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) <= 3000
        await connection.close()


async def test_a_device_that_closes_the_connection_is_reported_and_opened_again(
    serving: Serving, eventually: Eventually
) -> None:
    async with controller() as device, serving(device.spec) as (links, events):
        await eventually(lambda: device.clients)
        device.clients[0][1].write(b"half a fr")
        await eventually(lambda: received(events))
        device.clients[0][1].close()
        await eventually(lambda: LinkDown in kinds(events))
        assert "the other side closed it" in events[2].reason
        await eventually(lambda: len(device.clients) == 2 and kinds(events)[-1] is LinkUp)
        assert links.write("left.pad", b"again")
        assert await device.clients[1][0].readexactly(5) == b"again"


async def test_a_reset_is_an_ordinary_loss(serving: Serving, eventually: Eventually) -> None:
    async with controller() as device, serving(device.spec) as (_, events):
        await eventually(lambda: device.clients)
        device.clients[0][1].write(b"x")
        await eventually(lambda: received(events))
        opened = device.clients[0][1].get_extra_info("socket")
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        device.clients[0][1].transport.abort()
        await eventually(lambda: LinkDown in kinds(events))
    assert "reset" in events[2].reason


async def test_a_device_that_is_not_there_is_reported_once_and_found_later(
    serving: Serving, eventually: Eventually, quick: None, unused_tcp_port: int
) -> None:
    spec = LinkSpec("left.pad", "tcp", f"tcp://127.0.0.1:{unused_tcp_port}")
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        await asyncio.sleep(0.05)
        assert kinds(events) == [LinkDown]
        assert "switch the device on" in events[0].reason
        async with controller(unused_tcp_port) as device:
            await eventually(lambda: kinds(events)[-1] is LinkUp and device.clients)


async def test_a_device_that_does_not_answer_is_reported(
    serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(address, "OPEN_TIMEOUT_S", 0.05)
    with socket.socket() as server, socket.socket() as queued:
        server.bind(("127.0.0.1", 0))
        server.listen(0)  # one visitor fills the queue, and the next is not answered
        queued.connect(server.getsockname())
        queued_too = socket.socket()
        queued_too.setblocking(False)
        queued_too.connect_ex(server.getsockname())
        spec = LinkSpec("left.pad", "tcp", f"tcp://127.0.0.1:{server.getsockname()[1]}")
        async with serving(spec) as (_, events):
            await eventually(lambda: events)
        queued_too.close()
    assert "no answer within" in events[0].reason


async def test_L10_a_device_that_never_reads_refuses_commands_and_is_still_read(
    serving: Serving, eventually: Eventually
) -> None:
    async with controller() as device, serving(device.spec) as (links, events):
        await eventually(lambda: device.clients and events)
        reader, writer = device.clients[0]
        reader._transport.pause_reading()
        assert links.write("left.pad", bytes(HUGE))
        for _ in range(100):
            assert not links.write("left.pad", b"command")
        assert links.refused_writes == {"left.pad": 100}
        writer.write(b"still here")
        await eventually(lambda: received(events) == b"still here")


async def test_a_partial_write_is_completed(serving: Serving, eventually: Eventually) -> None:
    async with controller() as device, serving(device.spec) as (links, events):
        await eventually(lambda: device.clients and events)
        reader, _ = device.clients[0]
        assert links.write("left.pad", b"y" * HUGE)
        assert await reader.readexactly(HUGE) == b"y" * HUGE
        await eventually(lambda: links.write("left.pad", b"and on"))
        assert await reader.readexactly(6) == b"and on"


async def test_closing_waits_for_the_rest_of_a_write_but_not_for_ever(
    monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    monkeypatch.setattr(tcp, "DRAIN_TIMEOUT_S", 60.0)
    async with controller() as device:
        connection = await tcp.open_tcp(device.spec, print)
        await eventually(lambda: device.clients)
        assert connection.write(b"z" * HUGE)
        read = asyncio.create_task(device.clients[0][0].readexactly(HUGE))
        await connection.close()
        assert await read == b"z" * HUGE
        monkeypatch.setattr(tcp, "DRAIN_TIMEOUT_S", 0.01)
        connection = await tcp.open_tcp(device.spec, print)
        await eventually(lambda: len(device.clients) == 2)
        device.clients[1][0]._transport.pause_reading()
        assert connection.write(b"z" * HUGE)
        await connection.close()


async def test_an_exception_of_the_consumer_ends_the_group(serving: Serving, eventually: Eventually) -> None:
    def fail(event: Event) -> None:
        if type(event) is Bytes:
            raise ArithmeticError("a fault of ours")

    async with controller() as device:

        def flood() -> bool:
            if device.clients:
                device.clients[0][1].write(bytes(3 * READ_BYTES))
            return False

        with pytest.raises(ExceptionGroup) as raised:
            async with serving(device.spec, on_event=fail) as (_, events):
                await eventually(flood)
        assert [str(error) for error in raised.value.exceptions] == ["a fault of ours"]
    assert kinds(events) == [LinkUp, Bytes]
