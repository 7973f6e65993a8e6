from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from slipd.devices.gauges import Decoder
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


END: dict[str, Callable[[subprocess.Popen[bytes]], object]] = {
    "told": lambda process: process.send_signal(signal.SIGTERM),
    "closed": lambda process: process.stdin.close(),  # type: ignore[union-attr]
}


@pytest.mark.process
@pytest.mark.parametrize("how", END)
def test_a_device_runs_on_a_pseudo_terminal_until_its_process_is_ended(tmp_path: Path, how: str) -> None:
    path, decoder, count = tmp_path / "gauges", Decoder(), 0
    command = [sys.executable, "-m", "slipd.tools.sim.emulate", "gauges", "--at", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == f"{path}\n".encode()  # type: ignore[union-attr]
        with path.open("rb", buffering=0) as port:
            while count < 50:
                count += len(decoder.receive(port.read(4096), 0))
        assert decoder.health.bad == 0
        END[how](process)
        assert process.wait(PATIENCE_S) == 0
    assert not path.is_symlink()


@pytest.mark.parametrize(
    ("device", "address", "words"),
    [
        ("gauge", "/tmp/x", "DEVICE must be one of bota, "),
        ("gauges", "udp://127.0.0.1:5", "the address of gauges must be of kind serial, got udp://127.0.0.1:5"),
        ("netft", "udp://127.0.0.1", "must have host and port"),
        ("gauges", "/nowhere/at/all", "No such file"),
    ],
)
def test_wrong_arguments_are_refused_with_a_reason(
    device: str, address: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert emulate.main([device, "--at", address]) == 2
    assert words in capsys.readouterr().err


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
    async with emulated([("gauges", device, str(tmp_path / "line"))]) as emulation:
        running = asyncio.create_task(emulation.run())
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


async def test_a_device_that_fails_ends_the_run_with_its_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    device = Clocked()
    device.fails = True
    with pytest.raises(ArithmeticError, match="of the emulator"):
        await emulate.serve_until_ended([("gauges", device, str(tmp_path / "line"))])
    assert capsys.readouterr().out == f"{tmp_path}/line\n"
