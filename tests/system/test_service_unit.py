"""The systemd unit of config/, checked by the tools of systemd where they exist, and what `make install` does."""

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
from slipd.io.systemd import ANSWER_S, FEEDS_PER_TIMEOUT

UNIT, USER_UNIT = CONFIG / "slipd.service", CONFIG / "slipd-user.service"
RULES, USERS = CONFIG / "70-slipd.rules", CONFIG / "slipd.sysusers"

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
needs_make = pytest.mark.skipif(shutil.which("make", path=os.defpath) is None, reason="needs make")
both = pytest.mark.parametrize("unit", [UNIT, USER_UNIT], ids=lambda unit: unit.name)


def settings(unit: Path) -> dict[str, str]:
    lines = unit.read_text(encoding="utf-8").splitlines()
    return {key: value for key, equals, value in (line.partition("=") for line in lines) if equals}


@needs_systemd
@both
def test_systemd_understands_every_line(unit: Path, tmp_path: Path) -> None:
    here = tmp_path / unit.name
    here.write_text(re.sub(r"(?<=ExecStart=)\S+", "/bin/true", unit.read_text(encoding="utf-8")), encoding="utf-8")
    done = subprocess.run(["systemd-analyze", "verify", str(here)], capture_output=True, text=True)
    assert (done.returncode, [line for line in done.stderr.splitlines() if unit.name in line]) == (0, [])


@both
def test_P2_P5_a_daemon_that_crashes_or_hangs_is_started_again_without_limit(unit: Path) -> None:
    stated = settings(unit)
    assert stated == stated | {
        "Type": "notify",
        "NotifyAccess": "main",
        "ExecReload": "/bin/kill -HUP $MAINPID",
        "StartLimitIntervalSec": "0",
        "Restart": "always",
    }
    assert 0.0 < float(stated["RestartSec"]) <= 2.0
    assert float(stated["WatchdogSec"]) / FEEDS_PER_TIMEOUT > ANSWER_S


def test_the_runtime_directory_is_for_the_group_alone_and_recordings_go_where_the_unit_lets_them_be_written() -> None:
    stated = settings(UNIT)
    assert stated == stated | {
        "UMask": "0027",
        "RuntimeDirectory": "slipd",
        "RuntimeDirectoryMode": "0750",
        "Group": "slipd",
    }
    assert f"SLIPD_STATE_DIR=/var/lib/{stated['StateDirectory']}" in stated["Environment"].split()


@pytest.mark.skipif(shutil.which("systemd-sysusers") is None, reason="needs systemd-sysusers")
def test_the_user_of_the_service_may_open_serial_ports(tmp_path: Path) -> None:
    (tmp_path / "etc").mkdir()
    base = tmp_path / "base.conf"
    base.write_text("g dialout 20\n", encoding="utf-8")
    subprocess.run(["systemd-sysusers", f"--root={tmp_path}", base, USERS], capture_output=True, check=True)
    assert "dialout:x:20:slipd" in (tmp_path / "etc/group").read_text(encoding="utf-8").splitlines()


def test_every_rule_of_udev_is_a_list_of_matches_and_assignments() -> None:
    part = re.compile(r'[A-Z]+(\{[\w.]+\})?(==|!=|=|\+=)"[^"]*"')
    lines = [line for line in RULES.read_text(encoding="utf-8").splitlines() if line and not line.startswith("# ")]
    assert [line for line in lines if not all(part.fullmatch(each) for each in line.split(", "))] == []


@needs_systemd
def test_it_is_exposed_no_more_than_serial_ports_and_a_network_need() -> None:
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", UNIT], capture_output=True, text=True
    )
    [level] = re.findall(r"Overall exposure level for slipd.service: ([\d.]+)", done.stdout)
    assert float(level) <= 1.6, "more than sensors, generated code and real-time priority need"


