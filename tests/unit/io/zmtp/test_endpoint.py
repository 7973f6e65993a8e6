from __future__ import annotations

import contextlib
import os
import socket
import stat
from pathlib import Path

import pytest

from slipd.errors import LinkError
from slipd.io.zmtp.endpoint import MAX_IPC_PATH_BYTES, Access, bind

SECRET = bytes(range(32))


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp://*:5555",
        "tcp://0.0.0.0:5555",
        "tcp://192.168.1.7:5555",
        "tcp://127.0.0.1:5555",
        "tcp://localhost:*",
    ],
)
def test_an_endpoint_that_others_reach_is_refused_without_keys(endpoint: str) -> None:
    with pytest.raises(LinkError, match="list of allowed keys") as raised:
        bind(endpoint)
    assert str(raised.value).startswith(endpoint)


@pytest.mark.parametrize("endpoint", ["tcp://*:5555", "tcp://0.0.0.0:5555", "tcp://192.168.1.7:5555"])
def test_allowing_this_machine_does_not_allow_others(endpoint: str) -> None:
    with pytest.raises(LinkError, match="other machines"):
        bind(endpoint, Access(local_tcp=True))


@pytest.mark.parametrize(
    "host", ["robot.example", "eth0", "[::]", "", "127.0.0.1.example.org", "127.0.0.1:1;tcp://10.0.0.1"]
)
def test_a_host_that_is_not_an_address_is_refused_even_with_keys(host: str) -> None:
    with pytest.raises(LinkError, match="must be an IPv4 address"):
        bind(f"tcp://{host}:5555", Access(SECRET, local_tcp=True))


def test_every_address_of_the_machine_is_served_with_keys() -> None:
    server, endpoint = bind("tcp://*:*", Access(SECRET))
    assert endpoint.startswith("tcp://0.0.0.0:")
    server.close()


@pytest.mark.parametrize("endpoint", ["", "ipc", "udp://127.0.0.1:1", "/run/slipd/publish", "pgm://eth0;1.1.1.1:5"])
def test_an_invalid_endpoint_is_refused_with_an_example(endpoint: str) -> None:
    with pytest.raises(LinkError, match="valid ones are ipc:///"):
        bind(endpoint)


@pytest.mark.parametrize("endpoint", ["ipc://", "ipc://*", "ipc://@abstract", "ipc://relative/path"])
def test_an_ipc_endpoint_without_an_absolute_path_is_refused(endpoint: str) -> None:
    with pytest.raises(LinkError, match="must be absolute"):
        bind(endpoint)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.8.8", "localhost"])
def test_a_free_port_is_chosen_and_returned(host: str) -> None:
    server, endpoint = bind(f"tcp://{host}:*", Access(local_tcp=True))
    assert int(endpoint.rpartition(":")[2]) > 0
    server.close()


def test_a_port_in_use_is_a_clear_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as holder:
        endpoint = f"tcp://127.0.0.1:{holder.getsockname()[1]}"
        with pytest.raises(LinkError, match=f"{endpoint}: cannot be bound: Address already in use"):
            bind(endpoint, Access(local_tcp=True))


def test_nobody_but_the_user_may_enter_an_ipc_socket(tmp_path: Path) -> None:
    path = tmp_path / "s"
    umask = os.umask(0)
    try:
        server, _ = bind(f"ipc://{path}")
        assert os.umask(0) == 0
    finally:
        os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o700
    server.close()


def test_the_longest_path_is_bound_and_a_longer_one_is_refused(tmp_path: Path) -> None:
    longest = f"{tmp_path}/".ljust(MAX_IPC_PATH_BYTES, "x")
    server, endpoint = bind(f"ipc://{longest}")
    assert endpoint == f"ipc://{longest}"
    server.close()
    with pytest.raises(LinkError, match="at most 107 bytes, got 108"):
        bind(f"ipc://{longest}x")


def test_bytes_count_and_not_letters(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="at most"):
        bind(f"ipc://{tmp_path}/".ljust(MAX_IPC_PATH_BYTES, "µ"))


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
    server, _ = bind(endpoint)
    server.close()


def test_a_file_in_the_way_is_not_deleted(tmp_path: Path) -> None:
    file = tmp_path / "thesis.tex"
    file.write_text("ten years of work")
    with pytest.raises(LinkError, match="not a socket"):
        bind(f"ipc://{file}")
    assert file.read_text() == "ten years of work"


def test_a_missing_directory_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="there is no directory"):
        bind(f"ipc://{tmp_path}/nowhere/s")


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o707])
def test_a_directory_that_others_may_change_is_refused(mode: int, tmp_path: Path) -> None:
    (tmp_path / "loose").mkdir()
    (tmp_path / "loose").chmod(mode)
    with pytest.raises(LinkError, match=f"mode {mode:04o}"):
        bind(f"ipc://{tmp_path}/loose/s")


@pytest.mark.parametrize("mode", [0o755, 0o1777])
def test_a_sticky_directory_is_accepted(mode: int, tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared").chmod(mode)
    server, _ = bind(f"ipc://{tmp_path}/shared/s")
    server.close()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_directory_of_another_user_is_refused(tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", 12345, -1)
    with pytest.raises(LinkError, match="must belong to this user or root, got user 12345"):
        bind(f"ipc://{tmp_path}/theirs/s")
