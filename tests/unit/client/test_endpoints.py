"""Where clients look for the daemon, whom they trust there, where pages are served, and wrong calls."""

from __future__ import annotations

import argparse
import os
import socket
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zmq

from slipd_client import keys, paths
from slipd_client.arguments import parse_listen
from slipd_client.errors import CallError, ClientError, SlipdClientError
from slipd_client.grip import GripClient
from slipd_client.messages import decode
from slipd_client.messages.codec import read
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
def home(directory: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The runtime folder of this user where there is no session, as in /tmp; nobody has made it yet."""
    directory.chmod(0o1777)
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(directory / "slipd-1000"))
    return directory / "slipd-1000"


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


def test_a_client_that_comes_first_makes_the_folder_for_its_user_alone_and_what_others_may_change_is_refused(
    home: Path,
) -> None:
    for start in (Subscriber, GripClient):
        start().close()
    assert stat.S_IMODE(home.stat().st_mode) == 0o700
    home.chmod(0o777)
    for where, why in (
        (home, f"the folder {home} on its path must not be writable .*: chmod go-w {home}"),
        (home.parent, f"{home.parent}/publish may be created by any user"),
    ):
        with pytest.raises(CallError, match=why):
            Subscriber(f"ipc://{where}/publish")


NOWHERE = "ipc:///run/slipd-test/no-daemon"
EVERY = "slip.FINGER, warning, wrench.FINGER, tactile.FINGER, grasp, motion, gripper, status"


def ask_nobody(call: Callable[[GripClient], object]) -> None:
    with GripClient(NOWHERE, timeout_s=0.01) as client:
        call(client)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: GripClient("tcp://robot"), "^endpoint must be"),
        (lambda: Subscriber("nowhere"), "^endpoint must be of the form .*, got 'nowhere'"),
        (lambda: Subscriber(NOWHERE, topics="slip"), "^topics must be a sequence of strings, .*got 'slip'"),
        (lambda: ask_nobody(lambda client: client.tare("left", 0.0)), "^seconds must be .*, got 0"),
        (lambda: ask_nobody(lambda client: client.tare("left", -1.0)), "^seconds must be .*, got -1"),
        (lambda: ask_nobody(lambda client: client.tare("left", 1.0, "pad")), r"^call tare\(finger, stream, seconds\)"),
        (lambda: ask_nobody(lambda client: client.status()), "nobody accepts requests"),
        (lambda: decode(b""), "malformed"),
        (lambda: read([b"slip.left"]), "two frames"),
        (lambda: keys.load_public(Path("/no/such.key")), "No such file"),
        (lambda: keys.create("no name", Path("/tmp")), "name must consist of"),
        *[
            row
            for seconds in (0, -1.0, float("nan"), float("inf"), "1")
            for row in (
                (lambda s=seconds: GripClient(NOWHERE, timeout_s=s), "^timeout_s must be a positive time in .* 1, got"),
                (lambda s=seconds: Subscriber(NOWHERE, silence_s=s), "^silence_s must be a positive time in .* 3, got"),
            )
        ],
        *[
            (lambda topic=topic: Subscriber(NOWHERE, topics=("slip", topic)), f"^topics .* {EVERY}.*, got {topic!r}$")
            for topic in ("slips", "slip.Left", "sli.left", "warning.left", "status.", "Slip", "slip left")
        ],
    ],
)
def test_whatever_goes_wrong_is_of_the_base_and_a_wrong_call_is_a_value_error(
    call: Callable[[], object], complaint: str
) -> None:
    with pytest.raises(SlipdClientError, match=complaint) as caught:
        call()
    assert isinstance(caught.value, ValueError) != isinstance(caught.value, ClientError)