PYTHON_STUB = f"""#!/bin/sh
case "$1 $2" in
"-m venv") mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; echo "home = $3" > "$3/pyvenv.cfg"; touch -m "$3/bin/slipd";;
"-m pip") chmod -R a+w "${{0%/*}}"; [ ! -e "$HOME/pip-fails" ];;
"-c "*renameat2*|-B*) exec {sys.executable} "$@";;
"-c "*) echo 3.11;;
esac
"""
"""In place of an interpreter: a real one would download the dependencies, and write files as its umask permits."""

NOBODY = 65_534


class Machine:
    """Runs ``make`` on a copy of what it reads, with a stub in place of Python.

    Attributes:
        home: Home of the user.
    """

    def __init__(self, folder: Path, *as_user: str) -> None:
        self.home, self._source, self._python = folder / "home", folder / "source", folder / "python"
        self._as_user = as_user
        self.home.mkdir()
        self._source.mkdir()
        shutil.copy(ROOT / "Makefile", self._source)
        shutil.copytree(CONFIG, self._source / "config")
        self._python.write_text(PYTHON_STUB, encoding="utf-8")
        self._python.chmod(0o755)

    def make(self, target: str, *variables: str, umask: int = 0o022) -> tuple[int, str]:
        """Return the exit code of a target, and what it printed."""
        command = [*self._as_user, "make", "-s", target, f"PYTHON={self._python}", *variables]
        environment = {"HOME": str(self.home), "PATH": os.defpath}
        done = subprocess.run(
            command, cwd=self._source, env=environment, capture_output=True, text=True, check=False, umask=umask
        )
        return done.returncode, done.stdout + done.stderr


@needs_make
def test_uninstall_removes_what_install_put_there_and_nothing_else(tmp_path: Path) -> None:
    machine, root = Machine(tmp_path), tmp_path / "root"
    destination = f"DESTDIR={root}"
    home, program = root / "usr/local/lib/slipd", root / "usr/local/bin/slipd"
    unit, rules = root / "etc/systemd/system/slipd.service", root / "etc/udev/rules.d/70-slipd.rules"
    notes = home / "notes"
    for path in (notes, program, rules):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine\n", encoding="utf-8")
    code, said = machine.make("install", destination)
    assert (code, "holds something else" in said) == (2, True)
    assert machine.make("uninstall", destination)[0] == 0
    assert [path.read_text(encoding="utf-8") for path in (notes, program, rules)] == ["mine\n"] * 3

    for path in (notes, program, rules):
        path.unlink()
    home.rmdir()
    assert machine.make("install", destination)[0] == 0
    assert all(path.exists() or path.is_symlink() for path in (home, program, unit, rules))
    assert machine.make("uninstall", destination)[0] == 0
    assert not any(path.exists() or path.is_symlink() for path in (home, program, unit, rules))
    assert machine.make("uninstall", destination)[0] == 0, "again"


@needs_make
def test_an_installation_that_fails_leaves_the_one_before_and_one_that_works_replaces_it(tmp_path: Path) -> None:
    """Whatever the umask is, nobody else may write to what is installed."""
    machine, root = Machine(tmp_path), tmp_path / "root"
    destination, lib = f"DESTDIR={root}", root / "usr/local/lib"
    assert machine.make("install", destination, umask=0)[0] == 0
    assert [path for path in lib.rglob("*") if path.lstat().st_mode & 0o022 and not path.is_symlink()] == []
    assert settings(root / "etc/systemd/system/slipd.service")["ExecStart"].startswith("/usr/local/bin/slipd run")
    (lib / "slipd/before").touch()
    (machine.home / "pip-fails").touch()
    code, said = machine.make("install", destination)
    assert (code, "pip failed; nothing was changed" in said, (lib / "slipd/before").exists()) == (2, True, True)
    (machine.home / "pip-fails").unlink()
    assert machine.make("install", destination)[0] == 0
    assert ([path.name for path in lib.iterdir()], (lib / "slipd/before").exists()) == (["slipd"], False)
    assert settings(lib / "slipd/pyvenv.cfg") == {"home ": " /usr/local/lib/slipd"}, "its place, not where it was built"


