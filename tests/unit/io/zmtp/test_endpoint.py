from __future__ import annotations

import contextlib
import os
import socket
import stat
from pathlib import Path

import pytest

from slipd.errors import LinkError
from slipd.io.zmtp.endpoint import MAX_IPC_PATH_BYTES, Access, bind, check_free, release

SECRET = bytes(range(32))
KEYS, ANYBODY_HERE = Access(local_tcp=True, secret=SECRET), Access(local_tcp=True)


@pytest.mark.parametrize(
    ("endpoint", "access", "words"),
    [
        *((f"tcp://{host}:5555", Access(), "list of allowed keys") for host in ("*", "0.0.0.0", "192.168.1.7")),
        *((f"tcp://{host}:*", Access(), "every user of this machine") for host in ("127.0.0.1", "localhost")),
        *((f"tcp://{host}:5555", ANYBODY_HERE, "other machines") for host in ("*", "0.0.0.0", "192.168.1.7")),
        *(
            (f"tcp://{host}:5555", KEYS, "must be an IPv4 address")
            for host in ("robot.example", "[::]", "", "127.0.0.1.example.org", "127.0.0.1:1;tcp://10.0.0.1")
        ),
        *((text, KEYS, "valid ones are ipc:///") for text in ("", "ipc", "udp://127.0.0.1:1", "/run/slipd/publish")),
        *((text, KEYS, "must be absolute") for text in ("ipc://", "ipc://*", "ipc://@abstract", "unix://a/b")),
        ("tcp://127.0.0.1:70000", KEYS, "cannot be bound"),
        ("ipc:///nowhere/at/all", KEYS, "there is no directory /nowhere/at; create it"),
        ("ipc:///tmp/".ljust(MAX_IPC_PATH_BYTES, "µ"), KEYS, "at most 107 bytes"),
    ],
)
def test_an_endpoint_that_is_invalid_or_admits_anybody_is_refused_by_name(
    endpoint: str, access: Access, words: str
) -> None:
    for refuse in (bind, check_free):
        with pytest.raises(LinkError, match=words) as raised:
            refuse(endpoint, access)
        assert str(raised.value).startswith(endpoint)


@pytest.mark.parametrize(
    ("mode", "refused"), [(0o777, True), (0o775, True), (0o707, True), (0o755, False), (0o1777, False)]
)
def test_a_directory_that_others_may_change_is_refused_unless_it_is_sticky(
    mode: int, refused: bool, tmp_path: Path
) -> None:
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared").chmod(mode)
    with pytest.raises(LinkError, match=f"mode {mode:04o}") if refused else contextlib.nullcontext():
        release(*bind(f"ipc://{tmp_path}/shared/s"))


@pytest.mark.parametrize(
    ("host", "access"),
    [
        ("127.0.0.1", ANYBODY_HERE),
        ("127.8.8.8", ANYBODY_HERE),
        ("localhost", ANYBODY_HERE),
        ("*", Access(secret=SECRET)),
    ],
)
def test_a_free_port_is_chosen_and_returned(host: str, access: Access) -> None:
    check_free(f"tcp://{host}:*", access)
    server, endpoint = bind(f"tcp://{host}:*", access)
    server.close()
    assert int(endpoint.rpartition(":")[2]) > 0


def test_the_longest_path_is_bound_for_the_user_alone_and_a_longer_one_is_refused(tmp_path: Path) -> None:
    longest = f"{tmp_path}/".ljust(MAX_IPC_PATH_BYTES, "x")
    umask = os.umask(0)
    try:
        server, endpoint = bind(f"ipc://{longest}")
        assert (endpoint, os.umask(0)) == (f"ipc://{longest}", 0)
    finally:
        os.umask(umask)
    assert stat.S_IMODE(Path(longest).stat().st_mode) == 0o700
    server.close()
    with pytest.raises(LinkError, match="at most 107 bytes, got 108"):
        bind(f"ipc://{longest}x")


def test_Z6_the_path_of_a_living_server_is_not_stolen(endpoint: str) -> None:
    server, _ = bind(endpoint)
    with pytest.raises(LinkError, match="another program serves this endpoint"):
        bind(endpoint)
    server.close()


def test_a_busy_server_does_not_count_as_dead(endpoint: str, tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        busy = stack.enter_context(socket.socket(socket.AF_UNIX))
        busy.bind(str(tmp_path / "s"))
        busy.listen(0)
        with contextlib.suppress(BlockingIOError):
            while True:
                visitor = stack.enter_context(socket.socket(socket.AF_UNIX))
                visitor.setblocking(False)
                visitor.connect(str(tmp_path / "s"))
        with pytest.raises(LinkError, match="another program serves this endpoint"):
            bind(endpoint)


def test_the_socket_of_a_killed_server_is_replaced(endpoint: str, tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(tmp_path / "s"))
    release(*bind(endpoint))


def test_a_file_in_the_way_is_not_deleted(tmp_path: Path) -> None:
    file = tmp_path / "thesis.tex"
    file.write_text("ten years of work")
    with pytest.raises(LinkError, match="not a socket"):
        bind(f"ipc://{file}")
    assert file.read_text() == "ten years of work"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_directory_of_another_user_is_refused(tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", 12345, -1)
    with pytest.raises(LinkError, match="must belong to this user or root, got user 12345"):
        bind(f"ipc://{tmp_path}/theirs/s")
