"""What people may do on the page: requests, touches of an emulation, and the guide of /commission."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from client_peers import PATIENCE_S, Daemon, refuse
from page_peers import browser, reply
from websockets.exceptions import ConnectionClosed

from slipd_client.arguments import ListenAddress
from slipd_client.page import requests_of_page, view_command
from slipd_client.page.page_server import COMMISSION_PATH, PageServer
from slipd_client.page.requests_of_page import SOCKET, EmulatedHand, PageRequests
from slipd_client.page.view_command import CommissionPage
from slipd_client.slipctl_parser import parser


@pytest.mark.parametrize(
    ("answers", "text", "reply", "asked"),
    [
        (
            {"grip.adjust": lambda request: {"applied_n": 11.0 + request["delta_n"]}},
            '{"do": "adjust", "delta_n": -1}',
            {"ok": True, "text": "grip force -1 N: the gripper was sent 10.0 N on each pad"},
            ["lease.acquire", "grip.adjust", "lease.release"],
        ),
        (
            {
                "tare": lambda _: {
                    "finger": "left",
                    "seconds": 0.01,
                    "verified": False,
                    "tare_id": 3,
                    "tare_ids": {"wrench": 3},
                },
                "tare.get": lambda _: {"tare_id": 4, "busy": False, "finger": "left", "stream": "wrench"},
            },
            '{"do": "tare", "finger": "left"}',
            {
                "ok": True,
                "text": "left: zero taken of wrench (tare 4); "
                "the daemon does not know whether anything touched the finger",
            },
            ["tare", "tare.get"],
        ),
        (
            {"lease.acquire": refuse("lease_held", "another client holds the lease")},
            '{"do": "adjust", "delta_n": 1}',
            {"ok": False, "text": "lease_held: another client holds the lease"},
            ["lease.acquire"],
        ),
    ],
)
async def test_a_request_is_carried_out_and_its_reply_is_in_words(
    daemon: Daemon, answers: dict[str, Any], text: str, reply: dict[str, Any], asked: list[str]
) -> None:
    daemon.handlers |= answers
    assert await PageRequests(daemon.endpoint).carry_out(text) == reply
    assert daemon.asked_ops == asked


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "[" * 4000,
        "1",
        "{}",
        '{"do": "gripper.open"}',
        '{"do": "adjust"}',
        '{"do": "adjust", "delta_n": 2}',
        '{"do": "adjust", "delta_n": "1"}',
        '{"do": "adjust", "delta_n": NaN}',
        '{"do": "adjust", "delta_n": [1]}',
        '{"do": "tare"}',
        '{"do": "tare", "finger": 1}',
        '{"do": ["tare"], "finger": "left"}',
    ],
)
async def test_a_page_can_request_nothing_else(text: str, daemon: Daemon) -> None:
    assert (await PageRequests(daemon.endpoint).carry_out(text))["ok"] is False
    assert daemon.ops == []


async def test_a_key_that_may_only_read_is_known_before_the_first_request(daemon: Daemon) -> None:
    requests = PageRequests(daemon.endpoint)
    assert await requests.permission() == ""
    daemon.handlers["hello"] = refuse("read_only", "this key may read but not request")
    assert await requests.permission() == "read_only: this key may read but not request"


@pytest.mark.usefixtures("no_patience")
async def test_without_a_daemon_a_request_says_so(requests: str) -> None:
    page = PageRequests(requests)
    assert await page.permission() == ""
    said = await page.carry_out('{"do": "tare", "finger": "left"}')
    assert (said["ok"], "Is slipd running?" in said["text"]) == (False, True)


PRESS: dict[str, Any] = {
    "finger": "left",
    "force_n": 5,
    "place_mm": [1, -2.5],
    "push_n": [0.5, 0],
    "twist_mnm": -10,
}


class Emulation:
    """The local socket of an emulation; ``answers`` maps the first word of a line to its answer, "": no answer."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.open = 0
        self.answers = {"show": "left: nothing touches\nright: nothing touches\nok\n"}

    async def serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.open += 1
        with suppress(ConnectionError):
            while line := (await reader.readline()).decode().rstrip("\n"):
                self.lines.append(line)
                writer.write(self.answers.get(line.split()[0], "ok\n").encode())
        writer.close()
        self.open -= 1


@asynccontextmanager
async def emulating(folder: Path) -> AsyncIterator[Emulation]:
    emulation = Emulation()
    server = await asyncio.start_unix_server(emulation.serve_client, folder / SOCKET)
    yield emulation
    server.close()
    (folder / SOCKET).unlink()
    while emulation.open:  # noqa: ASYNC110 - until every connection has seen its end
        await asyncio.sleep(0.001)


async def test_a_touch_is_a_press_with_push_and_twist_and_force_0_lets_go(tmp_path: Path) -> None:
    hand = EmulatedHand(tmp_path)
    async with emulating(tmp_path) as emulation:
        assert await hand.find_fingers() == ("left", "right")
        for touch in (PRESS, PRESS | {"force_n": 0}):
            assert await hand.touch(json.dumps(touch)) == {"ok": True, "text": ""}
        assert emulation.lines == [
            "show",
            "press left 5.000 N at 1.00 -2.50 mm in 0.1 s; push left 0.500 0.000 N; twist left -10.00 mNm",
            "release left",
        ]
        emulation.answers["press"] = "error: press: FORCE must be from 0 to 1000\n"
        assert await hand.touch(json.dumps(PRESS | {"force_n": 1e6})) == {
            "ok": False,
            "text": "press: FORCE must be from 0 to 1000",
        }


