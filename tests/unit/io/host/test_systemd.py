"""Reports to systemd on a real datagram socket, and its watchdog, fed while every stage makes progress."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import tty
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import pytest
from daemon_peers import PATIENCE_S, until

from slipd.events import Event, LinkSpec
from slipd.io.bus.publisher import Publisher
from slipd.io.bus.request_server import RequestServer
from slipd.io.host.systemd import FEEDS_PER_TIMEOUT, SystemdNotifier, Watchdog, stage_checks
from slipd.io.transport import Links


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


class Daemon:
    """The stages of a daemon, and a device that sends."""

    def __init__(self, links: Links, publisher: Publisher, requests: RequestServer, device: int) -> None:
        self.links, self.publisher, self.requests, self.device = links, publisher, requests, device
        self.ticks = 0
        self.stages = stage_checks(links, lambda: self.ticks, publisher, requests)

    async def stalled(self) -> set[str]:
        """Let the device send and a tick pass, and return the stages without progress."""
        os.write(self.device, b"a reading")
        await asyncio.sleep(0.01)
        self.ticks += 1
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
            await until(lambda: events)
            yield Daemon(links, publisher, requests, device)
    os.close(device)
    os.close(port)


async def test_P2_a_daemon_that_works_has_no_stalled_stage(daemon: Daemon) -> None:
    await daemon.until_stalled()
    async with asyncio.timeout(PATIENCE_S):  # the kernel may still carry the last reading
        while [await daemon.stages["links"]() for _ in range(3)] != [""] * 3:  # noqa: ASYNC110 - there is no event
            await asyncio.sleep(0.01)


async def test_P2_an_engine_without_ticks_is_stalled(daemon: Daemon) -> None:
    check = daemon.stages["engine"]
    daemon.ticks += 1
    assert [await check(), await check()] == ["", "it handles no ticks"]


def _stop_reading(daemon: Daemon) -> None:
    asyncio.get_running_loop().remove_reader(daemon.links._links["left.wrench"]._connection._fd)  # type: ignore[union-attr]


def _stop_accepting(server: str) -> Callable[[Daemon], None]:
    def stop(daemon: Daemon) -> None:
        listener = getattr(daemon, server)
        listener._over = True  # it accepts no more
        listener._stop_listening()

    return stop


@pytest.mark.parametrize(
    ("stage", "stall"),
    [
        ("links", _stop_reading),
        ("publishing", _stop_accepting("publisher")),
        ("requests", _stop_accepting("requests")),
    ],
)
async def test_P2_a_stalled_stage_is_found_and_only_that(
    daemon: Daemon, stage: str, stall: Callable[[Daemon], None]
) -> None:
    await daemon.until_stalled()
    stall(daemon)
    await daemon.until_stalled(stage)


async def test_P2_the_watchdog_is_not_fed_while_a_stage_stands_still(caplog: pytest.LogCaptureFixture) -> None:
    stall, fed = "", 0

    async def check() -> str:
        return stall

    def feed() -> None:
        nonlocal fed
        fed += 1

    watchdog = asyncio.create_task(Watchdog(feed, 0.004 * FEEDS_PER_TIMEOUT, {"engine": check}).run())
    await until(lambda: fed > 2)
    stall = "it handles no ticks"
    with caplog.at_level(logging.ERROR):
        await until(lambda: "no progress (engine: it handles no ticks)" in caplog.text)
        before = fed
        caplog.clear()
        await until(lambda: caplog.records)
    assert fed == before
    stall = ""
    await until(lambda: fed > before)
    watchdog.cancel()
