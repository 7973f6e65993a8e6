from __future__ import annotations

import asyncio
import logging
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from slipd.errors import LinkError
from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import Links
from slipd.io.transport.link import FIRST_DELAY_S, JITTER, MAX_DELAY_S, STEADY_S, Link
from slipd.io.transport.link_connection import OnBytes

if TYPE_CHECKING:
    from conftest import Serving

SPEC = LinkSpec("left.wrench", "scripted", "somewhere")

Script = list[str]


class Connection:
    """Deliver bytes by a script, then be lost."""

    identity, overruns, latency = "what was opened", 2, ""

    def __init__(self, data: bytes, on_bytes: OnBytes) -> None:
        self._data = data
        self._on_bytes = on_bytes

    async def until_lost(self) -> str:
        if self._data:
            self._on_bytes(self._data)
        return "pulled"

    def write(self, data: bytes) -> bool:
        return False

    async def close(self) -> None:
        return


def opener(
    script: list[str | bytes | Exception], make: type[Connection] = Connection
) -> Callable[[LinkSpec, OnBytes], Awaitable[Connection]]:
    """Open by a script: a text is a reason for failure, bytes are delivered before the connection is lost."""

    async def open_next(spec: LinkSpec, on_bytes: OnBytes) -> Connection:
        if not script:
            raise asyncio.CancelledError
        step = script.pop(0)
        if isinstance(step, str):
            raise LinkError(step)
        if isinstance(step, Exception):
            raise step
        return make(step, on_bytes)

    return open_next


async def play(script: list[str | bytes | Exception], make: type[Connection] = Connection) -> list[Event]:
    events: list[Event] = []
    with pytest.raises(asyncio.CancelledError):
        await Link(SPEC, opener(script, make), events.append).run()
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


@pytest.mark.usefixtures("pauses")
async def test_a_reason_is_reported_again_only_after_another_or_after_the_link_was_up() -> None:
    events = await play(["absent", "absent", "held", "held", "absent"])
    assert events == [LinkDown("left.wrench", reason) for reason in ("absent", "held", "absent")]
    events = await play([b"1", b"2"])
    once = [LinkUp("left.wrench", "what was opened"), LinkDown("left.wrench", "pulled")]
    assert [event for event in events if not isinstance(event, Bytes)] == 2 * once


