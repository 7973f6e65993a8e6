"""What is written to a serial port, and how a port is closed."""

from __future__ import annotations

import asyncio
import os
import termios
import threading
from typing import TYPE_CHECKING

import pytest
import serial as pyserial
from link_events import downs, received, ups

from slipd.events import Event, LinkSpec, LinkUp
from slipd.io.transport import serial_port

if TYPE_CHECKING:
    from conftest import Device, Serving
    from loop_waits import Eventually

HUGE = 300_000  # bytes; no pty holds as many


async def test_L10_a_device_that_never_reads_holds_up_nobody(
    device: Device, other_device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    other_device.plug()
    other = LinkSpec("right.wrench", "serial", str(other_device.path), 115200)
    async with serving(spec, other) as (links, events):
        await eventually(lambda: ups(events) == 2)
        assert links.write("left.wrench", bytes(HUGE))
        for _ in range(100):
            assert not links.write("left.wrench", b"command")
        assert links.refused_writes == {"left.wrench": 100, "right.wrench": 0}
        other_device.send(b"still here")
        device.send(b"and I")
        await eventually(lambda: received(events, "right.wrench") == b"still here")
        await eventually(lambda: received(events) == b"and I")
    assert downs(events) == []


async def test_L10_a_full_port_drops_whole_writes_and_takes_new_ones_once_it_is_read(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    got = bytearray()
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", b"y" * HUGE)
        got += device.read()
        assert not links.write("left.wrench", b"must not get between")
        await eventually(lambda: got.extend(device.read()) or len(got) >= HUGE)
        await eventually(lambda: links.write("left.wrench", b"and on"))
        await eventually(lambda: got.extend(device.read()) or got.endswith(b"and on"))
    assert bytes(got) == b"y" * HUGE + b"and on"


async def test_a_dropped_command_is_logged_once_a_spell(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, caplog: pytest.LogCaptureFixture
) -> None:
    device.plug()
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        for _ in range(2):
            assert links.write("left.wrench", bytes(HUGE))
            assert not links.write("left.wrench", b"1")
            assert not links.write("left.wrench", b"2")
            left = HUGE
            while left:
                left -= len(device.read())
                await asyncio.sleep(0)
    told = f"left.wrench ({device.path}) does not read: a command was dropped"
    warned = [record for record in caplog.records if record.name.startswith("slipd") and record.levelname == "WARNING"]
    assert [record.message for record in warned] == [told] * 2


async def test_a_link_that_is_down_refuses_writes(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    async with serving(spec) as (links, events):
        assert not links.write("left.wrench", b"too early")
        await eventually(lambda: downs(events))
        assert not links.write("left.wrench", b"too early still")
        device.plug()
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", b"now")
        await eventually(lambda: device.read() == b"now")
        assert links.refused_writes == {"left.wrench": 2}


async def test_a_session_may_write_from_within_the_event_that_the_link_is_up(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    taken: list[bool] = []

    def greet(event: Event) -> None:
        if isinstance(event, LinkUp):
            taken.append(links.write(event.link, b"hello"))

    async with serving(spec, on_event=greet) as (links, _):
        await eventually(lambda: taken)
        await eventually(lambda: device.read() == b"hello")
    assert taken == [True]


async def test_L5_unplugging_with_a_write_under_way_is_an_ordinary_loss(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", bytes(HUGE))
        device.unplug()
        links.write("left.wrench", b"into the void")
        await eventually(lambda: downs(events))
        device.plug()
        await eventually(lambda: ups(events) == 2)
        assert links.write("left.wrench", b"fresh")
        await eventually(lambda: device.read() == b"fresh")


async def test_the_last_bytes_before_the_end_reach_the_device(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", b"farewell")
    assert device.read() == b"farewell"
    assert len(events) == 1


async def test_closing_does_not_wait_for_a_device_that_never_reads(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually
) -> None:
    device.plug()
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", bytes(HUGE))
    async with serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        device.send(b"next run")
        await eventually(lambda: received(events) == b"next run")


async def test_a_partial_write_is_completed_before_closing(
    device: Device, spec: LinkSpec, serving: Serving, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "DRAIN_TIMEOUT_S", 60.0)
    device.plug()
    got = bytearray()

    async def read_all() -> None:
        await eventually(lambda: got.extend(device.read()) or len(got) >= HUGE)

    async with asyncio.TaskGroup() as tasks, serving(spec) as (links, events):
        await eventually(lambda: ups(events))
        assert links.write("left.wrench", b"x" * HUGE)
        tasks.create_task(read_all())
    assert got == b"x" * HUGE


async def test_a_port_can_be_opened_as_soon_as_it_is_closed(device: Device, spec: LinkSpec) -> None:
    device.plug()
    connection = await serial_port.open_serial(spec, print)
    await connection.close()
    pyserial.Serial(str(device.path), exclusive=True).close()


async def test_a_port_that_fails_to_write_is_lost_although_it_can_be_read(device: Device, spec: LinkSpec) -> None:
    device.plug()
    connection = await serial_port.open_serial(spec, print)
    readable, writable = os.pipe()
    os.dup2(readable, connection._port.fileno())
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

    def open_slowly(path: str, baud: int) -> pyserial.Serial:
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
