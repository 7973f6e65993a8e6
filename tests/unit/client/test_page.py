"""The page: who may open it and press its buttons, what it serves, and what browsers get of a daemon's messages."""

from __future__ import annotations

import asyncio
import http.client
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from client_peers import PATIENCE_S, Daemon, Publisher
from page_peers import browser, reply
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed, InvalidStatus

from slipd_client.arguments import ListenAddress, parse_listen
from slipd_client.errors import CallError
from slipd_client.messages import encode
from slipd_client.page import live_feed
from slipd_client.page.live_feed import LiveFeed, Newest
from slipd_client.page.page_server import ASSETS, WRONG_TOKEN, PageServer, json_answer, redirect_file
from slipd_client.page.requests_of_page import PageRequests
from slipd_client.page.view_command import CommissionPage, view

LOOPBACK = ListenAddress("127.0.0.1", 0)
BUDGET_BYTES = 1_000_000


async def greet(connection: ServerConnection) -> None:
    await connection.send("welcome")


@asynccontextmanager
async def served(live: bool = True) -> AsyncIterator[str]:
    """A page with a WebSocket that greets, or with data; its address."""
    on_data = None if live else lambda path: json_answer(path) if path == "/data/some" else None
    async with PageServer(LOOPBACK, {"live": live}, greet if live else None, on_data).serving() as url:
        yield url


async def get(url: str, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    def ask() -> tuple[int, bytes, dict[str, str]]:
        connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=PATIENCE_S)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read(), dict(answer.getheaders())

    return await asyncio.to_thread(ask)


def bearer(url: str) -> str:
    return f"Bearer {urlsplit(url).fragment}"


async def test_every_file_of_the_page_is_served_within_the_budget() -> None:
    async with served() as url:
        paths = ["/", *(f"/{file.relative_to(ASSETS).as_posix()}" for file in ASSETS.rglob("*.*"))]
        answers = {path: await get(url, path) for path in paths}
        _, settings, _ = await get(url, "/settings.json", Authorization=bearer(url))
    for path, (status, _, headers) in answers.items():
        assert (status, "default-src 'none'" in headers["Content-Security-Policy"], headers["X-Frame-Options"]) == (
            HTTPStatus.NOT_FOUND if path.endswith("LICENSE") else HTTPStatus.OK,
            True,
            "DENY",
        )
    assert json.loads(settings)["words"]["levels"][0] == "no_contact"
    assert sum(len(body) for _, body, _ in answers.values()) + len(settings) < BUDGET_BYTES


@pytest.mark.parametrize(
    ("live", "path", "headers", "status"),
    [
        *(
            (True, path, {}, HTTPStatus.NOT_FOUND)
            for path in ("/nothing", "/../page_server.py", "/%2e%2e/site.py", "//etc/passwd", "/vendor/", "/data/some")
        ),
        *(
            (True, "/", {"Host": host}, HTTPStatus.FORBIDDEN)
            for host in ("evil.example", "evil.example:8710", "127.0.0.1.evil.example", "", "a b", "user@127.0.0.1")
        ),
        *(
            (False, path, headers, HTTPStatus.UNAUTHORIZED)
            for path in ("/data/some", "/settings.json")
            for headers in ({}, {"Authorization": "Bearer wrong"})
        ),
        (False, "/data/some", None, HTTPStatus.OK),
        (False, "/data/other", None, HTTPStatus.NOT_FOUND),
        (False, "/live", {}, HTTPStatus.NOT_FOUND),
    ],
)
async def test_nothing_else_is_served_and_neither_without_the_token_nor_under_a_name_of_another_machine(
    live: bool, path: str, headers: dict[str, str] | None, status: HTTPStatus
) -> None:
    async with served(live) as url:
        found, body, _ = await get(url, path, **({"Authorization": bearer(url)} if headers is None else headers))
    assert (found, body == b'"/data/some"', b"live" in body) == (status, status is HTTPStatus.OK, False)


