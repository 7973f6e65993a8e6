"""The example exchange of docs/clients.md, with the daemon and an emulated gripper that holds an object."""

from __future__ import annotations

import asyncio
import mmap
import re
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from daemon_peers import PATIENCE_S
from gripper_table import gripper_table
from project import ROOT
from service_rig import serving

from slipd import config
from slipd.tools.sim import emulate
from slipd.tools.sim.touched_devices import TouchedDevices
from slipd_client.aio import AsyncGripClient
from slipd_client.errors import RequestRefused

pytestmark = pytest.mark.process

EXCHANGE = (ROOT / "clients" / "examples" / "exchange.py").read_text(encoding="utf-8")

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/ttyUSB0"
rate_hz = 100.0
"""
GRIPPER = gripper_table("/dev/ttyUSB1", speed_table=[[0, 0.020], [255, 0.150]], min_force_n=3.0, step_n=2.0)

SHARED = """
import mmap, sys, time
with open(sys.argv.pop(), "r+b") as file:
    shared = memoryview(mmap.mmap(file.fileno(), 16)).cast("q")
pause, shared[1] = time.sleep, shared[0]

def sleep(seconds):
    shared[1] = shared[0] + round(seconds * 1e9)
    while shared[0] < shared[1]:
        pause(0.001)

time.sleep, time.monotonic_ns, time.monotonic = sleep, lambda: shared[0], lambda: shared[0] * 1e-9
"""
"""Begin of the program: its clock is that of `SharedClock`, which stands still unless the program sleeps."""

STEP_NS = 1_000_000
END_OF_TIME_NS = 2**63 - 1


class SharedClock:
    """The clock of daemon, emulated devices and program, by which none of them is late on a busy machine.

    It advances in the loop of daemon and devices, by one step a turn at most, and only while the program sleeps.

    Args:
        file: Holds the time, and the time until which the program sleeps, both in ns.
    """

    def __init__(self, file: Path) -> None:
        file.write_bytes(bytes(16))
        with file.open("r+b") as opened:
            self._shared = memoryview(mmap.mmap(opened.fileno(), 16)).cast("q")
        self._shared[0] = time.monotonic_ns()
        self.run_freely()

    def run_freely(self) -> None:
        """Advance without a program, until one begins."""
        self._shared[1] = END_OF_TIME_NS

    def now_ns(self, *_: int) -> int:
        """Return the time."""
        return self._shared[0]

    async def run(self) -> None:
        """Advance until cancelled."""
        while True:
            await asyncio.sleep(STEP_NS * 1e-9)
            self._shared[0] = min(self._shared[0] + STEP_NS, max(self._shared[1], self._shared[0]))


@pytest.fixture
async def clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[SharedClock]:
    clock = SharedClock(tmp_path / "clock")
    monkeypatch.setattr(time, "monotonic_ns", clock.now_ns)
    monkeypatch.setattr(time, "clock_gettime_ns", clock.now_ns)
    running = asyncio.create_task(clock.run())
    yield clock
    running.cancel()
    await asyncio.wait([running])


@asynccontextmanager
async def tared_rig(folder: Path) -> AsyncIterator[str]:
    """A finger and a gripper with an object between its pads, once the finger is tared; the endpoint of requests."""
    devices = TouchedDevices(config.parse(RIG + GRIPPER, "rig.toml"), folder)
    devices.hand.part_m = 0.05
    async with emulate.emulated(devices.devices, devices.advance) as emulation:
        running = asyncio.create_task(emulation.run())
        try:
            async with serving(config.parse(devices.config_text(), "rig.toml")) as client:
                endpoint = client.endpoints.requests
                async with AsyncGripClient(endpoint, timeout_s=PATIENCE_S) as person, asyncio.timeout(PATIENCE_S):
                    while True:
                        try:
                            await person.tare("left", 0.05)
                            break
                        except RequestRefused:
                            await asyncio.sleep(0.02)
                yield endpoint
        finally:
            running.cancel()
            await asyncio.wait([running])


async def run(program: Path, endpoint: str, clock: Path) -> tuple[str, str]:
    """Run a program, and return what it printed and its errors."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(sys.executable, program, endpoint, clock, stdout=pipe, stderr=pipe)
    out, errors = await asyncio.wait_for(process.communicate(), 2 * PATIENCE_S)
    return out.decode(), errors.decode()


@pytest.mark.parametrize("kind", ["DEALER", "REQ"])
async def test_the_exchange_grips_and_raises(
    kind: str, clock: SharedClock, tmp_path: Path, runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emulate, "TICK_NS", 5_000_000)  # enough for these rates, and lighter
    program = tmp_path / "exchange.py"
    patient = EXCHANGE.replace("1000)", f"{PATIENCE_S * 1e3:.0f})")
    program.write_text(SHARED + patient.replace("zmq.DEALER", f"zmq.{kind}"), encoding="utf-8")
    async with tared_rig(tmp_path) as endpoint:
        out, errors = await run(program, endpoint, tmp_path / "clock")
        clock.run_freely()
    assert errors == ""
    closed, raised = map(float, re.findall(r"^(?:closing with|raised to) ([\d.]+) N$", out, re.MULTILINE))
    assert closed == pytest.approx(8.0, abs=0.2)
    assert raised == pytest.approx(9.0, abs=0.2)
