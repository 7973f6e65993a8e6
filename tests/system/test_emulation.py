"""Emulated devices that a hand presses from the shell, a daemon that reads them, and clients: each a process."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from project import ROOT

pytestmark = pytest.mark.process

PATIENCE_S = 100.0
RIG = """# One finger of moderate rates.
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/serial/by-id/left-wrench"
hardware_id = "of the real one"
rate_hz = 100.0
sign = -1
stale_s = 0.5
pad_from_sensor = { xyz_m = [0.004, -0.002, -0.025], quat_xyzw = [0.9659258, 0.2588190, 0.0, 0.0] }
"""


def run(folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Run a script of a shell that finds slipd and slipctl."""
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "SLIPD_RUNTIME_DIR": str(folder / "run"),
    }
    pipe = subprocess.PIPE
    with subprocess.Popen(
        ["bash", "-c", script], cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True, start_new_session=True
    ) as shell:
        try:
            out, errors = shell.communicate(timeout=PATIENCE_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGKILL)  # what a script that failed left behind
    return subprocess.CompletedProcess(shell.args, shell.returncode, out, errors)


@pytest.mark.long
def test_the_mass_of_a_finger_is_identified_from_the_shell_as_the_page_shows(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "emulation.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
    press = "slipd touch rig press left 5 kg && echo accepted; slipd touch rig show; kill %1\n"
    done = run(tmp_path, f"{script.replace('kill %1', press)}")
    assert done.returncode == 0, done.stderr
    found = tomllib.loads(done.stdout[done.stdout.index("[finger.left.wrench]") :].partition("left: ")[0])
    wrench = found["finger"]["left"]["wrench"]
    assert (wrench["mass_kg"], *wrench["com_m"]) == pytest.approx((0.085, 0.0, 0.002, -0.014), abs=0.001)
    assert "left: nothing touches" in done.stdout
    assert "the unit must be N, got 'kg'" in done.stderr
    assert "accepted" not in done.stdout
    assert not any((tmp_path / "rig" / name).exists() for name in ("hand", "rig.toml"))


def test_a_shipped_config_is_emulated_by_its_name(tmp_path: Path) -> None:
    done = run(tmp_path, "echo quit | slipd emulate bota_xela; echo $?; echo quit | slipd emulate bota_xelo; echo $?")
    assert re.search(r"\nconfig: /\S+/bota_xela.toml\n0\n2\n\Z", done.stdout), done.stdout
    assert "there is no config 'bota_xelo'; did you mean 'bota_xela'?" in done.stderr


def test_commands_come_from_standard_input_and_faults_are_named(tmp_path: Path) -> None:
    done = run(
        tmp_path,
        "printf 'press left 5 N at 1 2 mm\\nshow; push left +x 9 N\\nshow\\nnonsense\\n' | slipd emulate rig.toml;"
        "echo $?; slipd emulate rig.toml --dir . ; echo $?; slipd touch nowhere show; echo $?",
    )
    lines = done.stdout.splitlines()
    assert lines[0].startswith("bota: ")
    shown = "left: normal 5.00 N at 1.0, 2.0 mm, tangential {}, 0.00 N, spin 0.0 mN·m"
    assert {shown.format("0.00"), shown.format("2.25")} <= set(lines)
    assert any(line.startswith("error: a command must begin with press") for line in lines)
    assert [line for line in lines if line.isdigit()] == ["0", "1", "1"]
    for told in (
        "--dir must not be the folder of the config",
        "no emulation at nowhere",
    ):
        assert told in done.stderr
    assert (tmp_path / "rig.toml").read_text(encoding="utf-8") == RIG
    assert "Traceback" not in done.stderr


def test_a_copy_that_was_changed_is_kept(tmp_path: Path) -> None:
    done = run(
        tmp_path,
        "for dir in '--dir rig' ''; do mkfifo hold; slipd emulate rig.toml $dir <hold >out & exec 9>hold;"
        "until grep -qs ^config: out; do sleep 0.1; done; copy=$(sed -n 's/^config: //p' out);"
        "sed -i 's/sign = -1/sign = 1  # slipd commission/' \"$copy\"; echo quit >&9; wait; exec 9>&-;"
        'tail -1 out; rm hold out; ls "$copy"; done',
    )
    kept = [Path(line.rpartition(" as ")[2]) for line in done.stdout.splitlines()]
    assert [path.name for path in kept] == ["rig.commissioned.toml"] * 2, done.stderr
    assert all("sign = 1  # slipd commission\n" in path.read_text(encoding="utf-8") for path in kept)
    assert (kept[0].parent, done.stderr.count("No such file")) == (tmp_path / "rig", 2), "the copies are gone"


def test_a_copy_that_was_changed_before_the_emulation_was_killed_is_kept_at_its_next_start(tmp_path: Path) -> None:
    emulate = "slipd emulate rig.toml --dir rig"
    done = run(
        tmp_path,
        f"{emulate} </dev/null >out & until grep -qs ^config: out; do sleep 0.1; done;"
        "sed -i 's/sign = -1/sign = 1  # slipd commission/' rig/rig.toml;"
        f"{emulate} </dev/null; echo $?; kill -9 %1; wait; echo quit | {emulate} >second; echo $?; head -1 second;"
        f"ls -A rig; echo mine >rig/rig.toml; {emulate} </dev/null; echo $?; cat rig/rig.toml",
    )
    kept = tmp_path / "rig" / "rig.commissioned.toml"
    told = f"the config was changed; it is kept, with the addresses of the emulated devices, as {kept}"
    assert done.stdout.splitlines() == ["2", "0", told, kept.name, "1", "mine"], done.stderr
    assert "rig: an emulation runs there; end it, or give another --dir" in done.stderr
    assert "exists, and no emulation wrote it: move it away" in done.stderr
