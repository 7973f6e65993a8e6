from __future__ import annotations

import asyncio
import os
import time
from pathlib import Path

import pytest

from slipd.tools.sim import emulate
from slipd.tools.sim.emulate import emulated
from slipd.tools.sim.emulators import EmulatedDevice

PATIENCE_S = 30.0


class Clocked(EmulatedDevice):
    """A device that notes its times."""

    def __init__(self) -> None:
        super().__init__(1000.0)
        self.at_ns: list[int] = []
        self.fails = False

    def advance(self, t_ns: int) -> list[bytes]:
        self.at_ns.append(t_ns)
        if self.fails:
            raise ArithmeticError("a fault of the emulator")
        return []


class Chatter(EmulatedDevice):
    """A device that answers and sends readings."""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        return [b"answer"]

    def advance(self, t_ns: int) -> list[bytes]:
        return [b"reading"]


class Recorded:
    """A line with the same input at each turn."""

    def __init__(self, received: list[bytes]) -> None:
        self.received, self.sent = received, []

    def listen(self) -> tuple[bool, list[bytes]]:
        return False, self.received

    def send(self, output: list[bytes]) -> None:
        self.sent.append(output)


@pytest.mark.parametrize("suspended", [False, True])
async def test_after_a_long_pause_the_clock_went_on_and_after_a_suspension_it_did_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, suspended: bool
) -> None:
    pause_ns = int(1.5 * emulate.LONGEST_LAG_NS)
    if suspended:
        monkeypatch.setattr(emulate, "SUSPENDED_NS", pause_ns)
    device = Clocked()
    async with emulated([("gauges", device, str(tmp_path / "line"))]) as lines:
        running = asyncio.create_task(emulate.run(lines))
        async with asyncio.timeout(PATIENCE_S):
            while not device.at_ns:  # noqa: ASYNC110 - there is no event
                await asyncio.sleep(0)
            time.sleep(pause_ns * 1e-9)  # noqa: ASYNC251 - that is the pause
            known = len(device.at_ns)
            while len(device.at_ns) == known:  # noqa: ASYNC110 - there is no event
                await asyncio.sleep(0)
        running.cancel()
    assert (device.at_ns[known] - device.at_ns[known - 1] < pause_ns) == suspended


def test_what_a_device_sends_in_a_long_pause_is_lost_and_its_answers_are_not() -> None:
    line = Recorded([b"question"])
    for lost in (True, False):
        emulate._advance(Chatter(1000.0), line, 0, lost=lost)
    assert line.sent == [[b"answer"], [b"answer", b"reading"]]


async def test_a_device_that_fails_ends_the_run_with_its_fault(tmp_path: Path) -> None:
    device = Clocked()
    device.fails = True
    with pytest.raises(ArithmeticError, match="of the emulator"):
        await emulate.serve_until_ended([("gauges", device, str(tmp_path / "line"))])


async def test_devices_are_served_until_standard_input_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    monkeypatch.setattr("sys.stdin", os.fdopen(read))
    os.write(write, b"0.5\n")
    os.close(write)
    heard: list[str] = []
    devices = [("gauges", Clocked(), str(tmp_path / "line"))]
    await emulate.serve_until_ended(devices, hear=heard.append, ready=lambda: heard.append("ready"))
    assert heard == ["ready", "0.5\n"]
