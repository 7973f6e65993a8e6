"""The session against the Modbus server of pymodbus, over a pseudo-terminal."""

from __future__ import annotations

import asyncio
import os
import tty
from collections.abc import Callable
from contextlib import AsyncExitStack, suppress

import pytest
from permits import activate, halt, move, set_force
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from slipd.devices.robotiq_2f import Session
from slipd.types.samples import GripperSample

OUTPUT, INPUT = 1000, 2000
PATIENCE_S = 30.0
TABLES = {"force_table": [(0, 0.0), (255, 51.0)], "width_table": [(0.0, 0.085), (1.0, 0.0)]}  # 5 bytes a newton


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


@pytest.mark.process
async def test_a_foreign_server_is_activated_closed_and_told_another_force() -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    words = [SimData(at, count=3, values=0, datatype=DataType.REGISTERS) for at in (OUTPUT, INPUT)]
    server = ModbusSerialServer(SimDevice(9, simdata=words, action=gripper), port=os.ttyname(theirs), baudrate=115_200)
    session, now_ns = Session(**TABLES), 0

    async def until(reached: Callable[[GripperSample], bool]) -> GripperSample:
        """Go on until a status is as it shall be; time stands still while a reply is awaited, however long it takes."""
        nonlocal now_ns
        async with asyncio.timeout(PATIENCE_S):
            while True:
                now_ns += 1_000_000 * (session._line.outstanding is None)
                os.write(ours, session.on_time(now_ns))
                await asyncio.sleep(0.001)
                with suppress(BlockingIOError):
                    for sample in filter(reached, session.receive(os.read(ours, 4096), now_ns)):
                        return sample

    async def written() -> list[int]:
        return [int(word) for word in await server.async_getValues(9, 3, OUTPUT, 3)]

    async with AsyncExitStack() as stack:
        stack.callback(os.close, ours)
        stack.callback(os.close, theirs)
        await server.serve_forever(background=True)
        stack.push_async_callback(server.shutdown)
        os.write(ours, session.start(0))
        await until(lambda sample: not sample.active)
        activate(session, 0)
        await until(lambda sample: sample.active)
        assert move(session, 0.0, None, 10.1) == pytest.approx(10.0)
        held = await until(lambda sample: sample.object == "contact_closing")
        told = held.width_m, held.echo_ok, held.moving, held.fault
        assert told == (pytest.approx(0.085 * 155 / 255), True, False, "")
        assert await written() == [0x0900, 255, 0x8032]
        assert set_force(session, 12.0) == pytest.approx(12.0)
        await until(lambda _: not session._queue.waiting)
        assert await written() == [0x0900, 255, 0x803C]
        assert halt(session)
        stopped = await until(lambda _: not session._queue.waiting)
        assert await written() == [0x0100, 255, 0x803C]
        assert (stopped.width_m, session.state) == (held.width_m, "active")
        assert (session.command_lost, session.health.lost, session.health.bad) == (False, 0, 0)
