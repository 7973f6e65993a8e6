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
from slipd_client import paths

SLIPD = str(Path(sys.executable).with_name("slipd"))
SOMEBODY = 54321


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A valid config in a folder of its own."""
    file = tmp_path / "etc" / "rig.toml"
    file.parent.mkdir(mode=0o755)
    file.write_text((CONFIG / "demo.toml").read_text(encoding="utf-8"), encoding="utf-8")
    file.chmod(0o644)
    return file


def give_away(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give a file or link to another user; without the right to do so, pretend to be another user."""
    if os.geteuid() == 0:
        os.chown(path, SOMEBODY, -1, follow_symlinks=False)
    else:
        monkeypatch.setattr(paths.os, "geteuid", lambda: SOMEBODY)


def refusal(path: Path) -> str:
    with pytest.raises(ConfigError) as caught:
        config.load(path)
    return str(caught.value)


@pytest.mark.parametrize("mode", [0o666, 0o646, 0o602])
def test_a_file_that_all_may_write_is_refused(rig: Path, mode: int) -> None:
    rig.chmod(mode)
    assert refusal(rig) == (f"{rig}: {rig} must not be writable by other users (mode {mode:04o}): chmod go-w {rig}")
    rig.chmod(mode & ~0o022)  # as it says
    assert config.load(rig).finger


def test_a_folder_that_all_may_write_is_refused_at_any_depth_unless_it_is_sticky(
    rig: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    above = rig.parent.parent
    above.chmod(0o777)
    reason = f"the folder {above} on its path must not be writable by other users (mode 0777): chmod go-w {above}"
    assert refusal(rig) == f"{rig}: {reason}"
    monkeypatch.chdir(rig.parent)
    assert f"the folder {above} on its path" in refusal(Path("../etc/./rig.toml"))
    above.chmod(0o1777)
    assert config.load(Path("../etc/./rig.toml")).finger


def test_only_a_group_without_other_members_may_write(rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.chmod(0o664)
    me = pwd.getpwuid(os.geteuid())
    somebody = pwd.struct_passwd(("somebody", "x", SOMEBODY, rig.stat().st_gid, "", "/", "/bin/sh"))
    for users, good in (([me], True), ([me, somebody], False)):
        monkeypatch.setattr(paths.pwd, "getpwall", lambda users=users: users)
        assert (paths.trust_faults(rig) == []) == good
    if os.geteuid() == 0:
        monkeypatch.undo()
        os.chown(rig, -1, SOMEBODY)  # a group that this machine does not know
        assert "mode 0664" in refusal(rig)


def test_owner_folder_and_target_of_a_file_and_of_a_link_are_checked(
    rig: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = rig.parent.parent / "links" / "rig.toml"
    link.parent.mkdir(mode=0o755)
    link.symlink_to("../etc/rig.toml")
    assert config.load(link).finger
    for folder in (link.parent, rig.parent):
        folder.chmod(0o777)
        assert f"the folder {folder} on its path" in refusal(link), "there the link can be turned elsewhere"
        folder.chmod(0o755)
    give_away(link, monkeypatch)
    assert f"{link} must belong to root or to " in refusal(link)
    give_away(rig, monkeypatch)
    assert f"chown {paths.user_name(os.geteuid())} {rig}" in refusal(rig)


@pytest.mark.parametrize(("name", "target"), [("gone", "nothing"), ("circle", "circle")])
def test_a_broken_or_circular_link_is_refused(name: str, target: str, rig: Path) -> None:
    (rig.parent / name).symlink_to(target)
    assert f"{rig.parent / name}: cannot be read: " in refusal(rig.parent / name)


def test_an_own_pipe_is_accepted(rig: Path) -> None:
    done = subprocess.run([SLIPD, "check", "/dev/stdin"], input=rig.read_bytes(), capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", [["check", "RIG"], ["import", "grips", str(TRIAL), "OUT", "--config", "RIG"]])
def test_commands_refuse_a_config_that_others_can_change_and_name_every_reason(
    command: list[str], rig: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig.chmod(0o666)
    rig.parent.chmod(0o777)
    assert main([{"RIG": str(rig), "OUT": str(rig.parent / "out.mcap")}.get(word, word) for word in command]) != 0
    told = capsys.readouterr().err.splitlines()
    assert told[-2:] == [
        f"{rig}: the folder {rig.parent} on its path must not be writable by other users (mode 0777): "
        f"chmod go-w {rig.parent}",
        f"{rig}: {rig} must not be writable by other users (mode 0666): chmod go-w {rig}",
    ]
