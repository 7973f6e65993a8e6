"""Devices of other packages in a fresh environment: installed, listed, emulated, read, recorded, replayed, removed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from project import ROOT

from slipd_client.messages.typed import Slip
from slipd_client.subscriber import Subscriber

pytestmark = [pytest.mark.process, pytest.mark.long]

PACKAGES = ROOT / "clients" / "examples" / "devices"
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
PATIENCE_S = 60.0

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "paxini"
package = "slipd-paxini"
port = "/dev/serial/by-id/paxini"
rate_hz = 100.0
stale_s = 0.1
range_n = 25.4
pad_from_sensor = { xyz_m = [0.0, 0.0, 0.0], quat_xyzw = [1.0, 0.0, 0.0, 0.0] }

[finger.left.pad]
device = "anyskin"
package = "slipd-anyskin"
port = "/dev/serial/by-id/anyskin"
rate_hz = 100.0
stale_s = 0.1
rows = 1
cols = 5
pitch_m = 0.007
electrode_m = 0.007
axis_scale = [1.0, 1.0, 1.0]
"""


class Environment:
    """An environment that borrows slipd and its dependencies from this one, and installs packages of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        venv.create(folder / "venv", symlinks=True)
        self._python = folder / "venv" / "bin" / "python"
        version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
        site = folder / "venv" / "lib" / version / "site-packages"
        (site / "borrowed.pth").write_text(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n")
        self._variables = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}

    def pip(self, *arguments: str | Path) -> None:
        command = (*PIP, "--python", self._python, *arguments)
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
        assert done.returncode == 0, done.stdout + done.stderr

    def slipd(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            (self._python, "-m", "slipd", *arguments),
            cwd=self._folder, env=self._variables, capture_output=True, text=True, check=False, timeout=100,
        )  # fmt: skip

    @contextmanager
    def running(self, until: str, *arguments: str | Path) -> Iterator[str]:
        """Run a command until the block ends; yield what follows the word ``until`` in its output."""
        with subprocess.Popen(
            (self._python, "-m", "slipd", *arguments),
            cwd=self._folder, env=self._variables, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            try:
                assert process.stdout is not None
                lines = iter(process.stdout.readline, "")
                yield next(line.removeprefix(until).strip() for line in lines if line.startswith(until))
            finally:
                process.terminate()
                process.wait(PATIENCE_S)


def pressed(endpoint: str) -> Slip:
    """Wait for a verdict on a finger that is pressed with 8 N."""
    deadline_s = time.monotonic() + PATIENCE_S
    with Subscriber(endpoint, topics=("slip.left",)) as messages:
        for message in messages:
            assert time.monotonic() < deadline_s, message
            if isinstance(message, Slip) and message.normal_n is not None and message.normal_n > 5.0:
                return message
    raise AssertionError("the daemon ended")


def test_a_device_of_another_package_from_its_installation_to_its_removal(tmp_path: Path) -> None:
    rig, recording = tmp_path / "rig.toml", tmp_path / "run.mcap"
    rig.write_text(RIG, encoding="utf-8")
    environment = Environment(tmp_path)
    environment.pip(
        "install", "--quiet", "--no-index", "--no-build-isolation", PACKAGES / "anyskin", PACKAGES / "paxini"
    )
    listed = environment.slipd("devices").stdout
    assert "slipd-anyskin 0.1.0  maker's driver" in listed
    assert "bota" in listed
    assert 'package = "slipd-paxini"' in environment.slipd("devices", "paxini").stdout
    with environment.running("config:", "emulate", rig, "--dir", tmp_path / "emulated") as copy:
        with environment.running("publish:", "run", copy, "--record", recording) as endpoint:
            assert environment.slipd("touch", tmp_path / "emulated", "press left 8 N at 0 0 mm").returncode == 0
            seen = pressed(endpoint)
        assert environment.slipd("touch", tmp_path / "emulated", "show").returncode == 0
    assert seen.level.name.lower() in ("unknown", "caution", "warning"), "without torque it is never stable"
    printed = environment.slipd("replay", recording, "--speed", "max", "--json").stdout
    replayed = [json.loads(line) for line in printed.splitlines()]
    (same,) = (each for each in replayed if each["topic"] == "slip.left" and each["seq"] == seen.seq)
    assert same["normal_n"] == seen.normal_n
    pads = [each for each in replayed if each["topic"] == "tactile.left"]
    assert pads
    assert {tuple(each["image_reasons"]) for each in pads} <= {("raw",), ("stale",), ("stale", "raw"), ("raw", "stale")}
    environment.pip("uninstall", "--quiet", "--yes", "slipd-anyskin")
    for command in (("check", rig), ("run", rig), ("replay", recording)):
        refused = environment.slipd(*command)
        assert refused.returncode == 2
        assert "'anyskin' needs the package 'slipd-anyskin', which is not installed" in refused.stderr
        assert "paxini" not in refused.stderr
