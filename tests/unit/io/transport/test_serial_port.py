"""Opening a serial port, reading it, and opening it again after it was unplugged."""

from __future__ import annotations

import asyncio
import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import serial as pyserial
from link_events import downs, received, ups

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import serial_port
from slipd.io.transport.serial_port import why_not_opened

if TYPE_CHECKING:
    from conftest import Device, Serving
    from loop_waits import Eventually


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


async def test_opening_is_reported_with_the_path_before_any_bytes(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        device.send(b"x")
        await eventually(lambda: received(events))
    assert events == [LinkUp("left.wrench", str(device.path)), Bytes("left.wrench", b"x")]


async def test_bytes_split_at_any_place_arrive_in_order(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    sent = bytes(range(256)) * 40
    async with serving(spec) as (_, events):
        await eventually(lambda: ups(events))
        at = 0
        for size in range(1, 143):
            device.send(sent[at : at + size])
            at += size
            await asyncio.sleep(0)
        device.send(sent[at:])
        await eventually(lambda: len(received(events)) >= len(sent))
    assert received(events) == sent


async def test_bytes_are_not_altered_by_the_terminal(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    every = bytes(range(256))
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        device.send(every)
        assert links.write("left.wrench", every)
        await eventually(lambda: len(received(events)) >= 256)
        assert device.read() == every
    assert received(events) == every


async def test_L5_unplugging_in_the_middle_of_a_frame_is_told_after_the_last_bytes(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (_, events):
        await eventually(lambda: ups(events))
        device.send(b"half a fr")
        await eventually(lambda: received(events))
        device.unplug()
        await eventually(lambda: downs(events))
        assert isinstance(events[-1], LinkDown)
    assert str(device.path) in downs(events)[0]
    assert received(events) == b"half a fr"


async def test_L5_unplugging_an_idle_device_is_reported(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
        device.unplug()
        await eventually(lambda: len(events) == 2)
    assert "the port is gone" in downs(events)[0]


async def test_L7_a_missing_port_is_reported_once_and_opened_when_it_comes(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(spec) as (_, events):
        await eventually(lambda: downs(events))
        await asyncio.sleep(0.05)
        assert len(events) == 1
        assert str(device.path) in downs(events)[0]
        assert "no such port" in downs(events)[0]
        device.plug()
        await eventually(lambda: ups(events))
        assert len(downs(events)) == 1


async def test_L7_L8_a_port_that_another_program_holds_is_left_alone_until_it_is_free(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, quick: None
) -> None:
    device.plug()
    holder = pyserial.Serial(str(device.path), exclusive=True)
    async with serving(spec) as (_, events):
        await eventually(lambda: downs(events))
        assert "another program holds it" in downs(events)[0]
        holder.close()
        await eventually(lambda: ups(events))
        with pytest.raises(pyserial.SerialException):
            pyserial.Serial(str(device.path), exclusive=True)


async def test_L7_a_file_that_is_not_a_port_is_refused_by_name(
    tmp_path: Path, serving: Serving, eventually: Eventually
) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("not a port")
    files = open_files()
    async with serving(LinkSpec("a", "serial", str(file)), LinkSpec("b", "serial", str(tmp_path))) as (_, events):
        await eventually(lambda: len(events) == 2)
    assert all("not a serial port" in reason for reason in downs(events))
    assert file.read_text() == "not a port"
    assert open_files() <= files + 1  # the loop's executor may keep none of them


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (errno.EACCES, "dialout"),
        (errno.EBUSY, "another program"),
        (errno.EIO, "plug it in again"),
        (errno.ENOENT, "by-id"),
        (errno.ENXIO, "No such device"),
    ],
)
def test_L7_a_reason_names_the_port_and_what_would_be_right(code: int, words: str) -> None:
    reason = why_not_opened("/dev/ttyUSB7", pyserial.SerialException(code, os.strerror(code)))
    assert reason.startswith("/dev/ttyUSB7: ")
    assert words in reason


async def test_an_impossible_baud_rate_is_a_reason_and_no_crash(
    device: Device, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(LinkSpec("left.wrench", "serial", str(device.path), -1)) as (_, events):
        await eventually(lambda: downs(events))
    assert "baud" in downs(events)[0]


async def test_what_the_consumer_raises_ends_the_group_and_closes_the_port(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    seen: list[Event] = []

    def fail(event: Event) -> None:
        seen.append(event)
        if type(event) is Bytes:
            raise ArithmeticError("a fault of ours")
        asyncio.get_running_loop().call_soon(device.send, bytes(4000))  # takes several reads

    with pytest.raises(ExceptionGroup) as raised:
        async with serving(spec, on_event=fail):
            await asyncio.Event().wait()
    assert [str(error) for error in raised.value.exceptions] == ["a fault of ours"]
    assert len(seen) == 2
    pyserial.Serial(str(device.path), exclusive=True).close()


async def test_what_the_consumer_raises_when_a_link_opens_is_fatal_too(
    device: Device, spec: LinkSpec, serving: Serving
) -> None:
    device.plug()

    def fail(event: Event) -> None:
        raise ArithmeticError(type(event).__name__)

    with pytest.raises(ExceptionGroup) as raised:
        async with serving(spec, on_event=fail):
            await asyncio.Event().wait()
    assert [str(error) for error in raised.value.exceptions] == ["LinkUp"]
    pyserial.Serial(str(device.path), exclusive=True).close()


async def test_a_port_unplugged_while_it_is_opened_is_an_ordinary_loss(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.plug()
    really_open = serial_port._open_port

    def open_and_unplug(path: str, baud: int) -> pyserial.Serial:
        port = really_open(path, baud)
        device.unplug()
        return port

    monkeypatch.setattr(serial_port, "_open_port", open_and_unplug)
    files = open_files()
    async with serving(spec) as (_, events):
        await eventually(lambda: events)
    assert "plug it in again" in downs(events)[0]
    await eventually(lambda: open_files() <= files)


async def test_L5_L6_three_hundred_reconnections_leak_no_file_and_no_task(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(spec) as (links, events):
        await eventually(lambda: downs(events))
        files, tasks = open_files(), len(asyncio.all_tasks())
        for cycle in range(1, 301):
            device.plug()
            await eventually(lambda: ups(events) == cycle)  # noqa: B023
            device.send(b"mid-fra")
            links.write("left.wrench", b"poll")
            if cycle % 3:
                await eventually(lambda: isinstance(events[-1], Bytes))
            device.unplug()
            await eventually(lambda: isinstance(events[-1], LinkDown))
        await eventually(lambda: "no such port" in downs(events)[-1])
        assert open_files() <= files + 1  # the executor's second thread has none, the last attempt may be under way
        assert len(asyncio.all_tasks()) == tasks
