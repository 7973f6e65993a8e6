"""When a link tries again, and what it reports, with connections that follow a script."""

from __future__ import annotations

import asyncio
import logging
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from link_ends import downs

from slipd.errors import LinkError
from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import Links
from slipd.io.transport.link import FIRST_DELAY_S, JITTER, MAX_DELAY_S, STEADY_S, Link
from slipd.io.transport.link_connection import OnBytes

SPEC = LinkSpec("left.wrench", "scripted", "somewhere")


class Connection:
    """Deliver bytes by a script, then be lost."""

    identity, overruns, latency = "what was opened", 2, ""

    def __init__(self, data: bytes, on_bytes: OnBytes) -> None:
        self._data, self._on_bytes = data, on_bytes

    async def until_lost(self) -> str:
        if self._data:
            self._on_bytes(self._data)
        return "pulled"

    def write(self, data: bytes) -> bool:
        return False

    async def close(self) -> None:
        return


Script = list[str | bytes | Exception]


def opener(script: Script, make: type[Connection] = Connection) -> Callable[[LinkSpec, OnBytes], Awaitable[Connection]]:
    """Open by a script: a text is a reason for failure, bytes are delivered before the connection is lost."""

    async def open_next(spec: LinkSpec, on_bytes: OnBytes) -> Connection:
        if not script:
            raise asyncio.CancelledError
        step = script.pop(0)
        if isinstance(step, bytes):
            return make(step, on_bytes)
        raise step if isinstance(step, Exception) else LinkError(step)

    return open_next


async def ended(link: Link) -> None:
    """Run a link to the end of its script."""
    with pytest.raises(asyncio.CancelledError):
        await link.run()


