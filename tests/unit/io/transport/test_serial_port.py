"""What is special of a serial port; see test_streams for the rest."""

from __future__ import annotations

import asyncio
import errno
import os
import termios
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import serial as pyserial
from link_events import downs, ups

from slipd.events import Bytes, HostNotice, LinkDown, LinkSpec
from slipd.io.transport import serial_port
from slipd.io.transport.serial_port import why_not_opened

if TYPE_CHECKING:
    from conftest import Device, Serving
    from loop_waits import Eventually


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


async def test_L7_a_missing_port_is_reported_once_and_opened_when_it_comes(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, quick: None
) -> None:
    async with serving(spec) as (links, events):
        assert not links.write("left.wrench", b"too early")
        await eventually(lambda: downs(events))
        await asyncio.sleep(0.05)
        assert len(events) == 1
        assert downs(events)[0].startswith(f"{device.path}: no such port")
        device.plug()
        await eventually(lambda: ups(events))
        assert len(downs(events)) == 1
        assert links.refused_writes == {"left.wrench": 1}


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
    pyserial.Serial(str(device.path), exclusive=True).close()


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


async def test_a_port_unplugged_while_it_is_opened_is_an_ordinary_loss(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.plug()
    really_open = serial_port._open_port

    def open_and_unplug(path: str, baud: int) -> tuple[pyserial.Serial, str, str]:
        port = really_open(path, baud)
        device.unplug()
        return port

    monkeypatch.setattr(serial_port, "_open_port", open_and_unplug)
    files = open_files()
    async with serving(spec) as (_, events):
        await eventually(lambda: downs(events))
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


async def test_a_port_that_fails_to_write_is_lost_although_it_can_be_read(device: Device, spec: LinkSpec) -> None:
    device.plug()
    connection = await serial_port.open_serial(spec, print)
    readable, writable = os.pipe()
    os.dup2(readable, connection._fd)
    assert not connection.write(b"command")
    assert "Bad file descriptor" in await connection.until_lost()
    assert not connection.write(b"command")
    await connection.close()
    os.close(readable)
    os.close(writable)


async def test_closing_keeps_the_control_lines_as_they_are(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    port = os.open(device.path, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(port)
    attributes[2] |= termios.HUPCL
    termios.tcsetattr(port, termios.TCSANOW, attributes)
    async with serving(spec) as (_, events):
        await eventually(lambda: ups(events))
        assert not termios.tcgetattr(port)[2] & termios.HUPCL
    os.close(port)


async def test_a_port_whose_opening_was_given_up_is_closed(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.plug()
    entered, allowed = threading.Event(), threading.Event()
    really_open = serial_port._open_port

    def open_slowly(path: str, baud: int) -> tuple[pyserial.Serial, str, str]:
        entered.set()
        allowed.wait()
        return really_open(path, baud)

    monkeypatch.setattr(serial_port, "_open_port", open_slowly)
    async with serving(spec) as (_, events):
        await eventually(entered.is_set)
    allowed.set()
    await asyncio.get_running_loop().shutdown_default_executor()
    await asyncio.sleep(0)
    assert events == []
    pyserial.Serial(str(device.path), exclusive=True).close()


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


async def test_L12_a_latency_timer_is_shortened_or_named(
    device: Device,
    spec: LinkSpec,
    serving: Serving,
    eventually: Eventually,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("slipd.io.transport.serial_port.USB_SERIAL", tmp_path)
    device.plug()
    timer = tmp_path / device.path.resolve().name / "latency_timer"
    timer.parent.mkdir()
    timer.write_text("16\n")
    assert serial_port.shorten_latency(str(device.path)) == ""
    assert timer.read_text() == "1\n"
    timer.unlink()
    timer.symlink_to("/proc/sys/kernel/pid_max")  # as a timer that may be read, and is not 1 whatever is written
    monkeypatch.setattr(Path, "write_text", refused)
    async with serving(spec) as (_, events):
        await eventually(lambda: any(isinstance(event, HostNotice) for event in events))
        (notice,) = (event for event in events if isinstance(event, HostNotice))
        assert notice.topic == "latency left.wrench"
        assert notice.text.endswith(f" ms, in {timer}")
        device.unplug()
        await eventually(lambda: downs(events))
        timer.unlink()
        device.plug()
        await eventually(lambda: events[-1] == HostNotice("latency left.wrench", ""))


def refused(*_: object) -> int:
    raise PermissionError