@pytest.mark.parametrize(
    "touch",
    [
        "",
        "[]",
        "[" * 4000,
        "{}",
        '{"finger": "left"}',
        json.dumps(PRESS | {"finger": "left 5 N; quit"}),
        json.dumps(PRESS | {"finger": ["left"]}),
        json.dumps(PRESS | {"force_n": "5; quit"}),
        json.dumps(PRESS | {"force_n": float("nan")}),
        json.dumps(PRESS | {"force_n": 10**400}),
        json.dumps(PRESS | {"place_mm": [1]}),
        json.dumps(PRESS | {"place_mm": 1}),
        json.dumps(PRESS | {"push_n": [None, 0]}),
    ],
)
async def test_no_other_touch_is_passed_on(tmp_path: Path, touch: str) -> None:
    hand = EmulatedHand(tmp_path)
    async with emulating(tmp_path) as emulation:
        await hand.find_fingers()
        assert (await hand.touch(touch))["ok"] is False
    assert emulation.lines == ["show"]


async def test_a_browser_hears_of_emulations_that_begin_and_end_and_keeps_one_that_is_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests_of_page, "LOOK_S", 0.005)
    hand, page = EmulatedHand(tmp_path), asyncio.Queue()
    sending = asyncio.create_task(hand.send_fingers(SimpleNamespace(send=page.put)))  # type: ignore[arg-type]

    async def sent() -> Any:
        return json.loads(await asyncio.wait_for(page.get(), PATIENCE_S))["hand"]

    assert await sent() == []
    async with emulating(tmp_path):
        assert await sent() == ["left", "right"]
    assert await sent() == []
    async with emulating(tmp_path) as emulation:
        assert await sent() == ["left", "right"]
        monkeypatch.setattr(requests_of_page, "ANSWER_S", 0.01)
        emulation.answers |= {"press": "", "show": ""}
        assert "has ended, or does not answer" in (await hand.touch(json.dumps(PRESS)))["text"]
        assert await hand.find_fingers() == ("left", "right"), "the page would forget place and focus"
    assert await sent() == [], "and nothing before it ended"
    sending.cancel()
    await asyncio.gather(sending, return_exceptions=True)


def test_the_guide_is_started_with_the_endpoints_and_keys_of_the_view(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[Sequence[str]] = []

    async def show(*_: Any, commission: CommissionPage, **__: Any) -> None:
        started.append(commission._arguments)

    monkeypatch.setattr(view_command, "view", show)
    (tmp_path / "rig.toml").touch()
    words = ["--publish", "ipc:///p", "--requests", "ipc:///r", "--key", "me.key_secret", "--server-key", "slipd.key"]
    for given in (words, words[2:4]):
        view_command.run(parser().parse_args(["view", "--config", str(tmp_path / "rig.toml"), *given]), None)
    assert started == [words, words[2:4]]


@asynccontextmanager
async def guiding(config: Path | None) -> AsyncIterator[str]:
    server = PageServer(ListenAddress("127.0.0.1", 0), {}, on_commission=CommissionPage(config).view)
    async with server.serving() as url:
        yield url


@pytest.mark.parametrize(
    ("config", "installed", "why"),
    [(Path("rig.toml"), None, view_command.NO_SLIPD), (None, True, view_command.NO_CONFIG)],
)
async def test_a_guide_that_cannot_run_says_what_is_needed(
    config: Path | None, installed: bool | None, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_command.importlib.util, "find_spec", lambda _: installed)
    async with guiding(config) as url, browser(url, COMMISSION_PATH) as socket:
        assert await reply(socket, "unavailable") == why


async def test_a_config_with_faults_ends_the_guide_with_the_reason_and_one_window_runs_it(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("[finger.left]\nmu = -1\n", encoding="utf-8")
    async with guiding(file) as url, browser(url, COMMISSION_PATH) as socket:
        assert await reply(socket, "config") == str(file)
        async with browser(url, COMMISSION_PATH) as second:
            assert await reply(second, "unavailable") == view_command.BUSY
        for text in ("skip", "[]", "[" * 4000, "{}", '{"choose": 1}', '{"choose": "a\\nb"}', '{"choose": "skip"}'):
            await socket.send(text)
        ended = await reply(socket, "ended")
        assert (ended["code"] != 0, "finger.left.mu" in ended["error"]) == (True, True)


def guide_by(lines: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run these lines of a shell in the place of the guide."""
    (folder / "guide").write_text(f"#!/bin/sh\n{lines}\n")
    (folder / "guide").chmod(0o700)
    monkeypatch.setattr(view_command.sys, "executable", str(folder / "guide"))


async def test_the_error_of_a_guide_is_not_hidden_by_its_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    guide_by("echo log >&2; sleep 0.1; yes log | head -n 50000 >&2; echo the reason >&2; exit 1", tmp_path, monkeypatch)
    async with guiding(tmp_path / "rig.toml") as url, browser(url, COMMISSION_PATH) as socket:
        ended = await reply(socket, "ended")
    assert (ended["code"], ended["error"][-14:]) == (1, "log\nthe reason")
    assert len(ended["error"]) <= view_command.STDERR_BYTES


async def test_a_guide_hears_each_word_of_at_most_100_letters_and_ends_when_the_window_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    guide_by("""echo no JSON; while read -r word; do echo "{\\"heard\\": \\"$word\\"}"; done""", tmp_path, monkeypatch)
    async with guiding(tmp_path / "rig.toml") as url:
        for word in ("left", "x" * 100):
            heard = None
            while heard is None:
                async with browser(url, COMMISSION_PATH) as socket:
                    with suppress(ConnectionClosed):  # the window before is not quite closed
                        for said in ("x" * 101, word):
                            await socket.send(json.dumps({"choose": said}))
                        heard = await reply(socket, "heard")
            assert heard == word
