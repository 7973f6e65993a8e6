from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from slipd.bus.runtime import RuntimeDirectory
from slipd.errors import LinkError

HOLD = """
import sys, pathlib
from slipd.bus.runtime import RuntimeDirectory
with RuntimeDirectory(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "slipd"


def test_the_directory_is_made_for_the_user_alone(path: Path) -> None:
    umask = os.umask(0)
    try:
        with RuntimeDirectory(path):
            assert stat.S_IMODE(path.stat().st_mode) == 0o700
            assert {stat.S_IMODE(file.stat().st_mode) for file in path.iterdir()} == {0o600}
    finally:
        os.umask(umask)


def test_a_second_daemon_is_refused_with_the_process_that_holds_it(path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(LinkError, match=rf"runs here already \(process {holder.pid}\)"):
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


@pytest.mark.parametrize("mode", [0o755, 0o750, 0o711, 0o1777])
def test_a_directory_that_others_may_enter_is_refused_and_left_as_it_is(mode: int, path: Path) -> None:
    path.mkdir(parents=True)
    path.chmod(mode)
    with pytest.raises(LinkError, match="chmod 700"):
        RuntimeDirectory(path).__enter__()
    assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_directory_of_another_user_is_refused(path: Path) -> None:
    path.mkdir(parents=True, mode=0o700)
    os.chown(path, 12345, -1)
    with pytest.raises(LinkError, match="belongs to user 12345"):
        RuntimeDirectory(path).__enter__()


def test_a_link_to_a_directory_is_refused(path: Path, tmp_path: Path) -> None:
    path.parent.mkdir()
    path.symlink_to(tmp_path)
    with pytest.raises(LinkError, match="no directory of its own"):
        RuntimeDirectory(path).__enter__()


def test_a_file_in_the_place_of_the_directory_is_refused(path: Path) -> None:
    path.parent.mkdir()
    path.write_text("")
    with pytest.raises(LinkError, match="no directory of its own"):
        RuntimeDirectory(path).__enter__()


def test_a_lock_that_is_a_link_to_another_file_is_refused(path: Path, tmp_path: Path) -> None:
    path.mkdir(parents=True, mode=0o700)
    precious = tmp_path / "precious"
    precious.write_text("do not truncate")
    (path / "lock").symlink_to(precious)
    with pytest.raises(LinkError, match="cannot be used"):
        RuntimeDirectory(path).__enter__()
    assert precious.read_text() == "do not truncate"
