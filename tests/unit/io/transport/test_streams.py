"""What holds for every stream of bytes: a serial port, a TCP port, and a driver that connects."""

from __future__ import annotations

import asyncio
import itertools
from pathlib import Path

import pytest
from link_ends import Device, FarEnd, downs, kinds, pieces, received, serving, ups
from loop_waits import eventually, open_files

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import link_connection
from slipd.io.transport.link_connection import READ_BYTES

pytestmark = pytest.mark.usefixtures("loop_faults")

HUGE = 20_000_000  # bytes; no kernel buffers as many
LARGE = 1_000_000  # bytes; more than any kernel buffers at once
EVERY = bytes(range(256)) * 80


async def test_bytes_pass_both_ways_unchanged_and_in_order(far: FarEnd) -> None:
    got = bytearray()
    async with serving(far) as (links, events):
        for begin, end in itertools.pairwise(n * (n + 1) // 2 for n in range(203)):
            far.send(EVERY[begin:end])
            await eventually(lambda: begin - len(received(events)) < 1000)  # noqa: B023 - a port holds some kilobytes
        await eventually(lambda: len(received(events)) == len(EVERY))
        assert links.write("left.wrench", EVERY[:2560])
        await eventually(lambda: got.extend(far.read()) or len(got) == 2560)
    assert events[0] == LinkUp("left.wrench", far.spec.address)
    assert (received(events), got) == (EVERY, EVERY[:2560])
    assert max(map(len, pieces(events))) <= READ_BYTES


async def test_L5_L6_a_loss_is_reported_after_the_last_bytes_and_the_link_opens_again(
    far: FarEnd, quick: None, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(far.spec, waits=False) as (links, events):
        files, tasks = open_files(), len(asyncio.all_tasks())
        for times in range(1, 4):
            await eventually(far.plug)
            await eventually(lambda: ups(events) == times)  # noqa: B023
            far.send(b"half a fr")
            await eventually(lambda: isinstance(events[-1], Bytes))
            assert links.write("left.wrench", b"poll")
            await eventually(lambda: far.read() == b"poll")
            before = len(events)
            far.unplug()
            await eventually(lambda: downs(events[before:]))  # noqa: B023
            assert far.spec.address in downs(events)[-1]
        assert open_files() <= files + 2, "the next attempt may be under way"
        assert len(asyncio.all_tasks()) <= tasks + 1
    assert received(events) == b"half a fr" * 3
    assert "closing failed" not in caplog.text


async def test_L10_a_device_that_never_reads_refuses_commands_and_is_still_read(far: FarEnd, tmp_path: Path) -> None:
    other = Device(tmp_path / "other")
    other.plug()
    async with serving(far, LinkSpec("right.wrench", "serial", str(other.path), 115200)) as (links, events):
        assert links.write("left.wrench", b"y" * HUGE)
        for _ in range(100):
            assert not links.write("left.wrench", b"must not get between")
        assert links.losses == {"left.wrench": (100, 0), "right.wrench": (0, 0)}
        far.send(b"still here")
        other.send(b"and I")
        await eventually(lambda: received(events) == b"still here")
        await eventually(lambda: received(events, "right.wrench") == b"and I")
    other.unplug()
    assert downs(events) == []


async def test_L10_the_rest_of_a_write_is_sent_and_then_new_ones_are_accepted(far: FarEnd) -> None:
    got = bytearray()
    async with serving(far) as (links, _):
        assert links.write("left.wrench", b"y" * LARGE)
        await eventually(lambda: got.extend(far.read()) or len(got) >= LARGE)
        await eventually(lambda: links.write("left.wrench", b"and on"))
        await eventually(lambda: got.extend(far.read()) or got.endswith(b"and on"))
    assert got == b"y" * LARGE + b"and on"


@pytest.mark.parametrize(("patience_s", "reads"), [(60.0, True), (0.01, False)])
async def test_closing_waits_for_the_rest_of_a_write_but_not_for_ever(
    patience_s: float, reads: bool, far: FarEnd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link_connection, "DRAIN_TIMEOUT_S", patience_s)
    got = bytearray()
    async with asyncio.TaskGroup() as tasks, serving(far) as (links, _):
        assert links.write("left.wrench", b"x" * LARGE)
        if reads:
            tasks.create_task(eventually(lambda: got.extend(far.read()) or len(got) >= LARGE))
    assert got == b"x" * LARGE * reads


async def test_L5_unplugging_with_a_write_under_way_is_an_ordinary_loss(far: FarEnd, quick: None) -> None:
    written: list[bool] = []

    def write(event: Event) -> None:
        if isinstance(event, LinkDown):  # at once: the next try to connect is near
            written.append(links.write("left.wrench", b"down"))

    async with serving(far, on_event=write) as (links, events):
        assert links.write("left.wrench", bytes(HUGE))
        far.unplug()
        links.write("left.wrench", b"into the void")
        await eventually(lambda: written)
        assert written[0] is False
        await eventually(far.plug)
        await eventually(lambda: ups(events) == 2)
        assert links.write("left.wrench", b"fresh")
        await eventually(lambda: far.read() == b"fresh")


@pytest.mark.parametrize("seen", [[LinkUp], [LinkUp, Bytes]], ids=["up", "bytes"])
async def test_an_exception_of_the_consumer_ends_the_group(seen: list[type], far: FarEnd) -> None:
    events: list[Event] = []

    def fail(event: Event) -> None:
        events.append(event)
        if type(event) is seen[-1]:
            raise ArithmeticError("a fault of ours")

    async def run() -> None:
        async with serving(far, on_event=fail):
            far.send(bytes(3 * READ_BYTES))  # takes several reads
            await asyncio.Event().wait()

    with pytest.raises(ExceptionGroup) as raised:
        await run()
    assert [str(error) for error in raised.value.exceptions] == ["a fault of ours"]
    assert kinds(events) == seen
