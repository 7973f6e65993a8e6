from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import udp

if TYPE_CHECKING:
    from conftest import Serving
    from loop_waits import Eventually


class Sensor:
    """The device side: a datagram socket that answers the last sender."""

    def __init__(self, host: str) -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.socket = socket.socket(family, socket.SOCK_DGRAM)
        self.socket.bind((host, 0))
        self.socket.setblocking(False)
        self.heard: list[bytes] = []
        shown = f"[{host}]" if ":" in host else host
        self.address = f"udp://{shown}:{self.socket.getsockname()[1]}"
        self.spec = LinkSpec("left.wrench", "udp", self.address)

    def hears(self) -> list[bytes]:
        try:
            while True:
                data, self.peer = self.socket.recvfrom(2000)
                self.heard.append(data)
        except BlockingIOError:
            return self.heard

    def send(self, data: bytes) -> None:
        self.socket.sendto(data, self.peer)


@pytest.fixture
def sensor() -> Iterator[Sensor]:
    sensor = Sensor("127.0.0.1")
    yield sensor
    sensor.socket.close()


def received(events: list[Event]) -> list[bytes]:
    return [event.data for event in events if isinstance(event, Bytes)]


def kinds(events: list[Event]) -> list[type]:
    return [type(event) for event in events]


async def test_each_datagram_is_delivered_as_one_piece_in_order(
    sensor: Sensor, serving: Serving, eventually: Eventually
) -> None:
    sent = [b"", b"x", *(bytes([n % 256]) * n for n in range(1, 300)), bytes(udp.MAX_DATAGRAM_BYTES)]
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        assert links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        for data in sent:
            sensor.send(data)
        await eventually(lambda: len(received(events)) == len(sent))
    assert events[0] == LinkUp("left.wrench", sensor.address)
    assert received(events) == sent


async def test_only_the_beginning_of_a_very_long_datagram_is_delivered(
    sensor: Sensor, serving: Serving, eventually: Eventually
) -> None:
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        sensor.send(bytes(65_000))
        sensor.send(b"next")
        await eventually(lambda: len(received(events)) == 2)
    assert received(events) == [bytes(udp.MAX_DATAGRAM_BYTES), b"next"]


async def test_a_write_is_one_datagram(sensor: Sensor, serving: Serving, eventually: Eventually) -> None:
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        assert links.write("left.wrench", b"one")
        assert links.write("left.wrench", b"two")
        await eventually(lambda: sensor.hears() == [b"one", b"two"])


@pytest.mark.skipif(not socket.has_ipv6, reason="no IPv6 here")
async def test_a_device_with_an_ipv6_address_is_read(serving: Serving, eventually: Eventually) -> None:
    try:
        sensor = Sensor("::1")
    except OSError as error:
        pytest.skip(f"no IPv6 here: {error}")
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        sensor.send(b"six")
        await eventually(lambda: received(events) == [b"six"])
    sensor.socket.close()


async def test_datagrams_of_other_senders_are_ignored(sensor: Sensor, serving: Serving, eventually: Eventually) -> None:
    stranger = Sensor("127.0.0.1")
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        stranger.peer = sensor.peer
        stranger.send(b"not yours")
        sensor.send(b"yours")
        await eventually(lambda: received(events))
    assert received(events) == [b"yours"]
    stranger.socket.close()


async def test_a_host_without_a_listener_is_reported_and_tried_again(
    sensor: Sensor, serving: Serving, eventually: Eventually
) -> None:
    port = sensor.socket.getsockname()[1]
    sensor.socket.close()

    def greet(event: Event) -> None:
        if isinstance(event, LinkUp):
            links.write("left.wrench", b"start")

    async with serving(sensor.spec, on_event=greet) as (links, events):
        await eventually(lambda: LinkDown in kinds(events))
        assert "nothing listens on this port" in events[1].reason
        back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        back.bind(("127.0.0.1", port))
        await eventually(lambda: kinds(events).count(LinkUp) > 1)
        back.settimeout(10.0)
        assert back.recv(100) == b"start"
        back.close()


