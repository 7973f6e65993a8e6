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
from loop_waits import PATIENCE_S, eventually
from project import CONFIG

from slipd.events import Event, LinkSpec
from slipd.io.publisher import Publisher
from slipd.io.request_server import RequestServer
from slipd.io.systemd import ANSWER_S, FEEDS_PER_TIMEOUT, SystemdNotifier, stage_checks, watch_stages
from slipd.io.transport import Links
from slipd.io.zmtp.listener import Listener


@pytest.mark.parametrize("abstract", [False, True])
def test_every_report_is_one_datagram_and_a_status_is_sent_once_on_one_line(abstract: bool, tmp_path: Path) -> None:
    place = f"@slipd-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(place.replace("@", "\0"))
        notifier = SystemdNotifier({"NOTIFY_SOCKET": place})
        for text in ("well", "well", "bad\nREADY=1", "well"):
            notifier.status(text)
        for report in (notifier.ready, notifier.feed, notifier.stopping, notifier.reloading):
            report()
        told = [manager.recv(4096, socket.MSG_DONTWAIT) for _ in range(7)]
        with pytest.raises(BlockingIOError):
            manager.recv(4096, socket.MSG_DONTWAIT)
    statuses = [b"STATUS=well", rb"STATUS=bad\nREADY=1", b"STATUS=well"]
    assert told[:6] == [*statuses, b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]
    assert told[6].startswith(b"RELOADING=1\nMONOTONIC_USEC=")


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


class Daemon:
    """The stages of a daemon, and a device that sends."""

    def __init__(self, links: Links, publisher: Publisher, requests: RequestServer, device: int) -> None:
        self.links, self.publisher, self.requests, self.device = links, publisher, requests, device
        self.ticks, self.ticking = 0, True
        self.stages = stage_checks(links, lambda: self.ticks, publisher, requests)

    async def stalled(self) -> set[str]:
        """Let the device send and a tick pass, and return the stages without progress."""
        os.write(self.device, b"a reading")
        await asyncio.sleep(0.01)
        self.ticks += self.ticking
        return {name for name, check in self.stages.items() if await check()}

    async def until_stalled(self, *stages: str) -> None:
        """Wait until these stages alone make no progress, twice in a row; a pause of this process may stall any."""
        async with asyncio.timeout(PATIENCE_S):
            while not (await self.stalled() == set(stages) == await self.stalled()):
                pass


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
    ("stage", "stall"),
    [
        ("links", _stop_reading),
        ("engine", _stop_ticking),
        ("publishing", lambda daemon: _stop_accepting(daemon.publisher)),
        ("requests", lambda daemon: _stop_accepting(daemon.requests)),
    ],
)
async def test_P2_a_stalled_stage_is_found_and_only_that(
    daemon: Daemon, stage: str, stall: Callable[[Daemon], None]
) -> None:
    await daemon.until_stalled()
    stall(daemon)
    await daemon.until_stalled(stage)


@pytest.mark.parametrize("unit", ["slipd.service", "slipd-user.service"])
def test_P2_one_check_may_fail_before_the_watchdog_of_the_unit_ends_the_daemon(unit: str) -> None:
    """Even if both endpoints are waited for, in the check that fails and in the next one."""
    timeout_s = float(re.findall(r"^WatchdogSec=(.+)$", (CONFIG / unit).read_text(encoding="utf-8"), re.MULTILINE)[0])
    assert 2 * (timeout_s / FEEDS_PER_TIMEOUT + 2 * ANSWER_S) <= timeout_s


async def test_P2_the_watchdog_is_not_fed_while_a_stage_stands_still(caplog: pytest.LogCaptureFixture) -> None:
    stall, fed = "", list[str]()

    async def check() -> str:
        return stall

    watchdog = asyncio.create_task(
        watch_stages(lambda: fed.append("fed"), 0.004 * FEEDS_PER_TIMEOUT, {"engine": check})
    )
    await eventually(lambda: len(fed) > 2)
    stall = "it handles no ticks"
    with caplog.at_level(logging.ERROR):
        await eventually(lambda: "no progress (engine: it handles no ticks)" in caplog.text)
        fed.clear()
        caplog.clear()
        await eventually(lambda: caplog.records)
    assert fed == []
    stall = ""
    await eventually(lambda: fed)
    watchdog.cancel()