async def play(script: Script, make: type[Connection] = Connection) -> list[Event]:
    events: list[Event] = []
    link = Link(SPEC, opener([*script], make), events.append)
    await ended(link)
    assert link.overruns == 2 * sum(isinstance(step, bytes) for step in script), "those of all connections"
    return events


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pauses of a link, which take no time here."""
    made: list[float] = []
    sleep = asyncio.sleep

    async def note(delay_s: float) -> None:
        made.append(delay_s)
        await sleep(0)

    monkeypatch.setattr("slipd.io.transport.link.asyncio.sleep", note)
    return made


class Stuck(Connection):
    async def close(self) -> None:
        raise OSError("does not let go")


FAULT = "somewhere: cannot be opened (ZeroDivisionError: a fault of a library)"


@pytest.mark.usefixtures("pauses")
@pytest.mark.parametrize(
    ("script", "make", "reported"),
    [
        (["absent", "absent", "held", "held", "absent"], Connection, ["absent", "held", "absent"]),
        ([b"1", b"2"], Connection, [LinkUp, "pulled", LinkUp, "pulled"]),
        ([ZeroDivisionError("a fault of a library"), b"alive", "absent"], Stuck, [FAULT, LinkUp, "pulled", "absent"]),
    ],
    ids=["the same again", "the same after it was up", "any exception of opening or closing"],
)
async def test_a_reason_is_reported_again_only_after_another_or_after_the_link_was_up(
    script: Script, make: type[Connection], reported: list[object]
) -> None:
    up = LinkUp("left.wrench", "what was opened")
    told = [up if each is LinkUp else LinkDown("left.wrench", each) for each in reported]
    assert [event for event in await play(script, make) if not isinstance(event, Bytes)] == told


@pytest.mark.usefixtures("pauses")
async def test_a_link_that_opens_and_dies_is_logged_once_until_bytes_arrive(caplog: pytest.LogCaptureFixture) -> None:
    """A UDP device that is off: its socket opens, and the first request is refused."""
    caplog.set_level(logging.INFO)
    silent: Script = [b""] * 20
    events = await play([*silent, b"alive", *silent])
    once = ["left.wrench: open (what was opened)", "left.wrench: pulled"]
    assert caplog.messages == [*once, once[1], once[0]]
    faults = [getattr(record, "slipd_fault", None) for record in caplog.records]
    assert faults == [None, "stream-missing", "stream-fault", None]
    assert downs(events) == ["pulled"] * 41


GROWING = [min(FIRST_DELAY_S * 2**n, MAX_DELAY_S) for n in range(12)]
BACK: Script = [*["absent"] * 8, b"alive", "absent"]


@pytest.mark.parametrize(
    ("script", "lasts_s", "means_s"),
    [
        (["absent"] * 12, 0.0, GROWING),
        ([b""] * 12, 10.0, GROWING),
        (BACK, STEADY_S, [*GROWING[:8], *GROWING[:2]]),
        (BACK, 0.9 * STEADY_S, GROWING[:10]),
    ],
    ids=["absent", "opens without bytes", "brought bytes for a while", "brought bytes and died at once"],
)
async def test_pauses_double_with_jitter_until_a_connection_brings_bytes_for_a_while(
    script: Script, lasts_s: float, means_s: list[float], pauses: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [100.0]

    class Lasting(Connection):
        async def until_lost(self) -> str:
            now_s[0] += lasts_s
            return await super().until_lost()

    monkeypatch.setattr("slipd.io.transport.link.time.monotonic", lambda: now_s[0])
    await play(script, Lasting)
    assert all(abs(pause_s / mean_s - 1) <= JITTER for pause_s, mean_s in zip(pauses, means_s, strict=True))
    assert len(set(pauses)) == len(pauses)


@pytest.mark.usefixtures("pauses")
async def test_a_write_reaches_an_open_connection_alone_and_a_refused_one_counts() -> None:
    answers = [True, False, False, True, False]

    class Busy(Connection):
        def write(self, data: bytes) -> bool:
            return answers.pop(0)

        async def close(self) -> None:
            assert not link.write(b"too late")

    link = Link(SPEC, opener([b""], Busy), lambda _: [link.write(b"command") for _ in answers[:]])
    assert not link.write(b"too early")
    await ended(link)
    assert (answers, link.refused_writes) == ([], 5)


async def test_bytes_are_unread_if_they_wait_at_two_looks_and_none_came_in_between() -> None:
    class Waiting(Connection):
        def unread(self) -> bool:
            return True

        async def until_lost(self) -> str:
            looks.extend([link.unread(), link.unread()])
            self._on_bytes(b"x")
            looks.extend([link.unread(), link.unread()])
            return "pulled"

    looks: list[bool] = []
    link = Link(SPEC, opener([b""], Waiting), print)
    assert not link.unread()
    await ended(link)
    assert looks == [False, True, False, True]


@pytest.mark.parametrize(
    ("seen", "tried_at"),
    [
        ([None, None, None, "port", "port", None, "port"], [1, 5, 8]),
        (["port", "port", "other", "other", "other", "third"], [1, 4, 7]),
        (["port", "port", None, "port", "port", None, "port"], [1, 5, 8]),
    ],
    ids=["it appears", "another has its place", "the same, plugged in again"],
)
async def test_L6_a_pause_ends_when_a_device_is_plugged_in_and_the_next_is_the_first(
    seen: list[object], tried_at: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tokens of the device at the address, one for each probe; by its pause alone the link would not try again."""
    monkeypatch.setattr("slipd.io.transport.link.PROBE_S", 0.001)
    looks: list[str] = []
    tried: list[int] = []

    def probe(address: str) -> object:
        looks.append(address)
        return seen[min(len(looks), len(seen)) - 1]

    async def fail(spec: LinkSpec, on_bytes: OnBytes) -> Connection:
        tried.append(len(looks))
        if len(tried) == 3:
            raise asyncio.CancelledError
        link._delay_s = 1000.0
        raise LinkError("not yet")

    link = Link(SPEC, fail, print, probe)
    await ended(link)
    assert (tried, set(looks), link._delay_s) == (tried_at, {SPEC.address}, FIRST_DELAY_S)


async def test_a_link_error_of_the_consumer_ends_the_group() -> None:
    def fail(event: Event) -> None:
        raise LinkError("a fault of the consumer")

    with pytest.raises(LinkError, match="of the consumer"):
        await Link(SPEC, opener([b"x"]), fail).run()


PORT = LinkSpec("left.wrench", "serial", "/nowhere/at/all", 115200)


async def test_an_unknown_transport_is_refused_before_anything_opens() -> None:
    async with asyncio.TaskGroup() as tasks:
        with pytest.raises(ValueError, match=r"transport must be serial, tcp, udp, .* got 'carrier pigeon'"):
            Links(tasks, [PORT, LinkSpec("right.wrench", "carrier pigeon", "roof")], print)


def test_no_library_is_loaded_for_a_transport_that_is_not_used() -> None:
    code = "import sys, slipd.io.transport; print({'websockets', 'serial', 'zmq'} & set(sys.modules))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path.cwd())
    assert told.stdout.strip() == "set()"
