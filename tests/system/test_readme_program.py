"""The robot program of README, as a process: no daemon yet, one that is killed, and the next one."""

from __future__ import annotations

import re
import signal
import subprocess
from pathlib import Path

import pytest
from project import ROOT
from rig_parts import endpoints_of, first_line, part, wait_for

from slipd.tools.shipped_files import shipped_config
from slipd_client.grip import GripClient

(PROGRAM,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)


def printed(program: subprocess.Popen[str], *beginnings: str) -> str:
    """Wait for a line that begins so."""
    assert program.stdout is not None
    return next(line for line in program.stdout if line.startswith(beginnings))


def steered() -> bool:
    """Whether a client holds the lease and reports gravity."""
    with GripClient() as client:
        status = client.status()
    return status.lease.held and status.streams["left.wrench"].gravity == "compensated"


@pytest.mark.process
def test_the_program_of_readme_outlives_the_daemon_that_it_steers(tmp_path: Path, runtime: Path) -> None:
    rig = tmp_path / "demo.toml"
    text = shipped_config("demo.toml").read_text("utf-8").replace('"virtual/', f'"{tmp_path}/')
    rig.write_text(text.replace("[finger.left.wrench]", "[finger.left.wrench]\nmass_kg = 0.02"))
    (tmp_path / "steers.py").write_text(PROGRAM)
    serve = (tmp_path, "slipd", "run", str(rig))
    with (
        part(tmp_path, "slipd.tools.sim.virtual_gripper", "--dir", str(tmp_path)) as hand,
        part(tmp_path, "steers", PYTHONPATH=str(tmp_path), PYTHONUNBUFFERED="1") as program,
    ):
        first_line(hand)
        printed(program, "nobody accepts requests")
        with part(*serve) as daemon:
            endpoints_of(daemon)
            wait_for(steered)
            daemon.send_signal(signal.SIGKILL)
            printed(program, "the lease is lost", "no answer from")
            assert "left.wrench" in (runtime / "log").read_text(), "a killed daemon leaves its log"
        with part(*serve):
            wait_for(steered)
