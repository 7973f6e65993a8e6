"""Where clients look for the daemon, whom they trust there, and where pages are served."""

from __future__ import annotations

import argparse
import os
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from slipd_client import paths
from slipd_client.arguments import parse_listen
from slipd_client.errors import CallError
from slipd_client.grip import GripClient
from slipd_client.paths import hint_for, publish_endpoint, requests_endpoint
from slipd_client.subscriber import Subscriber


@pytest.mark.parametrize(
    ("of_slipd", "of_the_session", "folder"),
    [
        ("", "", f"/tmp/slipd-{os.getuid()}"),
        (None, None, f"/tmp/slipd-{os.getuid()}"),
        ("", "/run/user/7", "/run/user/7/slipd"),
        ("/run/slipd", "/run/user/7", "/run/slipd"),
    ],
)
def test_the_folder_is_that_of_the_variable_of_the_session_or_of_the_user(
    of_slipd: str | None, of_the_session: str | None, folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (("SLIPD_RUNTIME_DIR", of_slipd), ("XDG_RUNTIME_DIR", of_the_session)):
        monkeypatch.delenv(name, raising=False)
        if value is not None:
            monkeypatch.setenv(name, value)
    assert (publish_endpoint(), requests_endpoint()) == (f"ipc://{folder}/publish", f"ipc://{folder}/requests")


@pytest.mark.parametrize(
    "text", ["", "8710", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "a b:1", "http://x:1", "::1:80"]
)
def test_what_is_not_host_and_port_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be HOST:PORT, e.g. 127.0.0.1:8710, got"):
        parse_listen(text)


@pytest.mark.parametrize(
    ("text", "loopback", "url"),
    [
        ("127.0.0.1:80", True, "http://127.0.0.1:99/"),
        ("localhost:0", True, "http://localhost:99/"),
        ("[::1]:80", True, "http://[::1]:99/"),
        ("192.168.1.7:80", False, "http://192.168.1.7:99/"),
        ("0.0.0.0:80", False, f"http://{socket.gethostname()}:99/"),
        ("robot:80", False, "http://robot:99/"),
    ],
)
def test_a_listen_address_knows_its_url_and_whether_others_reach_it(text: str, loopback: bool, url: str) -> None:
    address = parse_listen(text)
    assert (address.loopback, address.url(99)) == (loopback, url)


SOMEBODY = 54321
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root acts as another user")


@pytest.fixture
def directory() -> Iterator[Path]:
    """A directory in a folder that every user may enter, which those of pytest are not."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        made = Path(name) / "slipd"
        made.mkdir()
        yield made


def test_a_user_whose_variable_is_not_set_is_told_where_the_service_is(
    directory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paths, "SERVICE_DIR", tmp_path / "no service")
    missing = f"ipc://{tmp_path}/missing/publish"
    assert hint_for(missing) == "Is slipd running?"
    monkeypatch.setattr(paths, "SERVICE_DIR", directory)
    assert hint_for(missing).endswith(f"A service uses {directory}: for that one set SLIPD_RUNTIME_DIR={directory}")


@needs_root
def test_a_user_outside_the_group_is_told_to_join_it(directory: Path) -> None:
    os.chown(directory, 0, 1)
    directory.chmod(0o750)
    code = (  # modules are imported first, because the other user may not read those of Python
        "import grp, os, pwd, sys; from slipd_client.paths import hint_for;"
        f" os.setgroups([]); os.setgid({SOMEBODY}); os.setuid({SOMEBODY}); print(hint_for(sys.argv[1]))"
    )
    asked = subprocess.run([sys.executable, "-c", code, f"ipc://{directory}/publish"], capture_output=True, text=True)
    want = f"Only the group daemon may enter {directory}: sudo usermod -aG daemon $USER, then log in again\n"
    assert asked.stdout == want


@pytest.fixture
def shared(directory: Path) -> Path:
    """A folder like /tmp, in which every user may create names, and which every user can reach."""
    directory.chmod(0o1777)
    return directory


@pytest.fixture
def home(shared: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The runtime folder of this user where there is no session; nobody has made it yet."""
    folder = shared / "slipd-1000"
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(folder))
    return folder


@needs_root
@pytest.mark.parametrize("made", [("mkdir", "-m", "0777"), ("ln", "-s", "..")])
def test_Z7_a_folder_that_another_user_made_first_is_refused(made: tuple[str, ...], home: Path) -> None:
    subprocess.run([*made, str(home)], user=SOMEBODY, group=SOMEBODY, extra_groups=[], check=True)
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
    os.chown(made_by_root / "deeper", SOMEBODY + 1, SOMEBODY)
    with pytest.raises(CallError, match=f"not to {SOMEBODY + 1}"):
        Subscriber(f"ipc://{made_by_root}/deeper/publish")


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
