"""What holds for every stream of bytes: a serial port, a TCP port, and a driver that connects."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import pytest
from link_events import downs, received, ups

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import link_connection
from slipd.io.transport.link_connection import READ_BYTES

if TYPE_CHECKING:
    from conftest import Device, Driver, Serving, TcpDevice
    from loop_waits import Eventually

    Far = Device | TcpDevice | Driver

HUGE = 20_000_000  # bytes; no kernel buffers as many
EVERY = bytes(range(256)) * 80


async def test_bytes_pass_both_ways_unchanged_and_in_order(far: Far, serving: Serving, eventually: Eventually) -> None:
    async with serving(far.spec) as (links, events):
        await eventually(far.plug)
        await eventually(lambda: events)
        at, size = 0, 0
        while at < len(EVERY):
            size = size % 142 + 1
            far.send(EVERY[at : at + size])
            at += size
            await asyncio.sleep(0)
            await eventually(lambda: at - len(received(events)) < 1000)  # noqa: B023 - a port holds some kilobytes
        await eventually(lambda: len(received(events)) == len(EVERY))
        assert links.write("left.wrench", EVERY[:2560])
        got = bytearray()
        await eventually(lambda: got.extend(far.read()) or len(got) == 2560)
    assert events[0] == LinkUp("left.wrench", far.spec.address)
    assert received(events) == EVERY
    assert got == EVERY[:2560]
    assert max(len(event.data) for event in events if isinstance(event, Bytes)) <= READ_BYTES


async def test_L5_L6_a_loss_is_reported_after_the_last_bytes_and_the_link_opens_again(
    far: Far, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(far.spec) as (links, events):
        for times in range(1, 4):
            await eventually(far.plug)
            await eventually(lambda: ups(events) == times)  # noqa: B023
            far.send(b"half a fr")
            await eventually(lambda: isinstance(events[-1], Bytes))
            assert links.write("left.wrench", b"poll")
            await eventually(lambda: far.read() == b"poll")
            far.unplug()
            await eventually(lambda: isinstance(events[-1], LinkDown))
            assert far.spec.address in downs(events)[-1]
    assert received(events) == b"half a fr" * 3


async def test_L10_a_device_that_never_reads_refuses_commands_and_is_still_read(
    far: Far, other_device: Device, serving: Serving, eventually: Eventually
) -> None:
    other_device.plug()
    other = LinkSpec("right.wrench", "serial", str(other_device.path), 115200)
    async with serving(far.spec, other) as (links, events):
        await eventually(far.plug)
        await eventually(lambda: ups(events) == 2)
        assert links.write("left.wrench", b"y" * HUGE)
        for _ in range(100):
            assert not links.write("left.wrench", b"must not get between")
        assert links.refused_writes == {"left.wrench": 100, "right.wrench": 0}
        far.send(b"still here")
        other_device.send(b"and I")
        await eventually(lambda: received(events) == b"still here")
        await eventually(lambda: received(events, "right.wrench") == b"and I")
    assert downs(events) == []


async def test_L10_the_rest_of_a_write_is_sent_and_then_new_ones_are_accepted(
    far: Far, serving: Serving, eventually: Eventually
) -> None:
    size, got = 1_000_000, bytearray()
    async with serving(far.spec) as (links, events):
        await eventually(far.plug)
        await eventually(lambda: events)
        assert links.write("left.wrench", b"y" * size)
        await eventually(lambda: got.extend(far.read()) or len(got) >= size)
        await eventually(lambda: links.write("left.wrench", b"and on"))
        await eventually(lambda: got.extend(far.read()) or got.endswith(b"and on"))
    assert got == b"y" * size + b"and on"


async def test_closing_waits_for_the_rest_of_a_write_but_not_for_ever(
    far: Far, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    size, got = 1_000_000, bytearray()

    async def read_all() -> None:
        await eventually(lambda: got.extend(far.read()) or len(got) >= size)

    for patience_s in (60.0, 0.01):
        monkeypatch.setattr(link_connection, "DRAIN_TIMEOUT_S", patience_s)
        async with asyncio.TaskGroup() as tasks, serving(far.spec) as (links, events):
            await eventually(far.plug)
            await eventually(lambda: events)
            assert links.write("left.wrench", b"x" * size)
            if patience_s > 1.0:
                tasks.create_task(read_all())
        far.unplug()
    assert got == b"x" * size


async def test_the_last_bytes_before_the_end_reach_the_device(
    far: Far, serving: Serving, eventually: Eventually
) -> None:
    got = bytearray()
    async with serving(far.spec) as (links, events):
        await eventually(far.plug)
        await eventually(lambda: events)
        assert links.write("left.wrench", b"farewell")
    await eventually(lambda: got.extend(far.read()) or got == b"farewell")
    assert len(events) == 1


async def test_L5_unplugging_with_a_write_under_way_is_an_ordinary_loss(
    far: Far, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(far.spec) as (links, events):
        await eventually(far.plug)
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", bytes(HUGE))
        far.unplug()
        links.write("left.wrench", b"into the void")
        await eventually(lambda: downs(events))
        assert not links.write("left.wrench", b"down")
        await eventually(far.plug)
        await eventually(lambda: ups(events) == 2)
        assert links.write("left.wrench", b"fresh")
        await eventually(lambda: far.read() == b"fresh")


@pytest.mark.parametrize("kind", [LinkUp, Bytes])
async def test_an_exception_of_the_consumer_ends_the_group(
    kind: type, far: Far, serving: Serving, eventually: Eventually
) -> None:
    events: list[Event] = []

    def fail(event: Event) -> None:
        events.append(event)
        if type(event) is kind:
            raise ArithmeticError("a fault of ours")

    async def run() -> None:
        async with serving(far.spec, on_event=fail):
            await eventually(far.plug)
            await eventually(lambda: events)
            far.send(bytes(3 * READ_BYTES))  # takes several reads
            await asyncio.Event().wait()

    with pytest.raises(ExceptionGroup) as raised:
        await run()
    assert [str(error) for error in raised.value.exceptions] == ["a fault of ours"]
    assert [type(event) for event in events] == ([LinkUp] if kind is LinkUp else [LinkUp, Bytes])