@pytest.mark.parametrize(
    "origin", [None, "null", "http://evil.example", "http://localhost:1", "http://127.0.0.1", "file://", "http://"]
)
async def test_a_page_of_another_site_is_kept_out_even_with_the_token_and_not_logged(
    origin: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    async with served() as url:
        with pytest.raises(InvalidStatus, match="403"):
            async with browser(url, origin=origin):
                pytest.fail("it was let in")
    assert "slipd_client.page" not in {record.name for record in caplog.records}


@pytest.mark.parametrize("token", ["", "wrong", "é"])
async def test_a_wrong_token_is_refused_with_the_reason(token: str) -> None:
    async with served() as url, browser(url, token=token) as socket:
        with pytest.raises(ConnectionClosed, match=f"{WRONG_TOKEN}.*token"):
            await socket.recv()


def test_a_file_leads_a_browser_to_the_page_and_hides_its_token_from_others(tmp_path: Path) -> None:
    path = redirect_file(tmp_path, 'http://localhost:1/?a&b#"token"')
    assert path.read_text(encoding="utf-8").count("http://localhost:1/?a&amp;b#&quot;token&quot;") == 2
    assert path.stat().st_mode & 0o777 == 0o600


async def test_a_port_in_use_is_an_error_that_names_another() -> None:
    async with served() as url:
        port = urlsplit(url).port
        with pytest.raises(CallError, match=rf"127.0.0.1:{port}.*in use.*--listen 127.0.0.1:0 takes any free port"):
            await PageServer(ListenAddress("127.0.0.1", port), {}).serving().__aenter__()


def message(topic: str, seq: int, boot: str = "one", **fields: Any) -> list[bytes]:
    return [topic.encode(), encode({"v": 1, "seq": seq, "boot": boot, "t_ns": 1} | fields)]


FIRST = [message("slip.left", 1), message("status", 1)]
AGAIN = message("slip.left", 3)
UNREADABLE = [[b"slip.left", b"\xc1"], [b"warning"], [*message("status", 1), b""], message("grasp", 1, v=2)]
BAD = "unsupported_version: v: the version of the API must be 1, got 2"
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
    bad = BAD if ticks[0][1] is UNREADABLE else ""
    assert (newest.bad_reason, frame["bad"], frame["changes"]) == (bad, bad, [])


async def until(condition: Callable[[], Any]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # noqa: ASYNC110 - nothing reports it
            await asyncio.sleep(0.01)


@asynccontextmanager
async def viewing(publish: str, requests: PageRequests | None = None) -> AsyncIterator[tuple[LiveFeed, str]]:
    """A feed, and the address of its page."""
    feed = LiveFeed(publish, requests)
    running = asyncio.create_task(feed.run())
    async with PageServer(LOOPBACK, {}, feed.view).serving() as url:
        yield feed, url
    running.cancel()
    with suppress(asyncio.CancelledError):
        await running


async def newest_seq(socket: ClientConnection, topic: str, seq: int) -> dict[str, Any]:
    """Ask for frames until one has this message; return its topics."""
    while True:
        await socket.send("next")
        topics: dict[str, Any] = await reply(socket, "topics")
        if topics.get(topic, {}).get("seq") == seq:
            return topics


async def test_the_daemon_is_asked_for_messages_only_while_somebody_looks(publisher: Publisher) -> None:
    wanted = set(live_feed.TOPICS)
    async with viewing(publisher.endpoint) as (feed, url):
        async with browser(url) as first:
            await until(lambda: publisher.subscribed() == wanted)
            publisher.send("slip.left", 1)
            await newest_seq(first, "slip.left", 1)
            async with browser(url) as second:
                assert (await newest_seq(second, "slip.left", 1)).keys() == {"slip.left"}
            assert publisher.subscribed()
        await until(lambda: not feed.viewers and not publisher.subscribed())
        async with browser(url):
            await until(lambda: publisher.subscribed() == wanted)


async def test_a_browser_that_asks_for_nothing_delays_no_other_and_then_gets_the_newest(publisher: Publisher) -> None:
    async with viewing(publisher.endpoint) as (_, url), browser(url) as slow, browser(url) as quick:
        await until(lambda: publisher.subscribed() == set(live_feed.TOPICS))
        publisher.send("warning", 0)
        for seq in range(1, 8):
            publisher.send("slip.left", seq)
            await newest_seq(quick, "slip.left", seq)
        await slow.send("next")
        found = json.loads(await slow.recv())
        assert (found["topics"]["slip.left"]["seq"], [change["seq"] for change in found["changes"]]) == (7, [0])


async def test_too_many_browsers_are_refused(publish: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_feed, "VIEWERS", 1)
    async with viewing(publish) as (_, url), browser(url) as first:
        await first.send("next")
        await reply(first, "topics")
        async with browser(url) as second:
            await second.wait_closed()
            assert (second.close_code, second.close_reason) == (1013, "1 browsers look already")


async def test_frames_go_on_while_a_request_takes_its_time(publish: str, daemon: Daemon) -> None:
    tare = {"tare_id": 1, "finger": "left", "stream": "wrench", "taken_t_ns": 1, "readings": 9, "offset": [], "by": ""}
    daemon.handlers["tare"] = lambda _: {"finger": "left", "seconds": 1.0, "verified": True, "tare_ids": {"wrench": 0}}
    daemon.handlers["tare.get"] = lambda _: tare | {"busy": daemon.ops.count("tare.get") < 5}
    async with viewing(publish, PageRequests(daemon.endpoint)) as (_, url), browser(url) as socket:
        assert await reply(socket, "permission") == ""
        for _ in range(2):
            await socket.send('{"do": "tare", "finger": "left"}')
        assert await reply(socket, "reply") == {
            "ok": False,
            "text": "busy: the request before it is not answered yet",
        }
        await socket.send("next")
        assert await reply(socket, "topics") == {}
        await until(lambda: daemon.ops.count("tare.get") >= 5)
    assert daemon.ops.count("tare") == 1


@asynccontextmanager
async def opened(capsys: pytest.CaptureFixture[str], *arguments: Any, **options: Any) -> AsyncIterator[tuple[str, str]]:
    """Yield address and warnings of ``slipctl view`` while it runs."""
    task = asyncio.ensure_future(view(*arguments, **options))
    said, warned = "", ""
    async with asyncio.timeout(PATIENCE_S):
        while "view: " not in said:
            await asyncio.sleep(0.01)
            said, warned = capsys.readouterr()
    address = urlsplit(said.partition("view: ")[2].strip())
    yield f"http://127.0.0.1:{address.port}/#{address.fragment}", warned
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


@pytest.mark.usefixtures("no_patience")
@pytest.mark.parametrize(
    ("listen", "buttons", "allowed"),
    [
        ("127.0.0.1:0", None, True),
        ("localhost:0", None, True),
        ("0.0.0.0:0", None, False),
        ("0.0.0.0:0", True, True),
        ("127.0.0.1:0", False, False),
    ],
)
async def test_buttons_are_for_this_machine_only_unless_they_are_asked_for(
    listen: str, buttons: bool | None, allowed: bool, requests: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options: dict[str, Any] = {"buttons": buttons, "commission": CommissionPage(None)}
    async with opened(capsys, requests, requests, parse_listen(listen), **options) as (url, _):
        _, settings, _ = await get(url, "/settings.json", Authorization=bearer(url))
        assert json.loads(settings)["buttons"] is allowed
        async with browser(url) as socket:
            await socket.send(json.dumps({"do": "adjust", "delta_n": 1.0}))
            said = (await reply(socket, "reply"))["text"]
            assert ("takes no requests" in said, "nobody accepts requests" in said) == (not allowed, allowed)
        with suppress(*[] if allowed else [InvalidStatus]):
            async with browser(url, "/commission-guide") as guide:
                assert allowed
                await reply(guide, "unavailable")


async def test_pads_are_pressed_only_on_a_page_with_buttons_and_an_emulation_that_is_not_there_yet_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for listen, buttons in (("0.0.0.0:0", None), ("127.0.0.1:0", False)):
        with pytest.raises(CallError, match="--emulation needs a page with buttons"):
            await view(None, None, parse_listen(listen), buttons=buttons, emulation=tmp_path)
    async with opened(capsys, None, None, LOOPBACK, emulation=tmp_path) as (_, warned):
        assert warned == f"no emulation runs in {tmp_path} yet: slipd emulate CONFIG --dir {tmp_path}\n"
