"""A serial device is recognised on another path, and another device on its path is not taken for it."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from link_events import downs, received, ups

from slipd.events import HostNotice, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import serial_port

if TYPE_CHECKING:
    from conftest import Device, Serving
    from loop_waits import Eventually


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
    monkeypatch.setattr("slipd.io.transport.link.FIRST_DELAY_S", 1000.0)
    monkeypatch.setattr("slipd.io.transport.link.MAX_DELAY_S", 1000.0)
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
