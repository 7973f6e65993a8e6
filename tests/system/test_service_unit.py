"""The systemd unit of config/, checked by the tools of systemd where they exist."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from project import CONFIG, ROOT

from slipd.host.stage_checks import ANSWER_S
from slipd.host.watchdog import FEEDS_PER_TIMEOUT

UNIT, USER_UNIT = CONFIG / "slipd.service", CONFIG / "slipd-user.service"
RULES, USERS = CONFIG / "70-slipd.rules", CONFIG / "slipd.sysusers"

MOST_EXPOSED = 1.6
"""Of ``systemd-analyze security``: a network of sensors, serial ports, generated code and real-time priority."""

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
both = pytest.mark.parametrize("unit", [UNIT, USER_UNIT], ids=lambda unit: unit.name)


@needs_systemd
@both
def test_systemd_understands_every_line(unit: Path, tmp_path: Path) -> None:
    here = tmp_path / unit.name
    here.write_text(re.sub(r"(?<=ExecStart=)\S+", "/bin/true", unit.read_text(encoding="utf-8")), encoding="utf-8")
    done = subprocess.run(["systemd-analyze", "verify", str(here)], capture_output=True, text=True)
    assert (done.returncode, [line for line in done.stderr.splitlines() if unit.name in line]) == (0, [])


@both
def test_P5_a_daemon_that_crashes_is_started_again_without_limit(unit: Path) -> None:
    lines = unit.read_text(encoding="utf-8").splitlines()
    assert {"StartLimitIntervalSec=0", "Restart=always"} <= set(lines)
    [pause_s] = [float(line.partition("=")[2]) for line in lines if line.startswith("RestartSec=")]
    assert 0.0 < pause_s <= 2.0


@both
def test_P2_a_daemon_that_hangs_is_ended_by_the_watchdog(unit: Path) -> None:
    lines = unit.read_text(encoding="utf-8").splitlines()
    assert {"Type=notify", "NotifyAccess=main", "ExecReload=/bin/kill -HUP $MAINPID"} <= set(lines)
    [timeout_s] = [float(line.partition("=")[2]) for line in lines if line.startswith("WatchdogSec=")]
    assert timeout_s / FEEDS_PER_TIMEOUT > ANSWER_S


@pytest.mark.skipif(shutil.which("systemd-sysusers") is None, reason="needs systemd-sysusers")
def test_the_user_of_the_service_may_open_serial_ports(tmp_path: Path) -> None:
    (tmp_path / "etc").mkdir()
    (tmp_path / "base.conf").write_text("g dialout 20\n", encoding="utf-8")
    files = [str(tmp_path / "base.conf"), str(USERS)]
    subprocess.run(["systemd-sysusers", f"--root={tmp_path}", *files], capture_output=True, check=True)
    groups = (tmp_path / "etc" / "group").read_text(encoding="utf-8").splitlines()
    assert "dialout:x:20:slipd" in groups


def test_every_rule_of_udev_is_a_list_of_matches_and_assignments() -> None:
    part = re.compile(r'[A-Z]+(\{[\w.]+\})?(==|!=|=|\+=)"[^"]*"')
    for line in RULES.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("# "):
            assert all(part.fullmatch(each) for each in line.split(", ")), line


@needs_systemd
def test_it_is_exposed_no_more_than_serial_ports_and_a_network_need() -> None:
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(UNIT)], capture_output=True, text=True
    )
    [level] = re.findall(r"Overall exposure level for slipd.service: ([\d.]+)", done.stdout)
    assert float(level) <= MOST_EXPOSED


def test_the_runtime_directory_is_for_the_group_alone() -> None:
    text = UNIT.read_text(encoding="utf-8")
    for line in ("UMask=0027", "RuntimeDirectory=slipd", "RuntimeDirectoryMode=0750", "Group=slipd"):
        assert f"\n{line}\n" in text


def test_recordings_on_request_go_where_the_unit_lets_them_be_written() -> None:
    text = UNIT.read_text(encoding="utf-8")
    [variables] = re.findall(r"^Environment=(.*)$", text, re.MULTILINE)
    [name] = re.findall(r"^StateDirectory=(.*)$", text, re.MULTILINE)
    assert f"SLIPD_STATE_DIR=/var/lib/{name}" in variables.split()


def make(target: str, root: Path) -> int:
    """Return the exit code of a target below another root."""
    return subprocess.run(["make", "-s", target, f"DESTDIR={root}"], cwd=ROOT, capture_output=True).returncode


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_uninstall_removes_what_install_put_there_and_nothing_else(tmp_path: Path) -> None:
    home, program = tmp_path / "usr/local/lib/slipd", tmp_path / "usr/local/bin/slipd"
    unit, rules = tmp_path / "etc/systemd/system/slipd.service", tmp_path / "etc/udev/rules.d/70-slipd.rules"
    for path in (home / "notes", program, unit, rules):
        path.parent.mkdir(parents=True, exist_ok=True)
    (home / "notes").touch()
    program.symlink_to("/opt/own/slipd")
    unit.write_text(UNIT.read_text(encoding="utf-8"), encoding="utf-8")  # of a place of its own
    rules.write_text(RULES.read_text(encoding="utf-8") + "# mine\n", encoding="utf-8")
    assert make("install", tmp_path) != 0, "the folder holds something else"
    assert make("uninstall", tmp_path) == 0
    assert (home / "notes").exists()
    assert program.is_symlink()
    assert unit.exists()
    assert rules.exists()

    (home / "pyvenv.cfg").touch()
    program.unlink()
    program.symlink_to("/usr/local/lib/slipd/bin/slipd")
    unit.write_text(
        re.sub(r"(?<=ExecStart=)\S+", "/usr/local/bin/slipd", UNIT.read_text(encoding="utf-8")), encoding="utf-8"
    )
    shutil.copy(RULES, rules)
    assert make("uninstall", tmp_path) == 0
    assert not any(path.exists() or path.is_symlink() for path in (home, program, unit, rules))
    assert make("uninstall", tmp_path) == 0, "again"


PYTHON_STUB = """#!/bin/sh
case "$1 $2" in
"-c "*) echo 3.11;;
"-m venv") mkdir -p "$4/bin"; cp "$0" "$4/bin/python"; echo "home = $4" > "$4/pyvenv.cfg";;
esac
"""
"""In place of an interpreter: a real one would download the dependencies."""


class Stranger:
    """An unprivileged user with a read-only home, who has a copy of what ``make install`` reads.

    Attributes:
        home: The home; there is ``/place`` beside it, to which the user may write.
    """

    def __init__(self, folder: Path) -> None:
        self.home, self.place, self._source = folder / "home", folder / "place", folder / "source"
        self._python = folder / "python"
        for path in (self.home, self.place, self._source):
            path.mkdir()
        shutil.copy(ROOT / "Makefile", self._source)
        shutil.copytree(CONFIG, self._source / "config")
        self._python.write_text(PYTHON_STUB, encoding="utf-8")
        for path in (folder, self._python):
            path.chmod(0o755)
        os.chown(self.home, NOBODY, NOBODY)
        self.home.chmod(0o555)
        os.chown(self.place, NOBODY, NOBODY)

    def make(self, target: str, *variables: str) -> tuple[int, str]:
        """Return the exit code of a target, and what it printed."""
        user = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
        command = [*user, "make", "-s", target, f"PYTHON={self._python}", *variables]
        environment = {"HOME": str(self.home), "PATH": os.defpath}
        done = subprocess.run(command, cwd=self._source, env=environment, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr


NOBODY = 65_534


@pytest.fixture
def stranger() -> Iterator[Stranger]:
    """An unprivileged user; a folder of a test of root is closed to others."""
    if os.geteuid() != 0 or not shutil.which("setpriv") or not shutil.which("make", path=os.defpath):
        pytest.skip("needs root, who can become another user, setpriv and make")
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        yield Stranger(Path(folder))


def test_an_unprivileged_user_with_a_read_only_home_learns_which_place_is_needed(stranger: Stranger) -> None:
    code, said = stranger.make("install")
    assert code != 0
    assert "/usr/local cannot be written. Name a place that you may write to: make install PREFIX=~/.local" in said
    code, said = stranger.make("install", "PREFIX=~/.local")
    assert code != 0
    assert (
        f"{stranger.home}/.local cannot be written. Name a place that you may write to: make install PREFIX=/PLACE"
        in said
    )
    assert list(stranger.home.iterdir()) == []


def test_an_unprivileged_user_with_a_read_only_home_installs_elsewhere_without_a_unit(stranger: Stranger) -> None:
    code, said = stranger.make("install", f"PREFIX={stranger.place}")
    assert (code, said.splitlines()) == (
        0,
        [
            f"== slipd into {stranger.place}/lib/slipd",
            f"== no systemd unit: {stranger.home}/.config/systemd/user cannot be written; slipd run works without",
            "== installed; next: docs/service.md",
        ],
    )
    program = stranger.place / "bin" / "slipd"
    assert program.readlink() == stranger.place / "lib" / "slipd" / "bin" / "slipd"
    code, _ = stranger.make("uninstall", f"PREFIX={stranger.place}")
    assert code == 0
    assert [path.name for path in sorted(stranger.place.rglob("*"))] == ["bin", "lib"]
    assert list(stranger.home.iterdir()) == []
