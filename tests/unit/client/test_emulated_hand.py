"""Touches of the page on an emulation: what is passed on, and what a browser hears while it runs, hangs and ends."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from slipd_client.page import requests_of_page
from slipd_client.page.requests_of_page import SOCKET, EmulatedHand

PATIENCE_S = 60.0

PRESS: dict[str, Any] = {
    "finger": "left",
    "force_n": 5,
    "place_mm": [1, -2.5],
    "push_n": [0.5, 0],
    "twist_mnm": -10,
}


class Emulation:
    """The local socket of an emulation; ``answers`` maps the first word of a line to its answer, None: no answer."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.open = 0
        self.answers: dict[str, str | None] = {"show": "left: nothing touches\nright: nothing touches\nok\n"}

    async def serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.open += 1
        with contextlib.suppress(ConnectionError):
            while line := (await reader.readline()).decode().rstrip("\n"):
                self.lines.append(line)
                writer.write((self.answers.get(line.split()[0], "ok\n") or "").encode())
        writer.close()
        self.open -= 1


@asynccontextmanager
async def emulating(folder: Path) -> AsyncIterator[Emulation]:
    emulation = Emulation()
    server = await asyncio.start_unix_server(emulation.serve_client, folder / SOCKET)
    try:
        yield emulation
    finally:
        server.close()
        (folder / SOCKET).unlink()
        while emulation.open:  # noqa: ASYNC110 - until every connection has seen its end
            await asyncio.sleep(0.001)


class Browser:
    """What a browser is told of the hand."""

    def __init__(self) -> None:
        self.told: list[list[str]] = []

    async def send(self, text: str) -> None:
        self.told.append(json.loads(text)["hand"])


async def test_a_touch_is_a_press_with_push_and_twist_and_force_0_lets_go(tmp_path: Path) -> None:
    hand = EmulatedHand(tmp_path)
    async with emulating(tmp_path) as emulation:
        assert await hand.look() == ("left", "right")
        assert await hand.touch(json.dumps(PRESS)) == {"ok": True, "text": ""}
        assert await hand.touch(json.dumps(PRESS | {"force_n": 0})) == {"ok": True, "text": ""}
        press = "press left 5.000 N at 1.00 -2.50 mm in 0.1 s; push left 0.500 0.000 N; twist left -10.00 mNm"
        assert emulation.lines == ["show", press, "release left"]
        emulation.answers["press"] = "error: press: FORCE must be from 0 to 1000\n"
        reply = await hand.touch(json.dumps(PRESS | {"force_n": 1e6}))
        assert reply == {"ok": False, "text": "press: FORCE must be from 0 to 1000"}


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
async def test_nothing_else_is_passed_on(tmp_path: Path, touch: str) -> None:
    hand = EmulatedHand(tmp_path)
    async with emulating(tmp_path) as emulation:
        await hand.look()
        assert (await hand.touch(touch))["ok"] is False
    assert emulation.lines == ["show"]


async def test_a_browser_hears_of_emulations_that_begin_and_end_and_keeps_one_that_is_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests_of_page, "LOOK_S", 0.005)
    hand, browser = EmulatedHand(tmp_path), Browser()
    telling = asyncio.create_task(hand.tell(browser))  # type: ignore[arg-type]

    async def until(told: list[list[str]]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while browser.told != told:  # noqa: ASYNC110 - the hand decides when it looks
                await asyncio.sleep(0.005)

    both: list[str] = ["left", "right"]
    await until([[]])
    async with emulating(tmp_path):
        await until([[], both])
    await until([[], both, []])
    async with emulating(tmp_path) as emulation:
        await until([[], both, [], both])
        monkeypatch.setattr(requests_of_page, "ANSWER_S", 0.01)
        emulation.answers["press"] = emulation.answers["show"] = None
        reply = await hand.touch(json.dumps(PRESS))
        assert reply["text"].startswith("the emulation has ended, or does not answer")
        assert await hand.look() == ("left", "right"), "the page would forget place and focus"
        assert browser.told == [[], both, [], both]
    telling.cancel()
    await asyncio.gather(telling, return_exceptions=True)
