"""Reports to systemd, on a real datagram socket."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from slipd.io.host.systemd_notify import SystemdNotifier


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "notify"))
        receiver.setblocking(False)
        yield receiver


def received(manager: socket.socket) -> list[bytes]:
    found = []
    try:
        while True:
            found.append(manager.recv(4096))
    except BlockingIOError:
        return found


def test_every_report_is_one_datagram(manager: socket.socket) -> None:
    notifier = SystemdNotifier({"NOTIFY_SOCKET": manager.getsockname()})
    notifier.ready()
    notifier.feed()
    notifier.reloading()
    notifier.stopping()
    ready, feed, reloading, stopping = received(manager)
    assert (ready, feed, stopping) == (b"READY=1", b"WATCHDOG=1", b"STOPPING=1")
    assert reloading.startswith(b"RELOADING=1\nMONOTONIC_USEC=")


def test_a_status_is_sent_once_on_one_line(manager: socket.socket) -> None:
    notifier = SystemdNotifier({"NOTIFY_SOCKET": manager.getsockname()})
    for text in ("well", "well", "bad\nREADY=1", "well"):
        notifier.status(text)
    assert received(manager) == [b"STATUS=well", rb"STATUS=bad\nREADY=1", b"STATUS=well"]


def test_an_abstract_socket_is_reached() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(f"\0slipd-test-{os.getpid()}")
        SystemdNotifier({"NOTIFY_SOCKET": f"@slipd-test-{os.getpid()}"}).ready()
        assert manager.recv(100) == b"READY=1"


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_a_manager_nothing_happens(environment: dict[str, str]) -> None:
    notifier = SystemdNotifier(environment)
    notifier.ready()
    notifier.status("well")
    assert notifier.watchdog_s is None


@pytest.mark.parametrize(
    ("pid", "microseconds", "timeout_s"),
    [("own", "2000000", 2.0), ("1", "2000000", None), ("own", "0", None), ("own", "soon", None)],
)
def test_the_watchdog_is_fed_only_by_the_process_that_it_watches(
    pid: str, microseconds: str, timeout_s: float | None
) -> None:
    number = pid.replace("own", str(os.getpid()))
    environment = {"NOTIFY_SOCKET": "/run/notify", "WATCHDOG_USEC": microseconds, "WATCHDOG_PID": number}
    assert SystemdNotifier(environment).watchdog_s == timeout_s
