"""Who may enter the directory of the sockets, and that one daemon at a time has it."""

from __future__ import annotations

import grp
import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from loop_waits import open_files
from project import CONFIG

from slipd import cli
from slipd.errors import LinkError
from slipd.io.access import RuntimeDirectory

GROUP = "daemon"
"""Root may give files to any group; one that every machine has."""

root_only = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files to others")

HOLD = """
import sys, pathlib
from slipd.io.access import RuntimeDirectory
with RuntimeDirectory(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "slipd"


def modes(path: Path) -> dict[str, tuple[int, str | None]]:
    """Return the modes of the directory and its files, and the group if it has any right."""
    return {
        file.name: (stat.S_IMODE(found.st_mode), grp.getgrgid(found.st_gid).gr_name if found.st_mode & 0o070 else None)
        for file in (path, *path.iterdir())
        for found in [file.stat()]
    }


@pytest.mark.parametrize(
    ("umask", "group", "made", "expected"),
    [
        (0, "no such group", None, {"slipd": (0o700, None), "publish": (0o700, None)}),
        pytest.param(0, GROUP, None, {"slipd": (0o750, GROUP), "publish": (0o660, GROUP)}, marks=root_only),
        pytest.param(0o077, GROUP, None, {"slipd": (0o750, GROUP), "publish": (0o660, GROUP)}, marks=root_only),
        pytest.param(0o022, GROUP, 0o700, {"slipd": (0o700, None), "publish": (0o700, None)}, marks=root_only),
    ],
    ids=["no group", "group", "strict umask", "it exists"],
)
def test_the_members_of_the_group_may_use_a_directory_made_here_and_nobody_else(
    umask: int, group: str, made: int | None, expected: dict[str, tuple[int, str | None]], path: Path
) -> None:
    before = os.umask(umask)
    try:
        if made is not None:
            path.mkdir(parents=True, mode=made)
        for _ in range(2):  # it is used as it was left
            with RuntimeDirectory(path, group=group) as home:
                for name in ("publish", "../elsewhere"):
                    (path / name).touch(0o700)
                    home.share(f"ipc://{path}/{name}")
                home.share("tcp://127.0.0.1:5555")
                assert modes(path) == expected | {"lock": (0o600, None)}
            (path / "publish").unlink()
    finally:
        os.umask(before)
    assert stat.S_IMODE((path.parent / "elsewhere").stat().st_mode) == 0o700


@root_only
def test_a_socket_of_the_group_is_shared_where_the_systemd_unit_forbids_to_give_files(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    with RuntimeDirectory(path, group=GROUP) as home:
        (path / "publish").touch(0o700)
        os.chown(path / "publish", -1, grp.getgrnam(GROUP).gr_gid)  # as every file of a service of that group
        monkeypatch.setattr(os, "chown", refuse)
        home.share(f"ipc://{path}/publish")
        assert modes(path)["publish"] == (0o660, GROUP)


def test_Z6_a_second_daemon_is_refused_with_the_process_that_holds_it(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(path))
    command = [sys.executable, "-c", HOLD, path]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(LinkError, match=rf"another slipd uses this directory \(process {holder.pid}\)"):
            RuntimeDirectory(path).__enter__()
        assert cli.main(["run", str(CONFIG / "demo.toml")]) == 2
        holder.kill()
        holder.wait()
    (path / "lock").write_text("12345678901\n")
    files = open_files()
    for _ in range(3):
        with RuntimeDirectory(path), pytest.raises(LinkError, match=f"process {os.getpid()}"):
            RuntimeDirectory(path).__enter__()
        assert (path / "lock").read_text() == f"{os.getpid()}\n"
    assert open_files() == files


def given(number: int, user: int = -1, group: int = -1) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        path.mkdir()
        os.chown(path, user, group)
        path.chmod(number)

    return make


def locked_elsewhere(path: Path) -> None:
    path.mkdir(mode=0o700)
    (path.parent / "precious").write_text("do not truncate")
    (path / "lock").symlink_to(path.parent / "precious")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        *((given(number), "chmod 700") for number in (0o755, 0o750, 0o770, 0o711, 0o701, 0o1777)),
        pytest.param(given(0o750, group=12345), f"except {GROUP} with this user", marks=root_only),
        pytest.param(given(0o700, user=12345), r"must belong to user \d+, got user 12345", marks=root_only),
        (lambda path: path.symlink_to("/tmp"), "must be a directory"),
        (lambda path: path.write_text(""), "must be a directory"),
        (locked_elsewhere, "cannot be used"),
    ],
)
def test_what_others_could_enter_or_change_is_refused_and_left_as_it_is(
    make: Callable[[Path], None], words: str, path: Path
) -> None:
    path.parent.mkdir()
    make(path)
    before = path.lstat().st_mode
    with pytest.raises(LinkError, match=words):
        RuntimeDirectory(path, group=GROUP if "except" in words else "no such group").__enter__()
    assert path.lstat().st_mode == before
    for precious in path.parent.glob("precious"):
        assert precious.read_text() == "do not truncate"
