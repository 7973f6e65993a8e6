"""What browsers get of a daemon's messages: the newest state, and only while somebody looks."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest
import zmq
from websockets.asyncio.client import ClientConnection, connect

from slipd_client.arguments import ListenAddress
from slipd_client.messages import encode
from slipd_client.page import live_feed
from slipd_client.page.live_feed import LiveFeed, Newest
from slipd_client.page.page_server import PageServer, Site
from slipd_client.page.requests_of_page import PageRequests

if TYPE_CHECKING:
    from conftest import Daemon

PATIENCE_S = 60.0


def message(topic: str, seq: int, boot: str = "one", **fields: Any) -> list[bytes]:
    return [topic.encode(), encode({"v": 1, "seq": seq, "boot": boot, "t_ns": 1} | fields)]


FIRST = [message("slip.left", 1), message("status", 1)]
AGAIN = message("slip.left", 3)
UNREADABLE = [[b"slip.left", b"\xc1"], [b"warning"], [*message("status", 1), b""], message("grasp", 1, v=2)]
BAD = "unsupported_version: v must be 1, got 2"
CLEAR: list[list[bytes]] = []
"""In the place of messages: nobody looks any more."""


@pytest.mark.parametrize(
    ("ticks", "seen", "now_s", "expected"),
    [
        pytest.param(
            [(0.0, [*FIRST, message("slip.left", 2)])], 0, 0.0, {"slip.left": (2, 0.0), "status": (1, 0.0)}, id="newest"
        ),
        pytest.param(
            [(0.0, FIRST), (0.0, [message("slip.left", 2)])], 1, 0.0, {"slip.left": (2, 0.0)}, id="what is new"
        ),
        pytest.param([(0.0, FIRST), (0.0, [message("slip.left", 2)])], 2, 0.0, {}, id="nothing is new"),
        pytest.param(
            [(10.0, [AGAIN, message("status", 1)]), (10.5, [AGAIN])],
            0,
            11.25,
            {"slip.left": (3, 1.25), "status": (1, 1.25)},
            id="one that repeats within a tick that nobody saw",
        ),
        pytest.param(
            [(0.0, [message("slip.left", 9), message("slip.right", 9)]), (0.0, [message("slip.left", 0, "two")])],
            0,
            0.0,
            {"slip.left": (0, 0.0)},
            id="another run replaces the one before",
        ),
        pytest.param(
            [(0.0, [message("slip.left", 8), message("slip.right", 9), message("slip.left", 0, "two")])],
            0,
            0.0,
            {"slip.left": (0, 0.0)},
            id="two runs within a tick",
        ),
        pytest.param(
            [(0.0, [AGAIN]), (0.0, CLEAR), (0.0, [AGAIN])], 1, 0.0, {"slip.left": (3, 0.0)}, id="after a pause"
        ),
        pytest.param([(0.0, UNREADABLE)], 0, 0.0, {}, id="unreadable"),
    ],
)
def test_a_frame_has_what_is_new_to_a_browser_with_its_age(
    ticks: list[tuple[float, list[list[bytes]]]], seen: int, now_s: float, expected: dict[str, tuple[int, float]]
) -> None:
    newest = Newest()
    for at_s, messages in ticks:
        if messages is CLEAR:
            newest.clear()
        assert newest.add(messages, at_s) == bool(messages)
        newest.frame(newest.tick - 1, at_s)  # another browser has drawn it
    frame = json.loads(newest.frame(seen, now_s))
    assert {topic: (body["seq"], frame["ages"][topic]) for topic, body in frame["topics"].items()} == expected
    assert frame["changes"] == []
    assert (newest.bad, newest.bad_reason, frame["bad"]) == (
        (4, BAD, BAD) if ticks[0][1] is UNREADABLE else (0, "", "")
    )


class Sender:
    """The publishing side of a daemon, and what it is asked for."""

    def __init__(self, endpoint: str) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.bind(endpoint)
        self._asked: set[bytes] = set()

    def subscribed(self) -> set[bytes]:
        """Return the beginnings of topics that are subscribed to now."""
        while self._socket.poll(0):
            asked = self._socket.recv()
            change = self._asked.add if asked[:1] == b"\x01" else self._asked.discard
            change(asked[1:])
        return self._asked

    def send(self, topic: str, seq: int, **fields: Any) -> None:
        self._socket.send_multipart(message(topic, seq, **fields))

    def close(self) -> None:
        self._context.destroy(linger=0)


async def until(condition: Callable[[], Any]) -> Any:
    until_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < until_s
        await asyncio.sleep(0.01)
    return found


@asynccontextmanager
async def viewing(publish: str, requests: PageRequests | None = None) -> AsyncIterator[tuple[LiveFeed, str]]:
    """A feed, and the address of its page."""
    feed = LiveFeed(publish, requests)
    running = asyncio.create_task(feed.run())
    try:
        async with PageServer(ListenAddress("127.0.0.1", 0), Site({}), feed.view).serving() as url:
            yield feed, url
    finally:
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running


@asynccontextmanager
async def browser(url: str) -> AsyncIterator[ClientConnection]:
    where = urlsplit(url)
    async with connect(f"ws://{where.netloc}/live", origin=f"http://{where.netloc}") as socket:  # type: ignore[arg-type]
        await socket.send(where.fragment)
        yield socket


async def frame(socket: ClientConnection) -> dict[str, Any]:
    await socket.send("next")
    return await reply(socket, "topics")


async def reply(socket: ClientConnection, kind: str) -> dict[str, Any]:
    while True:
        found: dict[str, Any] = json.loads(await asyncio.wait_for(socket.recv(), PATIENCE_S))
        if kind in found:
            return found


async def newest_seq(socket: ClientConnection, topic: str, seq: int) -> dict[str, Any]:
    """Ask for frames until one has this message."""
    while True:
        found = await frame(socket)
        if found["topics"].get(topic, {}).get("seq") == seq:
            return found


async def test_the_daemon_is_asked_for_messages_only_while_somebody_looks(publish: str) -> None:
    sender = Sender(publish)
    try:
        async with viewing(publish) as (feed, url):
            async with browser(url) as first:
                await until(lambda: sender.subscribed() == set(live_feed.TOPICS))
                sender.send("slip.left", 1)
                await newest_seq(first, "slip.left", 1)
                async with browser(url) as second:
                    assert (await newest_seq(second, "slip.left", 1))["topics"].keys() == {"slip.left"}
                assert sender.subscribed()
            await until(lambda: not feed.viewers)
            await until(lambda: not sender.subscribed())
            async with browser(url):
                await until(lambda: sender.subscribed() == set(live_feed.TOPICS))
    finally:
        sender.close()


async def test_a_browser_that_asks_for_nothing_delays_no_other_and_then_gets_the_newest(publish: str) -> None:
    sender = Sender(publish)
    try:
        async with viewing(publish) as (_, url), browser(url) as slow, browser(url) as quick:
            await until(lambda: sender.subscribed() == set(live_feed.TOPICS))
            sender.send("warning", 0)
            for seq in range(1, 30):
                sender.send("slip.left", seq)
                await newest_seq(quick, "slip.left", seq)
            found = await frame(slow)
            assert found["topics"]["slip.left"]["seq"] == 29
            assert [change["seq"] for change in found["changes"]] == [0]
    finally:
        sender.close()


async def test_a_page_that_only_shows_refuses_requests(publish: str) -> None:
    async with viewing(publish) as (_, url), browser(url) as socket:
        await socket.send('{"do": "tare", "finger": "left"}')
        assert (await reply(socket, "reply"))["reply"]["ok"] is False


async def test_too_many_browsers_are_refused(publish: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_feed, "VIEWERS", 1)
    async with viewing(publish) as (_, url), browser(url) as first:
        await frame(first)
        async with browser(url) as second:
            await second.wait_closed()
            assert (second.close_code, second.close_reason) == (1013, "1 browsers look already")


async def test_frames_go_on_while_a_request_takes_its_time(publish: str, daemon: Daemon) -> None:
    polls = 0

    def busy(_: dict[str, Any]) -> dict[str, Any]:
        nonlocal polls
        polls += 1
        return {"tare_id": 1, "busy": polls < 5} | TARE

    daemon.handlers["tare"] = lambda _: (
        {"finger": "left", "seconds": 1.0, "verified": True} | {"tare_ids": {"wrench": 0}}
    )
    daemon.handlers["tare.get"] = busy
    async with viewing(publish, PageRequests(daemon.endpoint)) as (_, url), browser(url) as socket:
        assert (await reply(socket, "permission"))["permission"] == ""
        for _ in range(2):
            await socket.send('{"do": "tare", "finger": "left"}')
        assert (await reply(socket, "reply"))["reply"] == {
            "ok": False,
            "text": "busy: the request before it is not answered yet",
        }
        assert (await frame(socket))["topics"] == {}
        await until(lambda: polls >= 5)
    assert daemon.ops.count("tare") == 1


TARE = {"finger": "left", "stream": "wrench", "taken_t_ns": 1, "readings": 9, "offset": [0.0], "by": "page"}
