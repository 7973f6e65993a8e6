"""``slipd init`` as a person starts it, on the lines of an emulated rig."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
from rig_parts import first_line, part

pytestmark = pytest.mark.process


def slipd(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "slipd", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_init_writes_a_config_that_check_accepts_and_replaces_none(tmp_path: Path) -> None:
    ports = tmp_path / "ports"
    ports.mkdir()
    init = ("init", "rig.toml", "--ports", str(ports))
    with ExitStack() as stack:
        for name in ("gauges", "robotiq_2f"):
            at = ("--at", f"{ports}/usb-{name}")
            first_line(stack.enter_context(part(tmp_path, "slipd.tools.sim.emulate", name, *at)))
        done = slipd(tmp_path, *init)
    assert done.returncode == 0, done.stderr
    assert f"{ports}/usb-gauges: gauges\n" in done.stdout
    assert f"{ports}/usb-robotiq_2f: robotiq_2f\n" in done.stdout
    text = (tmp_path / "rig.toml").read_text()
    assert slipd(tmp_path, "check", "rig.toml").returncode == 0
    again = slipd(tmp_path, *init)
    assert (again.returncode, "rig.toml exists, and is not replaced" in again.stderr) == (1, True)
    assert (tmp_path / "rig.toml").read_text() == text
    nothing = slipd(tmp_path, "init", "other.toml", "--ports", str(ports))
    assert (nothing.returncode, nothing.stdout) == (1, "")
    assert "there is no serial port in" in nothing.stderr
