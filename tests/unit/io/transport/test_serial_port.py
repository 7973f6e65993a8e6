"""What is special of a serial port; see test_streams for the rest."""

from __future__ import annotations

import asyncio
import errno
import os
import re
import termios
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial as pyserial
from link_ends import Device, downs, kinds, serving, ups
from loop_waits import eventually, open_files

from slipd.events import HostNotice, LinkSpec, LinkUp
from slipd.io.transport import serial_port
from slipd.io.transport.serial_port import why_not_opened

pytestmark = pytest.mark.usefixtures("loop_faults")


async def test_L7_a_missing_port_is_reported_once_and_opened_when_it_comes(device: Device, quick: None) -> None:
    async with serving(device.spec) as (links, events):
        assert not links.write("left.wrench", b"too early")
        await asyncio.sleep(0.05)
        assert len(events) == 1
        assert downs(events)[0].startswith(f"{device.path}: no such port")
        device.plug()
        await eventually(lambda: ups(events))
        assert (len(downs(events)), links.losses) == (1, {"left.wrench": (1, 0)})


async def test_L7_L8_a_port_that_another_program_holds_is_left_alone_until_it_is_free(
    device: Device, quick: None
) -> None:
    device.plug()
    holder = pyserial.Serial(str(device.path), exclusive=True)
    async with serving(device.spec) as (_, events):
        assert "another program holds it" in downs(events)[0]
        holder.close()
        await eventually(lambda: ups(events))
        with pytest.raises(pyserial.SerialException):
            pyserial.Serial(str(device.path), exclusive=True)
    pyserial.Serial(str(device.path), exclusive=True).close()


async def test_L7_a_file_that_is_not_a_port_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("not a port")
    files = open_files()
    async with serving(LinkSpec("a", "serial", str(file)), LinkSpec("b", "serial", str(tmp_path))) as (_, events):
        assert ["not a serial port" in reason for reason in downs(events)] == [True, True]
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
    error = pyserial.SerialException(code, os.strerror(code))
    assert re.match(f"/dev/ttyUSB7: .*{words}", why_not_opened("/dev/ttyUSB7", error))


async def test_a_port_unplugged_while_it_is_opened_is_an_ordinary_loss(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.plug()
    really_open = serial_port._open_port

    def open_and_unplug(path: str, baud: int) -> tuple[pyserial.Serial, str, str]:
        port = really_open(path, baud)
        device.unplug()
        return port

    monkeypatch.setattr(serial_port, "_open_port", open_and_unplug)
    files = open_files()
    async with serving(device.spec) as (_, events):
        assert "plug it in again" in downs(events)[0]
    await eventually(lambda: open_files() <= files)


async def test_a_port_that_fails_to_write_is_lost_although_it_can_be_read(device: Device) -> None:
    device.plug()
    connection = await serial_port.open_serial(device.spec, print)
    readable, writable = os.pipe()
    os.dup2(readable, connection._fd)
    assert not connection.write(b"command")
    assert "Bad file descriptor" in await connection.until_lost()
    assert not connection.write(b"command")
    await connection.close()
    os.close(readable)
    os.close(writable)


async def test_closing_keeps_the_control_lines_as_they_are(device: Device) -> None:
    device.plug()
    port = os.open(device.path, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(port)
    attributes[2] |= termios.HUPCL
    termios.tcsetattr(port, termios.TCSANOW, attributes)
    async with serving(device.spec) as (_, events):
        assert kinds(events) == [LinkUp]
        assert not termios.tcgetattr(port)[2] & termios.HUPCL
    os.close(port)


async def test_a_port_whose_opening_was_given_up_is_closed(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    device.plug()
    entered, allowed = threading.Event(), threading.Event()
    really_open = serial_port._open_port

    def open_slowly(path: str, baud: int) -> tuple[pyserial.Serial, str, str]:
        entered.set()
        allowed.wait()
        return really_open(path, baud)

    monkeypatch.setattr(serial_port, "_open_port", open_slowly)
    async with serving(device.spec, waits=False) as (_, events):
        await eventually(entered.is_set)
    allowed.set()
    await asyncio.get_running_loop().shutdown_default_executor()
    await asyncio.sleep(0)
    assert events == []
    pyserial.Serial(str(device.path), exclusive=True).close()


def test_L6_what_is_at_a_path_is_told_apart(device: Device, tmp_path: Path) -> None:
    path, file = str(device.path), tmp_path / "rights"
    assert serial_port.probe(path) is None
    device.plug()
    first = serial_port.probe(path)
    assert serial_port.probe(path) == first is not None
    device.unplug()
    time.sleep(0.02)  # the kernel stamps files by a clock that ticks every few milliseconds
    device.plug()
    assert serial_port.probe(path) != first, "the kernel gives its number again"
    file.touch(mode=0o600)
    before = serial_port.probe(str(file))
    file.chmod(0o660)
    assert serial_port.probe(str(file)) != before, "udev sets the group after the port has appeared"


@pytest.mark.parametrize(
    ("usb", "identity"),
    [
        ({"vid": 0x403, "pid": 0x6001, "serial_number": "FT1234"}, "/dev/port, usb 0403:6001 FT1234"),
        ({"vid": 0x403, "pid": 0x6001, "serial_number": None}, "/dev/port, usb 0403:6001"),
        ({"vid": None, "pid": None, "serial_number": "FT1234"}, "/dev/port"),
        (None, "/dev/port"),
    ],
    ids=["named", "nameless", "soldered", "gone"],
)
def test_L6_the_identity_of_a_port_names_its_usb_device(
    usb: dict[str, object] | None, identity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find(path: str) -> SimpleNamespace:
        """Find a USB port as pyserial does; this machine has none."""
        if usb is None:
            raise TypeError("int() argument must be a string, not None")
        return SimpleNamespace(**usb)

    monkeypatch.setattr(serial_port, "SysFS", find)
    assert serial_port.identity_of("/dev/port") == identity


async def test_L12_a_latency_timer_is_shortened_or_named(
    device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> int:
        raise PermissionError

    monkeypatch.setattr(serial_port, "USB_SERIAL", tmp_path)
    device.plug()
    timer = tmp_path / device.path.resolve().name / "latency_timer"
    timer.parent.mkdir()
    timer.write_text("16\n")
    assert serial_port.shorten_latency(str(device.path)) == ""
    assert timer.read_text() == "1\n"
    timer.unlink()
    timer.symlink_to("/proc/sys/kernel/pid_max")  # as a timer that may be read, and is not 1 whatever is written
    monkeypatch.setattr(Path, "write_text", refused)
    async with serving(device.spec) as (_, events):
        await eventually(lambda: kinds(events)[1:] == [HostNotice])
        held = f"holds bytes back for up to {timer.read_text().strip()} ms, in {timer}"
        assert events[1] == HostNotice("latency left.wrench", f"the USB adapter of {device.path} {held}")
        device.unplug()
        await eventually(lambda: downs(events))
        timer.unlink()
        device.plug()
        await eventually(lambda: events[-1] == HostNotice("latency left.wrench", ""))
