"""Opening a serial port, reading it, and finding it again after it was unplugged."""

from __future__ import annotations

import asyncio
import errno
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import serial as pyserial
from link_events import downs, received, ups

from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.transport import serial_port
from slipd.transport.serial_port import why_not_opened

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


async def test_L6_a_link_that_names_the_device_finds_it_on_another_path(
    device: Device, other_device: Device, tmp_path: Path, serving: Serving, eventually: Eventually
) -> None:
    by_id = tmp_path / "usb-Maker_Device_1234-if00-port0"
    device.plug()
    by_id.symlink_to(device.path)
    async with serving(LinkSpec("left.wrench", "serial", str(by_id), 115200)) as (_, events):
        await eventually(lambda: ups(events) == 1)
        by_id.unlink()
        device.unplug()
        await eventually(lambda: downs(events))
        other_device.plug()
        by_id.symlink_to(other_device.path)
        await eventually(lambda: ups(events) == 2)
        other_device.send(b"here now")
        await eventually(lambda: received(events) == b"here now")
    assert {event.identity for event in events if isinstance(event, LinkUp)} == {str(by_id)}


async def test_L6_a_device_that_was_long_away_is_opened_without_waiting_for_the_pause(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slipd.transport.link.FIRST_DELAY_S", 1000.0)
    monkeypatch.setattr("slipd.transport.link.MAX_DELAY_S", 1000.0)
    async with serving(spec) as (_, events):
        await eventually(lambda: downs(events))
        for cycle in range(1, 4):
            device.plug()
            await eventually(lambda: ups(events) == cycle)  # noqa: B023
            device.unplug()
            await eventually(lambda: isinstance(events[-1], LinkDown))


def test_L6_what_is_at_a_path_is_told_apart(device: Device, tmp_path: Path) -> None:
    path = str(device.path)
    assert serial_port.probe(path) is None
    device.plug()
    first = serial_port.probe(path)
    assert first is not None
    assert serial_port.probe(path) == first
    device.unplug()
    assert serial_port.probe(path) is None
    time.sleep(0.02)  # the kernel stamps files by a clock that ticks every few milliseconds
    device.plug()
    assert serial_port.probe(path) != first, "the kernel gives its number again"
    file = tmp_path / "rights"
    file.touch(mode=0o600)
    before = serial_port.probe(str(file))
    file.chmod(0o660)
    assert serial_port.probe(str(file)) != before, "udev sets the group after the port has appeared"


class UsbPort:
    """A USB port as pyserial finds it; this machine has none."""

    def __init__(self, path: str) -> None:
        if path == "gone":
            raise TypeError("int() argument must be a string, not None")
        self.vid, self.pid = (None, None) if path == "soldered" else (0x403, 0x6001)
        self.serial_number = None if path == "nameless" else "FT1234"


@pytest.mark.parametrize(
    ("path", "identity"),
    [
        ("/dev/serial/by-id/usb", "/dev/serial/by-id/usb, usb 0403:6001 FT1234"),
        ("nameless", "nameless, usb 0403:6001"),
        ("soldered", "soldered"),
        ("gone", "gone"),
    ],
)
def test_L6_the_identity_of_a_port_names_its_usb_device(
    path: str, identity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "SysFS", UsbPort)
    assert serial_port.identity_of(path) == identity


async def test_L6_a_path_that_may_become_another_devices_is_warned_of_once(
    serving: Serving, eventually: Eventually, caplog: pytest.LogCaptureFixture, quick: None
) -> None:
    serial_port._warn_of_number.cache_clear()
    numbered = LinkSpec("a", "serial", "/dev/ttyUSB4711", 115200)
    stable = LinkSpec("b", "serial", "/dev/serial/by-id/none", 115200)
    async with serving(numbered, stable) as (_, events):
        await eventually(lambda: len(events) == 2)
        await asyncio.sleep(0.05)
    warned = [record.message for record in caplog.records if "belongs to" in record.message]
    assert warned == [
        "/dev/ttyUSB4711: belongs to whichever device is plugged in first; use a path below /dev/serial/by-id"
    ]


async def test_L6_another_pty_under_the_same_path_is_opened(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (_, events):
        await eventually(lambda: ups(events) == 1)
        device.unplug()
        await eventually(lambda: downs(events))
        device.plug()
        await eventually(lambda: ups(events) == 2)
        device.send(b"again")
        await eventually(lambda: received(events) == b"again")


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
