"""The program that measures a fleet, with a small one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from project import MODULES

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

pytestmark = [pytest.mark.process, pytest.mark.timeout(300)]


def test_a_small_fleet_is_measured_and_loses_no_warning(tmp_path: Path) -> None:
    report = tmp_path / "report.md"
    command = [
        sys.executable,
        "-m",
        "fleet",
        "--robots",
        "2",
        "--crowd",
        "5",
        "--seconds",
        "3",
        "--report",
        str(report),
    ]
    done = subprocess.run(command, env={"PYTHONPATH": MODULES}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = [line.split(" | ") for line in report.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    lost = {cells[0].strip("| "): cells[3] for cells in rows if cells[0] == "| warning"}
    assert lost == {"warning": "0"}
    outages = {cells[0].strip("| "): cells[-1] for cells in rows if cells[0] in ("| killed", "| frozen")}
    assert outages == {"killed": "0 |", "frozen": "0 |"}
