"""The exchange of docs/clients.md as it stands there, with the daemon and an emulated gripper that holds an object."""

from __future__ import annotations

import asyncio
import re
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from daemon_peers import PATIENCE_S
from project import DOCS
from service_rig import serving

from slipd import config
from slipd.sim import emulate
from slipd.sim.touched_devices import TouchedDevices
from slipd_client.aio import AsyncGripClient
from slipd_client.errors import RequestRefused

pytestmark = pytest.mark.process

PAGE = (DOCS / "clients.md").read_text(encoding="utf-8")
(EXCHANGE,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/ttyUSB0"
rate_hz = 100.0

[gripper]
device = "robotiq_2f"
port = "/dev/ttyUSB1"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 30.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
speed_table = [[0, 0.020], [255, 0.150]]
min_force_n = 3.0
max_force_n = 25.0
step_n = 2.0
"""

STALLED = ("no_lease", "deadline_passed", "not_ready", "may be pressed", "no reply")
"""How the exchange ends on a machine that stood still for longer than the lease lasts."""


@asynccontextmanager
async def tared_rig(folder: Path) -> AsyncIterator[str]:
    """A finger and a gripper with an object between its pads, once the finger is tared; the endpoint of requests."""
    devices = TouchedDevices(config.parse(RIG, "rig.toml"), folder)
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


async def run(program: Path, endpoint: str) -> tuple[str, str]:
    """Run a program, and return what it printed and its errors."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(sys.executable, program, endpoint, stdout=pipe, stderr=pipe)
    out, errors = await asyncio.wait_for(process.communicate(), PATIENCE_S)
    return out.decode(), errors.decode()


@pytest.mark.parametrize("kind", ["DEALER", "REQ"])
async def test_the_exchange_grips_and_raises(
    kind: str, tmp_path: Path, runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emulate, "TICK_NS", 5_000_000)  # enough for these rates, and lighter
    program = tmp_path / "exchange.py"
    program.write_text(EXCHANGE.replace("zmq.DEALER", f"zmq.{kind}"), encoding="utf-8")
    until_s = time.monotonic() + 2 * PATIENCE_S
    while True:
        async with tared_rig(tmp_path) as endpoint:
            out, errors = await run(program, endpoint)
        if time.monotonic() > until_s or not any(word in errors for word in STALLED):
            break
    assert errors == ""
    closed, raised = map(float, re.findall(r"^(?:closing with|raised to) ([\d.]+) N$", out, re.MULTILINE))
    assert closed == pytest.approx(8.0, abs=0.2)
    assert raised == pytest.approx(9.0, abs=0.2)
