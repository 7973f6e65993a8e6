"""The robot program of README, as a process: no daemon yet, one that is killed, and the next one."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from project import ROOT

from slipd import config
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.messages.typed import StatusReply

PATIENCE_S = 60.0
(PROGRAM,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)


@contextmanager
def part(log: Path, *command: str) -> Iterator[subprocess.Popen[str]]:
    with (
        log.open("a") as errors,
        subprocess.Popen(
            [sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
        ) as process,
    ):
        try:
            yield process
        finally:
            process.kill()


class Printed:
    """Collects the lines that a process prints."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._lines: list[str] = []
        assert process.stdout is not None
        threading.Thread(target=self._lines.extend, args=(process.stdout,), daemon=True).start()

    def about(self, *beginnings: str) -> bool:
        return any(line.startswith(beginnings) for line in self._lines)


def wait(until: Callable[[], object], what: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not until():
        assert time.monotonic() < end_s, what
        time.sleep(0.02)


def status() -> StatusReply | None:
    """The status of the daemon; None while none answers."""
    try:
        with GripClient() as client:
            return client.status()
    except ClientError:
        return None


def steered() -> bool:
    """Whether a client holds the lease and reports gravity."""
    found = status()
    return found is not None and found.lease.held and found.streams["left.wrench"].gravity == "compensated"


@pytest.mark.process
def test_the_program_of_readme_outlives_the_daemon_that_it_steers(tmp_path: Path, runtime: Path) -> None:
    log, rig = tmp_path / "errors.log", tmp_path / "demo.toml"
    text = config.shipped("demo.toml").read_text("utf-8").replace('"virtual/', f'"{tmp_path}/')
    rig.write_text(text.replace("[finger.left.wrench]", "[finger.left.wrench]\nmass_kg = 0.02"))
    serve = ("-m", "slipd", "run", str(rig))
    with part(log, "-m", "slipd.tools.sim.virtual_gripper", "--dir", str(tmp_path)) as hand:
        assert hand.stdout is not None
        hand.stdout.readline()
        with part(log, "-u", "-c", PROGRAM) as program:
            printed = Printed(program)
            wait(lambda: printed.about("nobody accepts requests"), "it waits for a daemon")
            with part(log, *serve) as daemon:
                wait(steered, "it steers")
                daemon.send_signal(signal.SIGKILL)
                wait(lambda: printed.about("the lease is lost", "no answer from"), "it notices, waiting or asking")
                assert "left.wrench" in (runtime / "log").read_text(), "a killed daemon leaves its log"
            with part(log, *serve):
                wait(steered, "it steers by the next daemon")
