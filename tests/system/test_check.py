"""``slipd check``: what it prints of good, weak and faulty configs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from project import CONFIG

from slipd import config
from slipd.cli import main

SLIPD = str(Path(sys.executable).with_name("slipd"))


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.toml")), ids=lambda path: path.name)
def test_check_lists_the_streams_of_a_shipped_config(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(path)]) == 0
    rig = config.load(path)
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines[: len(rig.streams())]] == list(rig.streams())
    assert lines[-1] == f"{path}: valid, config_id {rig.config_id}"


@pytest.mark.process
@pytest.mark.parametrize("command", [["check"], ["run"]])
def test_check_and_run_refuse_a_rig_that_cannot_be(command: list[str], tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    text = (CONFIG / "demo.toml").read_text(encoding="utf-8")
    rig.write_text(
        text.replace("pitch_m = 0.0032", "pitch_m = 3.2", 1)
        .replace("xyz_m = [0.004, -0.002, -0.025]", "xyz_m = [4, -2, -25]", 1)
        .replace("mu = 0.55", "mu = 5.5", 1)
        .replace("rate_hz = 800.0", "rate_hz = 8000.0", 1),
        encoding="utf-8",
    )
    done = subprocess.run([SLIPD, *command, str(rig)], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == (1 if command == ["check"] else 2), done.stderr
    rows = text.splitlines()
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        f"{rig}:{rows.index(row) + 1}: finger.left.{fault}"
        for row, fault in (
            (
                next(row for row in rows if row.startswith("mu = 0.55")),
                "mu: must be from 0.01 to 2, got 5.5: did you mean 0.55?",
            ),
            (
                next(row for row in rows if row.startswith("pad_from_sensor")),
                "wrench.pad_from_sensor.xyz_m: must be from -1 to 1 m, got 4: did you mean 4 mm? write 0.004",
            ),
            (
                "pitch_m = 0.0032",
                "pad.pitch_m: must be from 0.0001 to 0.05 m, got 3.2: did you mean 3.2 mm? write 0.0032",
            ),
        )
    ], "a fault of form hides none of its own kind"


@pytest.mark.parametrize(
    ("limits", "gain_n"),
    [
        ("", 5),
        ("budget_n = 4.0", 4),
        ("budget_n = 10.0\nstep_n = 20.0", 10),
        ("budget_n = 20.0\nstep_n = 20.0", 16),
    ],
)
def test_check_prints_the_reach_of_the_reflex_within_budget_step_and_rate(
    limits: str, gain_n: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    text = (CONFIG / "demo.toml").read_text(encoding="utf-8").replace("enabled = false", "enabled = true")
    for key in ("budget_n", *(["step_n"] if "step_n" in limits else [])):
        text = re.sub(rf"^{key} =.*\n", "", text, flags=re.MULTILINE)
    rig.write_text(text.replace("[gripper]", f"[gripper]\n{limits}"), encoding="utf-8")
    assert main(["check", str(rig)]) == 0
    assert f"adds up to {gain_n}.0 N within the lead time of 0.3 s" in capsys.readouterr().out