async def test_a_refused_write_is_an_ordinary_loss(sensor: Sensor, serving: Serving, eventually: Eventually) -> None:
    sensor.socket.close()
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        links.write("left.wrench", b"start")
        links.write("left.wrench", b"and again")  # this write reports it, if the loop did not before
        await eventually(lambda: LinkDown in kinds(events))
        assert not links.write("left.wrench", b"down")


async def test_a_write_longer_than_a_datagram_ends_the_connection_with_the_reason(
    sensor: Sensor, serving: Serving, eventually: Eventually
) -> None:
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        assert not links.write("left.wrench", bytes(70_000))
        await eventually(lambda: LinkDown in kinds(events))
    assert "too long" in events[1].reason


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("udp://", "has no host"),
        ("udp://127.0.0.1", "has no port; a valid address is udp://127.0.0.1:49152"),
        ("udp://127.0.0.1:70000", "not an address"),
        ("udp://[::1:80", "not an address"),
        ("udp://no-such-host.invalid:49152", "cannot be reached"),
        ("udp://a..b:49152", "cannot be reached"),
        (f"udp://{64 * 'a'}:49152", "cannot be reached"),
    ],
)
async def test_an_address_that_cannot_be_reached_is_reported(
    address: str, words: str, serving: Serving, eventually: Eventually
) -> None:
    async with serving(LinkSpec("left.wrench", "udp", address)) as (_, events):
        await eventually(lambda: events)
    assert kinds(events) == [LinkDown]
    assert events[0].reason.startswith(f"{address}: ")
    assert words in events[0].reason


async def test_L9_what_the_kernel_drops_is_counted_over_all_connections(
    sensor: Sensor, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        sent = 20_000
        for _ in range(sent):  # the loop does not read meanwhile
            sensor.send(b"flood")
        await eventually(lambda: len(received(events)) + links.overruns["left.wrench"] == sent)
        dropped = links.overruns["left.wrench"]
        assert dropped > 0
        assert not links.write("left.wrench", bytes(70_000))
        await eventually(lambda: kinds(events)[-1] is LinkUp)
        assert links.overruns["left.wrench"] == dropped


async def test_L9_a_flood_leaves_the_loop_its_turn(sensor: Sensor, serving: Serving, eventually: Eventually) -> None:
    async with serving(sensor.spec) as (links, events):
        await eventually(lambda: events)
        links.write("left.wrench", b"start")
        await eventually(sensor.hears)
        for size in (0, 100, 1500):
            for _ in range(100):
                sensor.send(bytes(size))
            before, most = len(events), 0
            while len(events) < before + 100:
                now = len(events)
                await asyncio.sleep(0)  # one turn of the loop
                most = max(most, len(events) - now)
            assert most <= min(udp.DATAGRAMS_PER_WAKE, -(-udp.READ_BYTES // max(size, 1)))


async def test_an_exception_of_the_consumer_ends_the_group(
    sensor: Sensor, serving: Serving, eventually: Eventually
) -> None:
    def fail(event: Event) -> None:
        if type(event) is LinkUp:
            links.write("left.wrench", b"start")
        if type(event) is Bytes:
            raise ArithmeticError("a fault of ours")

    def flood() -> bool:
        if sensor.hears():
            sensor.send(b"1")
            sensor.send(b"2")
        return False

    with pytest.raises(ExceptionGroup) as raised:
        async with serving(sensor.spec, on_event=fail) as (links, events):
            await eventually(flood)
    assert [str(error) for error in raised.value.exceptions] == ["a fault of ours"]
    assert received(events) == [b"1"]


def test_a_kernel_that_does_not_count_drops_is_borne(sensor: Sensor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(udp, "SO_MEMINFO", 9999)

    async def count() -> int:
        connection = await udp.open_udp(sensor.spec, print)
        overruns = connection.overruns
        await connection.close()
        return overruns

    assert asyncio.run(count()) == 0