@pytest.mark.usefixtures("pauses")
async def test_a_link_that_opens_and_dies_is_logged_once_until_bytes_arrive(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A UDP device that is off: its socket opens, and the first request is refused."""
    caplog.set_level(logging.INFO)
    silent: list[str | bytes] = [b""] * 20
    events = await play([*silent, b"alive", *silent])
    once = ["left.wrench: open (what was opened)", "left.wrench: pulled"]
    assert caplog.messages == [*once, once[1], once[0]]
    assert sum(isinstance(event, LinkDown) for event in events) == 41


async def test_pauses_double_from_the_first_to_the_longest_with_jitter(pauses: list[float]) -> None:
    await play(["absent"] * 200)
    for pause_s, mean_s in zip(pauses, [FIRST_DELAY_S * 2**n for n in range(5)], strict=False):
        assert abs(pause_s / mean_s - 1) <= JITTER
    late = pauses[10:]
    assert all(abs(pause_s / MAX_DELAY_S - 1) <= JITTER for pause_s in late)
    assert len(set(late)) == len(late)


@pytest.mark.parametrize(("lasts_s", "brings_back"), [(STEADY_S, True), (0.9 * STEADY_S, False)])
async def test_a_connection_that_brought_bytes_for_a_while_brings_the_first_pause_back(
    lasts_s: float, brings_back: bool, pauses: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Lasting(Connection):
        async def until_lost(self) -> str:
            reason = await super().until_lost()
            now_s[0] += lasts_s if self._data else 10.0
            return reason

    now_s = [100.0]
    monkeypatch.setattr("slipd.io.transport.link.time.monotonic", lambda: now_s[0])
    await play([*["absent"] * 8, b"", b"alive", "absent"], Lasting)
    assert min(pauses[7:9]) > MAX_DELAY_S / 2
    assert (pauses[9] <= FIRST_DELAY_S * (1 + JITTER)) == brings_back


async def test_a_port_that_opens_and_dies_at_once_is_not_opened_ever_faster(pauses: list[float]) -> None:
    await play([b""] * 12)
    assert pauses[-1] >= MAX_DELAY_S * (1 - JITTER)


@pytest.mark.usefixtures("pauses")
async def test_any_exception_of_opening_or_closing_is_a_reason_and_does_not_end_the_link() -> None:
    class Stuck(Connection):
        async def close(self) -> None:
            raise OSError("does not let go")

    events = await play([ZeroDivisionError("a fault of a library"), b"alive", "absent"], Stuck)
    assert [event.reason for event in events if isinstance(event, LinkDown)] == [
        "somewhere: cannot be opened (ZeroDivisionError: a fault of a library)",
        "pulled",
        "absent",
    ]


@pytest.mark.usefixtures("pauses")
async def test_a_write_reaches_an_open_connection_alone_and_a_refused_one_is_logged_once_a_spell(
    caplog: pytest.LogCaptureFixture,
) -> None:
    answers = [True, False, False, True, False]

    class Busy(Connection):
        def write(self, data: bytes) -> bool:
            return answers.pop(0)

        async def close(self) -> None:
            assert not link.write(b"too late")

    link = Link(SPEC, opener([b""], Busy), lambda _: [link.write(b"command") for _ in answers[:]])
    assert not link.write(b"too early")
    with pytest.raises(asyncio.CancelledError):
        await link.run()
    assert (answers, link.refused_writes) == ([], 5)
    line = "left.wrench (somewhere) does not read: a command was dropped"
    assert [message for message in caplog.messages if "does not read" in message] == [line] * 2


@pytest.mark.usefixtures("pauses")
async def test_overruns_of_all_connections_are_added_up() -> None:
    link = Link(SPEC, opener([b"1", b"2", "absent"]), print)
    with pytest.raises(asyncio.CancelledError):
        await link.run()
    assert link.overruns == 4


class Places:
    """Tokens of the device at an address, one for each probe and the last for ever; and the attempts of the link."""

    def __init__(self, *seen: object) -> None:
        self._seen = list(seen)
        self.tried_at: list[int] = []
        self.looks = 0

    def probe(self, address: str) -> object:
        assert address == SPEC.address
        self.looks += 1
        return self._seen.pop(0) if len(self._seen) > 1 else self._seen[0]

    async def open(self, spec: LinkSpec, on_bytes: OnBytes) -> Connection:
        self.tried_at.append(self.looks)
        if len(self.tried_at) == 3:
            raise asyncio.CancelledError
        raise LinkError("not yet")


async def tries(*seen: object) -> list[int]:
    """Return the number of probes before each attempt."""
    places = Places(*seen)
    with pytest.raises(asyncio.CancelledError):
        await Link(SPEC, places.open, print, places.probe).run()
    return places.tried_at


@pytest.fixture
def long_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """A test times out if the link has no reason to try early."""
    monkeypatch.setattr("slipd.io.transport.link.FIRST_DELAY_S", 1000.0)
    monkeypatch.setattr("slipd.io.transport.link.MAX_DELAY_S", 1000.0)
    monkeypatch.setattr("slipd.io.transport.link.PROBE_S", 0.001)


@pytest.mark.usefixtures("long_pauses")
@pytest.mark.parametrize(
    ("seen", "tried_at"),
    [
        ((None, None, None, "port", "port", None, "port"), [1, 5, 8]),
        (("port", "port", "other", "other", "other", "third"), [1, 4, 7]),
        (("port", "port", None, "port", "port", None, "port"), [1, 5, 8]),
    ],
    ids=["it appears", "another has its place", "the same, plugged in again"],
)
async def test_L6_a_pause_ends_when_a_device_is_plugged_in(seen: tuple[object, ...], tried_at: list[int]) -> None:
    assert await tries(*seen) == tried_at


async def test_L6_a_device_that_appears_brings_the_first_pause_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipd.io.transport.link.PROBE_S", 0.001)
    places = Places(None, None, "port")
    link = Link(SPEC, places.open, print, places.probe)
    link._delay_s = 1000.0  # it would not try again by itself
    with pytest.raises(asyncio.CancelledError):
        await link.run()
    assert link._delay_s == 2 * FIRST_DELAY_S


async def test_a_link_error_of_the_consumer_ends_the_group() -> None:
    def fail(event: Event) -> None:
        if isinstance(event, LinkUp):
            raise LinkError("a fault of the consumer")

    with pytest.raises(LinkError, match="of the consumer"):
        await Link(SPEC, opener([b"x"]), fail).run()


PORT = LinkSpec("left.wrench", "serial", "/nowhere/at/all", 115200)


async def test_an_unknown_transport_is_refused_before_anything_opens() -> None:
    async with asyncio.TaskGroup() as tasks:
        with pytest.raises(ValueError, match=r"transport must be serial, tcp, udp, .* got 'carrier pigeon'"):
            Links(tasks, [PORT, LinkSpec("right.wrench", "carrier pigeon", "roof")], print)


async def test_two_links_with_the_same_name_are_refused() -> None:
    async with asyncio.TaskGroup() as tasks:
        with pytest.raises(ValueError, match=r"link names must differ, got 'left.wrench' twice"):
            Links(tasks, [PORT, PORT], print)


async def test_a_write_to_an_unknown_link_is_refused_with_the_known_names(serving: Serving) -> None:
    async with serving(PORT) as (links, _):
        assert links.unread() == []
        with pytest.raises(ValueError, match=r"link must be one of left.wrench, got 'left'"):
            links.write("left", b"x")


def test_no_library_is_loaded_for_a_transport_that_is_not_used() -> None:
    code = "import sys, slipd.io.transport; print({'websockets', 'serial', 'zmq'} & set(sys.modules))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path.cwd())
    assert told.stdout.strip() == "set()"
