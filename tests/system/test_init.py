"""``slipd init`` as a person starts it, on the lines of an emulated rig."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

PATIENCE_S = 90.0


def init(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "slipd", "init", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False)


def test_init_writes_a_config_that_check_accepts_and_replaces_none(tmp_path: Path) -> None:
    ports = tmp_path / "ports"
    ports.mkdir()
    pipe = subprocess.PIPE
    devices = {
        name: subprocess.Popen(
            [sys.executable, "-m", "slipd.tools.sim.emulate", name, "--at", str(ports / f"usb-{name}")],
            stdin=pipe,
            stdout=pipe,
        )
        for name in ("gauges", "robotiq_2f")
    }
    try:
        for device in devices.values():
            assert device.stdout is not None
            device.stdout.readline()
        told = [f"{ports}/usb-{name}: {name}" for name in devices]
        done = init(tmp_path, "rig.toml", "--ports", str(ports))
        assert done.returncode == 0, done.stderr
        assert all(line in done.stdout for line in told), done.stdout
    finally:
        for device in devices.values():
            device.terminate()
            device.communicate()
    text = (tmp_path / "rig.toml").read_text()
    check = [sys.executable, "-m", "slipd", "check", "rig.toml"]
    assert subprocess.run(check, cwd=tmp_path, check=False, capture_output=True).returncode == 0
    again = init(tmp_path, "rig.toml", "--ports", str(ports))
    assert again.returncode == 1
    assert "rig.toml exists, and is not replaced" in again.stderr
    assert (tmp_path / "rig.toml").read_text() == text
    nothing = init(tmp_path, "other.toml", "--ports", str(ports))
    assert (nothing.returncode, nothing.stdout) == (1, "")
    assert "there is no serial port in" in nothing.stderr
