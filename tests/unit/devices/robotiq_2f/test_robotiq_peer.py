"""The session against the Modbus server of pymodbus, over a pseudo-terminal."""

from __future__ import annotations

import asyncio
import os
import time
import tty
from collections.abc import AsyncIterator, Callable

import pytest
import pytest_asyncio
from permits import activate, halt, move, set_force
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from slipd.devices.robotiq_2f import Session
from slipd.types.samples import GripperSample

OUTPUT, INPUT = 1000, 2000
PATIENCE_S = 30.0
TABLES = {"force_table": [(0, 0.0), (255, 51.0)], "width_table": [(0.0, 0.085), (1.0, 0.0)]}  # 5 bytes a newton


class Line:
    """A session on the master side of a pseudo-terminal, run as in the daemon."""

    def __init__(self, fd: int, server: ModbusSerialServer) -> None:
        self.server = server
        self.session = Session(**TABLES)
        self.samples: list[GripperSample] = []
        self._fd = fd
        self._now_ns = 0  # it stands still while a reply is awaited: no pause of this process is a silent gripper

    async def until(self, reached: Callable[[GripperSample], bool]) -> GripperSample:
        """Goes on until a new status is as it shall be."""
        seen = len(self.samples)
        until_s = time.monotonic() + PATIENCE_S
        while not any(map(reached, self.samples[seen:])):
            assert time.monotonic() < until_s, f"{self.session.state}: {self.samples[-1:]}"
            self._now_ns += 1_000_000 * (self.session._line.outstanding is None)
            self.write(self.session.on_time(self._now_ns))
            await asyncio.sleep(0.001)
        return self.samples[-1]

    async def registers(self) -> list[int]:
        """What was written to the server."""
        return [int(word) for word in await self.server.async_getValues(9, 3, OUTPUT, 3)]

    def write(self, data: bytes) -> None:
        os.write(self._fd, data)

    def read(self) -> None:
        self.samples += self.session.receive(os.read(self._fd, 4096), self._now_ns)


async def gripper(
    function: int, start: int, address: int, count: int, registers: list[int], written: list[int] | None
) -> None:
    """What a write does: the gripper is active at once, and stops at 100 of 255 where it closes on something."""
    del function, count
    if written is None:
        return
    output = registers[:3]
    output[address - start : address - start + len(written)] = written
    action, position = output[0] >> 8, output[1] & 0xFF
    at = min(position, 100) if action & 0x08 else registers[INPUT - start + 2] >> 8
    status = (action & 0x09) | (0x30 if action & 0x01 else 0) | (0x80 if at < position else 0xC0)
    registers[INPUT - start : INPUT - start + 3] = [status << 8, position, at << 8 | 7]


@pytest_asyncio.fixture
async def line() -> AsyncIterator[Line]:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    words = [SimData(at, count=3, values=0, datatype=DataType.REGISTERS) for at in (OUTPUT, INPUT)]
    server = ModbusSerialServer(SimDevice(9, simdata=words, action=gripper), port=os.ttyname(theirs), baudrate=115_200)
    await server.serve_forever(background=True)
    made = Line(ours, server)
    asyncio.get_running_loop().add_reader(ours, made.read)
    made.write(made.session.start(0))
    try:
        yield made
    finally:
        asyncio.get_running_loop().remove_reader(ours)
        await server.shutdown()
        os.close(theirs)
        os.close(ours)


@pytest.mark.process
async def test_a_foreign_server_is_activated_closed_and_told_another_force(line: Line) -> None:
    session = line.session
    await line.until(lambda sample: not sample.active)
    activate(session, 0)
    await line.until(lambda sample: sample.active)
    assert move(session, 0.0, None, 10.1) == pytest.approx(10.0)
    held = await line.until(lambda sample: sample.object == "contact_closing")
    assert (held.width_m, held.echo_ok, held.moving, held.fault) == (pytest.approx(0.085 * 155 / 255), True, False, "")
    assert await line.registers() == [0x0900, 255, 0x8032]
    assert set_force(session, 12.0) == pytest.approx(12.0)
    await line.until(lambda _: not session._queue.waiting)
    assert await line.registers() == [0x0900, 255, 0x803C]
    assert halt(session)
    stopped = await line.until(lambda _: not session._queue.waiting)
    assert await line.registers() == [0x0100, 255, 0x803C]
    assert stopped.width_m == held.width_m
    assert (session.command_lost, session.health.lost, session.health.bad) == (False, 0, 0)
    assert session.state == "active"
