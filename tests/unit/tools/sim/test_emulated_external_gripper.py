"""The emulated driver of another gripper, as an object and as a process at the socket of the daemon."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from driving import drive
from permits import move, set_force

from slipd.devices.external_gripper import Session
from slipd.devices.external_gripper.external_gripper_message import (
    REFUSED,
    encode_notice,
    encode_registration,
    encode_setpoint,
)
from slipd.events import LinkSpec
from slipd.io.transport.local_sockets import open_driver_socket
from slipd.tools.sim.emulated_external_gripper import DRIVER, Driver, make
from slipd.types.samples import GripperSample

MS = 1_000_000
PATIENCE_S = 30.0


def test_it_registers_and_reports_at_its_rate() -> None:
    driver, session = make(0), Session()
    driver.opened(0)
    samples = drive(session, driver, 2.0)
    assert len(samples) == pytest.approx(2 * driver.rate_hz, abs=2)
    assert (session.state, samples[-1].width_m, samples[-1].object) == ("active", 0.08, "none")


def test_it_closes_on_the_part_and_opens_again() -> None:
    driver = Driver()
    driver.advance(0)
    driver.receive(encode_setpoint(1, "move", width_m=0.0, speed_mps=None, force_n=9.0), 0)
    driver.advance(200 * MS)
    assert (driver.report.moving, driver.report.object) == (True, "moving")
    driver.advance(1000 * MS)
    held = driver.report
    assert (held.width_m, held.moving, held.object, held.force_n) == (0.04, False, "contact_closing", 9.0)
    driver.receive(encode_setpoint(3, "stop"), 1000 * MS)
    assert (driver.report.object, driver.report.force_n) == ("contact_closing", 9.0)
    driver.receive(encode_setpoint(2, "move", width_m=0.06, speed_mps=0.2, force_n=2.0), 1000 * MS)
    driver.advance(2000 * MS)
    assert (driver.report.width_m, driver.report.object, driver.report.force_n) == (0.06, "none", 0.0)


def test_what_comes_twice_is_done_once_and_answered_twice() -> None:
    driver = Driver()
    force = encode_setpoint(1, "force", force_n=9.0)
    assert [len(driver.receive(force, t_ns)) for t_ns in (0, MS)] == [1, 1]
    assert len(driver.obeyed) == 1
    driver.mute = True
    assert driver.receive(encode_setpoint(2, "stop"), MS) == []


def test_it_survives_garbage_and_registers_again_on_request() -> None:
    driver = Driver()
    driver.advance(0)
    for garbage in (b"\xc1", b"\x81\xa1\xff\x00", b"\x05", encode_setpoint(1, "move"), b"\x81\xa2op\x01"):
        assert driver.receive(garbage, MS) == []
    assert driver.receive(encode_setpoint(2, "stop"), MS) != []
    driver.receive(encode_notice(REFUSED, "the driver must register first"), MS)
    assert driver.advance(2 * MS) == [encode_registration(DRIVER)]


@pytest.fixture
def address(tmp_path: Path) -> str:
    return f"unix://{tmp_path}/gripper"


@pytest.fixture
def process(address: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "slipd.tools.sim.emulate", "external_gripper", "--at", address]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as made:
        yield made
        made.kill()


@pytest.mark.process
async def test_a_driver_in_its_own_process_obeys(process: subprocess.Popen[str], address: str) -> None:
    session, samples = Session(), list[GripperSample]()

    def hear(data: bytes) -> None:
        samples.extend(session.receive(data, time.monotonic_ns()))

    async with asyncio.timeout(PATIENCE_S):
        line = await open_driver_socket(LinkSpec("gripper", "local", address), hear)

    async def until(reached: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not reached():
                if data := session.on_time(time.monotonic_ns()):
                    assert line.write(data)
                await asyncio.sleep(0.001)

    try:
        session.start(time.monotonic_ns())
        await until(lambda: session.state == "active")
        assert session.identity == "emulated driver"
        assert move(session, 0.0, 0.2, 10.0) == 10.0
        await until(lambda: samples[-1].object == "contact_closing")
        assert set_force(session, 12.0) == 12.0
        await until(lambda: samples[-1].force_n == 12.0)
        assert (samples[-1].width_m, samples[-1].echo_ok, session.command_lost) == (0.04, True, False)
        process.terminate()
        async with asyncio.timeout(PATIENCE_S):
            assert "the other side closed it" in await line.until_lost()
    finally:
        await line.close()
