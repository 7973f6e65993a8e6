"""The systemd unit of config/, checked by the tools of systemd where they exist."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from project import CONFIG, ROOT

from slipd.cli import main
from slipd.io.host.systemd import ANSWER_S, FEEDS_PER_TIMEOUT
from slipd.tools.service_command import own_program, with_program

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
    (home / "bin").mkdir()
    (home / "bin/python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n', encoding="utf-8")
    (home / "bin/python").chmod(0o755)
    program.unlink()
    program.symlink_to("/usr/local/lib/slipd/bin/slipd")
    unit.write_text(
        re.sub(r"(?<=ExecStart=)\S+", "/usr/local/bin/slipd", UNIT.read_text(encoding="utf-8")), encoding="utf-8"
    )
    shutil.copy(RULES, rules)
    assert make("uninstall", tmp_path) == 0
    assert not any(path.exists() or path.is_symlink() for path in (home, program, unit, rules))
    assert make("uninstall", tmp_path) == 0, "again"


PYTHON_STUB = f"""#!/bin/sh
case "$1 $2" in
"-m venv") mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; echo "home = $3" > "$3/pyvenv.cfg"; touch -m "$3/bin/slipd";;
"-m pip") chmod -R a+w "${{0%/*}}"; [ ! -e "$HOME/pip-fails" ];;
"-c "*renameat2*|-B*) exec {sys.executable} "$@";;
"-c "*) echo 3.11;;
esac
"""
"""In place of an interpreter: a real one would download the dependencies, and write files as its umask permits."""


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
    assert code == 0
    assert [line for line in said.splitlines() if line.startswith("== ")] == [
        f"== slipd into {stranger.place}/lib/slipd",
        "== no systemd unit; slipd run works without",
        "== installed; docs/service.md says more",
    ]
    program = stranger.place / "bin" / "slipd"
    assert program.readlink() == stranger.place / "lib" / "slipd" / "bin" / "slipd"
    code, _ = stranger.make("uninstall", f"PREFIX={stranger.place}")
    assert code == 0
    assert [path.name for path in sorted(stranger.place.rglob("*"))] == ["bin", "lib"]
    assert list(stranger.home.iterdir()) == []


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_an_installation_that_fails_leaves_the_one_before_and_one_that_works_replaces_it(tmp_path: Path) -> None:
    """Whatever the umask is, nobody else may write to what is installed."""
    python = tmp_path / "python"
    python.write_text(PYTHON_STUB, encoding="utf-8")
    python.chmod(0o755)
    root = tmp_path / "root"
    lib, unit = root / "usr/local/lib", root / "etc/systemd/system/slipd.service"
    place = lib / "slipd"

    def install(umask: int = 0o022) -> subprocess.CompletedProcess[str]:
        command = ["make", "-s", "install", f"PYTHON={python}", f"DESTDIR={root}"]
        home = os.environ | {"HOME": str(tmp_path)}
        return subprocess.run(command, cwd=ROOT, env=home, capture_output=True, text=True, umask=umask)

    assert install(umask=0).returncode == 0
    assert [path for path in lib.rglob("*") if path.lstat().st_mode & 0o022 and not path.is_symlink()] == []
    assert "\nExecStart=/usr/local/bin/slipd run" in unit.read_text(encoding="utf-8")
    (place / "before").touch()
    (tmp_path / "pip-fails").touch()
    failed = install()
    assert failed.returncode != 0
    assert "pip failed; nothing was changed" in failed.stdout
    assert (place / "before").exists()
    (tmp_path / "pip-fails").unlink()
    assert install().returncode == 0
    assert not (place / "before").exists()
    assert (place / "pyvenv.cfg").read_text() == "home = /usr/local/lib/slipd\n", "its place, not where it was built"
    assert [path.name for path in lib.iterdir()] == ["slipd"], "and nothing else is left"


def service(*arguments: str | Path) -> int:
    return main(["service", *map(str, arguments)])


def test_an_installed_program_is_made_a_service_without_the_repository(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root, program = ("--root", tmp_path), tmp_path / "my programs" / "slipd"
    assert service("install", "--system", *root, "--program", program) == 0
    unit, rules = tmp_path / "etc/systemd/system/slipd.service", tmp_path / "etc/udev/rules.d/70-slipd.rules"
    assert f'ExecStart="{program}" run /etc/slipd/rig.toml' in unit.read_text(encoding="utf-8")
    assert "sudo systemctl enable --now slipd" in capsys.readouterr().out.replace(
        "daemon-reload && sudo systemctl ", ""
    )
    assert (unit.stat().st_mode & 0o777, (tmp_path / "etc/slipd").is_dir()) == (0o644, True)
    rules.write_text("# mine\n", encoding="utf-8")
    assert service("install", "--system", *root) == 0, "another program of slipd replaces it"
    assert f"ExecStart={Path(sys.prefix) / 'bin/slipd'} run" in unit.read_text(encoding="utf-8")
    assert f"kept, because it was changed: {rules}" in capsys.readouterr().out
    assert service("uninstall", "--system", *root, "--program", program) == 0
    assert unit.exists(), "it starts another program"
    assert service("uninstall", "--system", *root) == 0
    assert (unit.exists(), rules.exists(), (tmp_path / "etc/sysusers.d/slipd.conf").exists()) == (False, True, False)
    unit.write_text("[Service]\nExecStart=/bin/true\n", encoding="utf-8")
    assert service("install", "--system", *root) == 1
    assert "slipd.service: is not a unit of slipd, and is not replaced" in capsys.readouterr().err


def test_the_service_of_one_user_is_written_into_that_user_s_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert service("install", "--user") == 0
    unit = tmp_path / "systemd/user/slipd.service"
    assert unit.read_text(encoding="utf-8") == with_program(USER_UNIT.read_text(encoding="utf-8"), own_program())
    assert "systemctl --user enable --now slipd" in capsys.readouterr().out
    assert service("uninstall", "--user") == 0
    assert not unit.exists()
    (tmp_path / "systemd/user").rmdir()
    (tmp_path / "systemd/user").touch()
    assert service("install", "--user") == 1
    assert "systemd/user" in capsys.readouterr().err