@pytest.fixture
def stranger() -> Iterator[tuple[Machine, Path]]:
    """The machine of an unprivileged user with a read-only home, and a place to which the user may write.

    A folder of a test of root is closed to others.
    """
    if os.geteuid() != 0 or not shutil.which("setpriv") or not shutil.which("make", path=os.defpath):
        pytest.skip("needs root, who can become another user, setpriv and make")
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        Path(folder).chmod(0o755)
        place = Path(folder) / "place"
        place.mkdir()
        machine = Machine(Path(folder), "setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups")
        for path, rights in ((place, 0o755), (machine.home, 0o555)):
            os.chown(path, NOBODY, NOBODY)
            path.chmod(rights)
        yield machine, place


def test_an_unprivileged_user_learns_which_place_is_needed_and_installs_there_without_a_unit(
    stranger: tuple[Machine, Path],
) -> None:
    machine, place = stranger
    advice = "cannot be written. Name a place that you may write to: make install PREFIX="
    for variables, why in (
        ((), f"/usr/local {advice}~/.local"),
        (("PREFIX=~/.local",), f"{machine.home}/.local {advice}/PLACE"),
    ):
        code, said = machine.make("install", *variables)
        assert (code, why in said) == (2, True)
    code, said = machine.make("install", f"PREFIX={place}")
    assert (code, [line for line in said.splitlines() if line.startswith("== ")]) == (
        0,
        [
            f"== slipd into {place}/lib/slipd",
            "== no systemd unit; slipd run works without",
            "== installed; docs/service.md says more",
        ],
    )
    assert (place / "bin/slipd").readlink() == place / "lib/slipd/bin/slipd"
    assert machine.make("uninstall", f"PREFIX={place}")[0] == 0
    assert [path.name for path in sorted(place.rglob("*"))] == ["bin", "lib"]
    assert list(machine.home.iterdir()) == []


def service(*arguments: str | Path) -> int:
    return main(["service", *map(str, arguments)])


def test_an_installed_program_is_made_a_service_without_the_repository(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root, program = ("--system", "--root", tmp_path), tmp_path / "my programs" / "slipd"
    unit, rules = tmp_path / "etc/systemd/system/slipd.service", tmp_path / "etc/udev/rules.d/70-slipd.rules"
    assert service("install", *root, "--program", program) == 0
    assert f'ExecStart="{program}" run /etc/slipd/rig.toml' in unit.read_text(encoding="utf-8")
    assert "sudo systemctl enable --now slipd" in capsys.readouterr().out.replace(
        "daemon-reload && sudo systemctl ", ""
    )
    assert (unit.stat().st_mode & 0o777, (tmp_path / "etc/slipd").is_dir()) == (0o644, True)
    rules.write_text("# mine\n", encoding="utf-8")
    assert service("install", *root) == 0, "another program of slipd replaces it"
    assert f"ExecStart={Path(sys.prefix) / 'bin/slipd'} run" in unit.read_text(encoding="utf-8")
    assert f"kept, because it was changed: {rules}" in capsys.readouterr().out
    assert (service("uninstall", *root, "--program", program), unit.exists()) == (0, True), "it starts another program"
    assert service("uninstall", *root) == 0
    assert [path.name for path in (tmp_path / "etc").rglob("*") if path.is_file()] == ["70-slipd.rules"]
    unit.write_text("[Service]\nExecStart=/bin/true\n", encoding="utf-8")
    assert service("install", *root) == 1
    assert "slipd.service: is not a unit of slipd, and is not replaced" in capsys.readouterr().err


def test_the_service_of_one_user_is_written_into_that_user_s_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    unit = tmp_path / "systemd/user/slipd.service"
    assert service("install", "--user") == 0
    assert f"ExecStart={Path(sys.prefix) / 'bin/slipd'} run" in unit.read_text(encoding="utf-8")
    assert "systemctl --user enable --now slipd" in capsys.readouterr().out
    assert (service("uninstall", "--user"), unit.exists()) == (0, False)
    assert (service("install", "--user", "--root", tmp_path), unit.exists()) == (2, False), "it would go into the home"
    unit.parent.rmdir()
    unit.parent.touch()
    assert (service("install", "--user"), "systemd/user" in capsys.readouterr().err) == (1, True)
