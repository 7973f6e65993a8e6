"""Reports to systemd on a real datagram socket, and its watchdog, fed while every stage makes progress."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import socket
import tty
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
from loop_waits import eventually
from project import CONFIG

from slipd.events import Event, LinkSpec
from slipd.io.publisher import Publisher
from slipd.io.request_server import RequestServer
from slipd.io.systemd import ANSWER_S, FEEDS_PER_TIMEOUT, SystemdNotifier, watch_stages
from slipd.io.transport import Links
from slipd.io.zmtp.listener import Listener


@pytest.mark.parametrize("abstract", [False, True])
def test_every_report_is_one_datagram(abstract: bool, tmp_path: Path) -> None:
    place = f"@slipd-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(place.replace("@", "\0"))
        notifier = SystemdNotifier({"NOTIFY_SOCKET": place})
        notifier.send("READY=1")
        notifier.send("RELOADING=1", "MONOTONIC_USEC=1")
        told = [manager.recv(4096, socket.MSG_DONTWAIT) for _ in range(2)]
    assert told == [b"READY=1", b"RELOADING=1\nMONOTONIC_USEC=1"]


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_a_manager_nothing_happens(environment: dict[str, str]) -> None:
    notifier = SystemdNotifier(environment)
    notifier.send("READY=1")
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


class Daemon:
    """The stages of a daemon, a device that sends, and a watchdog."""

    def __init__(self, links: Links, publisher: Publisher, requests: RequestServer, device: int) -> None:
        self.links, self.publisher, self.requests, self.device = links, publisher, requests, device
        self.ticks, self.ticking, self.feeds = 0, True, 0

    def feed(self) -> None:
        self.feeds += 1

    def count(self) -> int:
        """Let the device send and a tick pass, and return the number of ticks."""
        os.write(self.device, b"a reading")
        self.ticks += self.ticking
        return self.ticks


@pytest.fixture
async def daemon(tmp_path: Path) -> AsyncIterator[Daemon]:
    device, port = os.openpty()
    tty.setraw(port)
    events: list[Event] = []
    link = LinkSpec("left.wrench", "serial", os.ttyname(port), 115200)
    with (
        Publisher(f"ipc://{tmp_path}/publish") as publisher,
        RequestServer(f"ipc://{tmp_path}/requests", lambda *_: None) as requests,
    ):
        async with asyncio.TaskGroup() as tasks, Links(tasks, [link], events.append) as links:
            await eventually(lambda: events)
            yield Daemon(links, publisher, requests, device)
    os.close(device)
    os.close(port)


def _stop_reading(daemon: Daemon) -> None:
    asyncio.get_running_loop().remove_reader(daemon.links._links["left.wrench"]._connection._fd)  # type: ignore[union-attr]


def _stop_ticking(daemon: Daemon) -> None:
    daemon.ticking = False


def _stop_accepting(listener: Listener) -> None:
    listener._over = True  # it accepts no more
    listener._stop_listening()


@pytest.mark.parametrize(
    ("why", "stall"),
    [
        ("bytes of left.wrench are not read", _stop_reading),
        ("the engine handles no ticks", _stop_ticking),
        ("ipc://.*/publish greets no client", lambda daemon: _stop_accepting(daemon.publisher)),
        ("ipc://.*/requests greets no client", lambda daemon: _stop_accepting(daemon.requests)),
    ],
)
async def test_P2_a_stalled_stage_is_found_and_only_that_and_the_watchdog_is_not_fed(
    daemon: Daemon, why: str, stall: Callable[[Daemon], None], caplog: pytest.LogCaptureFixture
) -> None:
    listeners = daemon.publisher, daemon.requests
    watch = watch_stages(daemon.feed, 0.02 * FEEDS_PER_TIMEOUT, daemon.links, daemon.count, listeners)
    watchdog = asyncio.create_task(watch)
    await eventually(lambda: daemon.feeds > 2)
    stall(daemon)
    with caplog.at_level(logging.ERROR):
        await eventually(lambda: re.search(rf"no progress \({why}\)", caplog.text))
        fed = daemon.feeds
        caplog.clear()
        await eventually(lambda: caplog.records)
    assert daemon.feeds == fed
    watchdog.cancel()


@pytest.mark.parametrize("unit", ["slipd.service", "slipd-user.service"])
def test_P2_one_check_may_fail_before_the_watchdog_of_the_unit_ends_the_daemon(unit: str) -> None:
    """Even if both endpoints are waited for, in the check that fails and in the next one."""
    timeout_s = float(re.findall(r"^WatchdogSec=(.+)$", (CONFIG / unit).read_text(encoding="utf-8"), re.MULTILINE)[0])
    assert 2 * (timeout_s / FEEDS_PER_TIMEOUT + 2 * ANSWER_S) <= timeout_s
