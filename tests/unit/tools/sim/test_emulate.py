from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from slipd.devices.gauges import Decoder
from slipd.tools.sim import emulate
from slipd.tools.sim.emulate import emulated, emulator_for

PATIENCE_S = 30.0


class Echo:
    """A device that echoes its input and counts milliseconds."""

    def __init__(self) -> None:
        self.options: dict[str, Any] = {}
        self.rate_hz = 1000.0
        self.opened_ns: list[int] = []
        self.at_ns: list[int] = []
        self.fails = False

    def opened(self, t_ns: int) -> None:
        self.opened_ns.append(t_ns)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        return [data.upper()]

    def advance(self, t_ns: int) -> list[bytes]:
        self.at_ns.append(t_ns)
        if self.fails:
            raise ArithmeticError("a fault of the emulator")
        return []

    def inquire(self, request: bytes) -> bytes:
        return request[::-1]


@pytest.fixture
def children() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def start(children: ExitStack, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "slipd.tools.sim.emulate", *arguments]
    pipe = subprocess.PIPE
    process = children.enter_context(subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True))
    children.callback(process.kill)
    return process


def read_some(path: Path, count: int) -> bytes:
    port = os.open(path, os.O_RDWR | os.O_NOCTTY)
    data = b""
    while len(data) < count:
        data += os.read(port, 4096)
    os.close(port)
    return data


@pytest.mark.process
def test_a_device_runs_on_a_pseudo_terminal_until_its_process_is_ended(tmp_path: Path, children: ExitStack) -> None:
    path = tmp_path / "gauges"
    told = start(children, "gauges", "--at", str(path))
    closed = start(children, "gauges", "--at", f"{path}2")
    assert told.stdout is not None
    assert closed.stdin is not None
    assert told.stdout.readline() == f"{path}\n"
    device = emulator_for("gauges", str(path))
    decoder = Decoder(**device.options)
    before_s = time.monotonic()
    samples = decoder.receive(read_some(path, 4000), 0)
    assert len(samples) > 50
    assert decoder.health.bad == 0
    assert time.monotonic() - before_s < PATIENCE_S
    told.send_signal(signal.SIGTERM)
    closed.stdin.close()
    assert [told.wait(PATIENCE_S), closed.wait(PATIENCE_S)] == [0, 0]
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


class Chatter:
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
    echo = Echo()
    async with emulated([("gauges", echo, str(tmp_path / "echo"))]) as emulation:
        running = asyncio.create_task(emulation.run())
        async with asyncio.timeout(PATIENCE_S):
            while not echo.at_ns:  # noqa: ASYNC110 - there is no event
                await asyncio.sleep(0)
            time.sleep(pause_ns * 1e-9)  # noqa: ASYNC251 - that is the pause
            known = len(echo.at_ns)
            while len(echo.at_ns) == known:  # noqa: ASYNC110 - there is no event
                await asyncio.sleep(0)
        running.cancel()
    assert (echo.at_ns[known] - echo.at_ns[known - 1] < pause_ns) == suspended


def test_what_a_device_sends_in_a_long_pause_is_lost_and_its_answers_are_not() -> None:
    line = Recorded([b"question"])
    for lost in (True, False):
        emulate._advance(Chatter(), line, 0, lost=lost)
    assert line.sent == [[b"answer"], [b"answer", b"reading"]]


async def test_a_device_that_fails_ends_the_run_with_its_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    echo = Echo()
    echo.fails = True
    with pytest.raises(ArithmeticError, match="of the emulator"):
        await emulate.serve_until_ended([("gauges", echo, str(tmp_path / "echo"))])
    assert capsys.readouterr().out == f"{tmp_path}/echo\n"
