from __future__ import annotations

import grp
import os
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from slipd.errors import LinkError
from slipd.io.bus.runtime_directory import RuntimeDirectory
from slipd.io.zmtp.endpoint import bind, release

GROUP = "daemon"
needs_a_group = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files to a group it is not in")
"""Root may give files to any group; one that every machine has."""

HOLD = """
import sys, pathlib
from slipd.io.bus.runtime_directory import RuntimeDirectory
with RuntimeDirectory(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "slipd"


def test_without_a_group_the_directory_is_made_for_the_user_alone(path: Path) -> None:
    umask = os.umask(0)
    try:
        with RuntimeDirectory(path, group="no such group") as home:
            socket = path / "publish"
            socket.touch(0o700)
            home.share(f"ipc://{socket}")
            assert stat.S_IMODE(socket.stat().st_mode) == 0o700
            socket.unlink()
            assert stat.S_IMODE(path.stat().st_mode) == 0o700
            assert {stat.S_IMODE(file.stat().st_mode) for file in path.iterdir()} == {0o600}
    finally:
        os.umask(umask)


@needs_a_group
@pytest.mark.parametrize("umask", [0, 0o022, 0o077])
def test_with_a_group_its_members_may_enter_and_use_the_sockets_and_nothing_else(umask: int, path: Path) -> None:
    before = os.umask(umask)
    try:
        with RuntimeDirectory(path, group=GROUP) as home:
            socket = path / "publish"
            socket.touch(0o700)
            home.share(f"ipc://{socket}")
            assert modes(path) == {"slipd": (0o750, GROUP), "publish": (0o660, GROUP), "lock": (0o600, None)}
    finally:
        os.umask(before)
    with RuntimeDirectory(path, group=GROUP):
        pass  # it is taken as it was left


@needs_a_group
def test_a_socket_of_the_group_is_shared_where_the_systemd_unit_forbids_to_give_files(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with RuntimeDirectory(path, group=GROUP) as home:
        socket = path / "publish"
        socket.touch(0o700)
        os.chown(socket, -1, grp.getgrnam(GROUP).gr_gid)  # as every file of a service of that group
        monkeypatch.setattr(os, "chown", refuse)
        home.share(f"ipc://{socket}")
        assert modes(path)["publish"] == (0o660, GROUP)


def refuse(*_: object) -> None:
    raise PermissionError


def modes(path: Path) -> dict[str, tuple[int, str | None]]:
    """Return the modes of the directory and its files, and the group if it has any right."""
    found = {file.name: file.stat() for file in (path, *path.iterdir())}
    return {
        name: (stat.S_IMODE(each.st_mode), grp.getgrgid(each.st_gid).gr_name if each.st_mode & 0o070 else None)
        for name, each in found.items()
    }


CONNECT = "import socket, sys; socket.socket(socket.AF_UNIX).connect(sys.argv[1])"


@needs_a_group
def test_a_member_of_the_group_can_connect_and_nobody_else_can() -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as parent:
        Path(parent).chmod(0o711)
        path = Path(parent) / "slipd"
        with RuntimeDirectory(path, group=GROUP) as home:
            server, endpoint = bind(f"ipc://{path}/requests")
            home.share(endpoint)
            nobody, group = 65534, grp.getgrnam(GROUP).gr_gid
            for groups, connects in ((group, True), (nobody, False)):
                done = subprocess.run(
                    ["/usr/bin/python3", "-c", CONNECT, f"{path}/requests"],
                    user=nobody,
                    group=groups,
                    extra_groups=[],
                    capture_output=True,
                )
                assert (done.returncode == 0) == connects, done.stderr
            release(server, endpoint)


@needs_a_group
def test_a_directory_that_exists_is_opened_to_nobody(path: Path) -> None:
    path.mkdir(parents=True, mode=0o700)
    with RuntimeDirectory(path, group=GROUP) as home:
        (path / "publish").touch(0o700)
        home.share(f"ipc://{path}/publish")
        assert modes(path) == {"slipd": (0o700, None), "publish": (0o700, None), "lock": (0o600, None)}


@needs_a_group
def test_a_socket_elsewhere_is_not_shared(path: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "publish"
    elsewhere.touch(0o700)
    with RuntimeDirectory(path, group=GROUP) as home:
        home.share(f"ipc://{elsewhere}")
        home.share("tcp://127.0.0.1:5555")
    assert stat.S_IMODE(elsewhere.stat().st_mode) == 0o700


@needs_a_group
def test_a_directory_of_another_group_is_refused(path: Path) -> None:
    path.mkdir(parents=True)
    os.chown(path, -1, 12345)
    path.chmod(0o750)
    with pytest.raises(LinkError, match=f"except {GROUP} with this user"):
        RuntimeDirectory(path, group=GROUP).__enter__()


def test_Z6_a_second_daemon_is_refused_with_the_process_that_holds_it(path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(LinkError, match=rf"another slipd uses this directory \(process {holder.pid}\)"):
            RuntimeDirectory(path).__enter__()
        holder.kill()
        holder.wait()
        (path / "lock").write_text("12345678901\n")
        with RuntimeDirectory(path):  # the kernel let go of it
            assert (path / "lock").read_text() == f"{os.getpid()}\n"


def test_the_directory_is_free_again_after_the_end(path: Path) -> None:
    files = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(3):
        with RuntimeDirectory(path), pytest.raises(LinkError, match=f"process {os.getpid()}"):
            RuntimeDirectory(path).__enter__()
    assert len(list(Path("/proc/self/fd").iterdir())) == files


@pytest.mark.parametrize("mode", [0o755, 0o750, 0o770, 0o711, 0o701, 0o1777])
def test_a_directory_that_others_may_enter_is_refused_and_left_as_it_is(mode: int, path: Path) -> None:
    path.mkdir(parents=True)
    path.chmod(mode)
    with pytest.raises(LinkError, match="chmod 700"):
        RuntimeDirectory(path, group="no such group").__enter__()
    assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_directory_of_another_user_is_refused(path: Path) -> None:
    path.mkdir(parents=True, mode=0o700)
    os.chown(path, 12345, -1)
    with pytest.raises(LinkError, match=r"must belong to user \d+, got user 12345"):
        RuntimeDirectory(path).__enter__()


def test_a_link_to_a_directory_is_refused(path: Path, tmp_path: Path) -> None:
    path.parent.mkdir()
    path.symlink_to(tmp_path)
    with pytest.raises(LinkError, match="must be a directory"):
        RuntimeDirectory(path).__enter__()


def test_a_file_in_the_place_of_the_directory_is_refused(path: Path) -> None:
    path.parent.mkdir()
    path.write_text("")
    with pytest.raises(LinkError, match="must be a directory"):
        RuntimeDirectory(path).__enter__()


def test_a_lock_that_is_a_link_to_another_file_is_refused(path: Path, tmp_path: Path) -> None:
    path.mkdir(parents=True, mode=0o700)
    precious = tmp_path / "precious"
    precious.write_text("do not truncate")
    (path / "lock").symlink_to(precious)
    with pytest.raises(LinkError, match="cannot be used"):
        RuntimeDirectory(path).__enter__()
    assert precious.read_text() == "do not truncate"
