"""A client believes only a daemon of its own user, of root, or of a user whose folder root made."""

from __future__ import annotations

import os
import stat
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from slipd_client.errors import CallError
from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber

SOMEBODY = 54321
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root acts as another user")


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    """A folder like /tmp, in which every user may create names, and which every user can reach."""
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o1777)
    return folder


@pytest.fixture
def home(shared: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The runtime folder of this user where there is no session; nobody has made it yet."""
    folder = shared / "slipd-1000"
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(folder))
    return folder


@pytest.fixture
def reached(tmp_path: Path) -> Iterator[None]:
    """Let another user reach the folders of this test."""
    closed = [folder for folder in (tmp_path, *tmp_path.parents) if not folder.stat().st_mode & stat.S_IXOTH]
    modes = [stat.S_IMODE(folder.stat().st_mode) for folder in closed]
    for folder, mode in zip(closed, modes, strict=True):
        folder.chmod(mode | stat.S_IXOTH)
    yield
    for folder, mode in zip(closed, modes, strict=True):
        folder.chmod(mode)


def as_somebody(*command: str) -> None:
    subprocess.run(command, user=SOMEBODY, group=SOMEBODY, extra_groups=[], check=True)


@needs_root
@pytest.mark.usefixtures("reached")
@pytest.mark.parametrize("made", [("mkdir", "-m", "0777"), ("ln", "-s", "..")])
def test_Z7_a_folder_that_another_user_made_first_is_refused(made: tuple[str, ...], home: Path) -> None:
    as_somebody(*made, str(home))
    with zmq.Context() as context, context.socket(zmq.PUB) as false_daemon:
        false_daemon.bind(f"ipc://{home}/publish")
        for client in (Subscriber, GripClient):
            with pytest.raises(CallError, match=rf"another user could listen here .*{home}.* not to {SOMEBODY}"):
                client()


@needs_root
def test_the_folder_that_root_made_for_the_service_is_trusted(tmp_path: Path) -> None:
    for folder in (made_by_root := tmp_path / "slipd", made_by_root / "deeper"):
        folder.mkdir(mode=0o750)
        os.chown(folder, SOMEBODY, SOMEBODY)
    Subscriber(f"ipc://{made_by_root}/deeper/publish").close()
    (made_by_root / "open").mkdir()
    os.chown(made_by_root / "open", SOMEBODY + 1, SOMEBODY)
    with pytest.raises(CallError, match=f"not to {SOMEBODY + 1}"):
        Subscriber(f"ipc://{made_by_root}/open/publish")


def test_a_client_that_comes_before_the_daemon_makes_the_folder_for_its_user_alone(home: Path) -> None:
    Subscriber().close()
    assert stat.S_IMODE(home.stat().st_mode) == 0o700
    GripClient().disconnect()


def test_what_other_users_may_change_is_refused(shared: Path) -> None:
    folder = shared / "mine"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(
        CallError, match=f"the folder {folder} on its path must not be writable .*: chmod go-w {folder}"
    ):
        Subscriber(f"ipc://{folder}/publish")
    folder.chmod(0o755)
    Subscriber(f"ipc://{folder}/publish").close()
    with pytest.raises(CallError, match=f"{shared}/publish may be created by any user"):
        Subscriber(f"ipc://{shared}/publish")
