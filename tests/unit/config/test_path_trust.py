"""A config that another user can change is refused. Runs as root and as a user."""

from __future__ import annotations

import os
import pwd
import subprocess
import sys
from pathlib import Path

import pytest
from project import CONFIG, TRIAL

from slipd import config
from slipd.cli import main
from slipd.errors import ConfigError
from slipd_client import path_trust

SLIPD = str(Path(sys.executable).with_name("slipd"))
SOMEBODY = 54321


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A valid config in a folder of its own."""
    folder = tmp_path / "etc"
    folder.mkdir(mode=0o755)
    file = folder / "rig.toml"
    file.write_text((CONFIG / "demo.toml").read_text(encoding="utf-8"), encoding="utf-8")
    file.chmod(0o644)
    return file


def give_away(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give a file or link to another user; without the right to do so, pretend to be another user."""
    if os.geteuid() == 0:
        os.chown(path, SOMEBODY, -1, follow_symlinks=False)
    else:
        monkeypatch.setattr(path_trust.os, "geteuid", lambda: SOMEBODY)


def refusal(path: Path) -> str:
    with pytest.raises(ConfigError) as caught:
        config.load(path)
    return str(caught.value)


def test_an_own_file_is_accepted_in_a_sticky_folder_that_all_may_write(rig: Path) -> None:
    rig.parent.chmod(0o1777)
    assert path_trust.trust_faults(rig) == []
    assert config.load(rig).finger


@pytest.mark.parametrize("mode", [0o666, 0o646, 0o602])
def test_a_file_that_all_may_write_is_refused(rig: Path, mode: int) -> None:
    rig.chmod(mode)
    assert refusal(rig) == (f"{rig}: {rig} must not be writable by other users (mode {mode:04o}): chmod go-w {rig}")
    rig.chmod(mode & ~0o022)  # as it says
    assert config.load(rig).finger


def test_a_folder_that_all_may_write_is_refused_at_any_depth(rig: Path) -> None:
    above = rig.parent.parent
    above.chmod(0o777)
    reason = f"the folder {above} on its path must not be writable by other users (mode 0777): chmod go-w {above}"
    assert refusal(rig) == f"{rig}: {reason}"
    above.chmod(0o755)
    assert config.load(rig).finger


def test_only_a_group_without_other_members_may_write(rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.chmod(0o664)
    me = pwd.getpwuid(os.geteuid())
    somebody = pwd.struct_passwd(("somebody", "x", SOMEBODY, rig.stat().st_gid, "", "/", "/bin/sh"))
    for users, good in (([me], True), ([me, somebody], False)):
        monkeypatch.setattr(path_trust.pwd, "getpwall", lambda users=users: users)
        assert (path_trust.trust_faults(rig) == []) == good
    if os.geteuid() == 0:
        monkeypatch.undo()
        os.chown(rig, -1, SOMEBODY)  # a group that this machine does not know
        assert "mode 0664" in refusal(rig)


def test_a_file_of_another_user_is_refused(rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    give_away(rig, monkeypatch)
    message = refusal(rig)
    assert f"{rig} must belong to root or to " in message
    assert f"chown {path_trust.user_name(os.geteuid())} {rig}" in message


def test_folder_owner_and_target_of_a_link_are_checked(rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    links = rig.parent.parent / "links"
    links.mkdir(mode=0o755)
    link = links / "rig.toml"
    link.symlink_to("../etc/rig.toml")
    assert config.load(link).finger
    links.chmod(0o777)
    assert f"the folder {links} on its path" in refusal(link), "there the link can be turned elsewhere"
    links.chmod(0o1777)
    assert config.load(link).finger
    rig.parent.chmod(0o777)
    assert f"the folder {rig.parent} on its path" in refusal(link)
    rig.parent.chmod(0o755)
    give_away(link, monkeypatch)
    assert f"{link} must belong to root or to " in refusal(link)


def test_a_broken_or_circular_link_is_refused(rig: Path) -> None:
    for name, target in (("gone", "nothing"), ("circle", "circle")):
        link = rig.parent / name
        link.symlink_to(target)
        assert f"{link}: cannot be read: " in refusal(link)
    deep = rig.parent / "absolute"
    deep.symlink_to(rig)
    assert config.load(deep).finger


def test_the_path_may_be_relative(rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(rig.parent)
    assert config.load(Path("../etc/./rig.toml")).finger
    rig.parent.chmod(0o777)
    assert f"the folder {rig.parent} on its path" in refusal(Path("rig.toml"))


def test_an_own_pipe_is_accepted(rig: Path) -> None:
    done = subprocess.run(
        [SLIPD, "check", "/dev/stdin"], input=rig.read_bytes(), capture_output=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.process
@pytest.mark.parametrize("command", [["check"], ["run", "--config"]])
def test_check_and_run_refuse_a_config_that_others_can_change(command: list[str], rig: Path) -> None:
    rig.chmod(0o666)
    rig.parent.chmod(0o777)
    done = subprocess.run([SLIPD, *command, str(rig)], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines() == [
        f"{rig}: the folder {rig.parent} on its path must not be writable by other users (mode 0777): "
        f"chmod go-w {rig.parent}",
        f"{rig}: {rig} must not be writable by other users (mode 0666): chmod go-w {rig}",
    ]


def test_import_refuses_a_config_that_others_can_change(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig.chmod(0o666)
    trial = str(TRIAL)
    assert main(["import", "grips", trial, str(rig.parent / "out.mcap"), "--config", str(rig)]) == 2
    assert "chmod go-w" in capsys.readouterr().err
