"""The systemd unit of config/, checked by the tools of systemd where they exist."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from project import CONFIG

UNIT = CONFIG / "slipd.service"

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")


@needs_systemd
def test_systemd_understands_every_line(tmp_path: Path) -> None:
    here = tmp_path / UNIT.name
    here.write_text(re.sub(r"(?<=ExecStart=)\S+", "/bin/true", UNIT.read_text(encoding="utf-8")), encoding="utf-8")
    done = subprocess.run(["systemd-analyze", "verify", str(here)], capture_output=True, text=True)
    assert (done.returncode, [line for line in done.stderr.splitlines() if UNIT.name in line]) == (0, [])


@needs_systemd
def test_it_is_exposed_no_more_than_serial_ports_and_a_network_need() -> None:
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(UNIT)], capture_output=True, text=True
    )
    [level] = re.findall(r"Overall exposure level for slipd.service: ([\d.]+)", done.stdout)
    assert float(level) <= 1.5


def test_the_runtime_directory_is_for_the_group_alone() -> None:
    text = UNIT.read_text(encoding="utf-8")
    for line in ("UMask=0027", "RuntimeDirectory=slipd", "RuntimeDirectoryMode=0750", "Group=slipd"):
        assert f"\n{line}\n" in text


def test_recordings_on_request_go_where_the_unit_lets_them_be_written() -> None:
    text = UNIT.read_text(encoding="utf-8")
    [variables] = re.findall(r"^Environment=(.*)$", text, re.MULTILINE)
    [name] = re.findall(r"^StateDirectory=(.*)$", text, re.MULTILINE)
    assert f"SLIPD_STATE_DIR=/var/lib/{name}" in variables.split()
