"""Touches of the page on an emulation: what is passed on, and what a browser hears while it runs, hangs and ends."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from slipd_client.page import emulated_hand
from slipd_client.page.emulated_hand import SOCKET, EmulatedHand

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
        self.answers: dict[str, str | None] = {"show": "left: nothing touches\nright: nothing touches\nok\n"}

    async def serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while line := (await reader.readline()).decode().rstrip("\n"):
                self.lines.append(line)
                writer.write((self.answers.get(line.split()[0], "ok\n") or "").encode())
        writer.close()


@asynccontextmanager
async def emulating(folder: Path) -> AsyncIterator[Emulation]:
    emulation = Emulation()
    clients: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        clients.append(writer)
        await emulation.serve_client(reader, writer)

    server = await asyncio.start_unix_server(serve, folder / SOCKET)
    try:
        yield emulation
    finally:
        server.close()
        for writer in clients:
            writer.close()
        (folder / SOCKET).unlink()
        await asyncio.sleep(0)


@asynccontextmanager
async def following(folder: Path) -> AsyncIterator[EmulatedHand]:
    hand = EmulatedHand(folder)
    running = asyncio.create_task(hand.run())
    try:
        yield hand
    finally:
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(emulated_hand, "LOOK_S", 0.005)


async def until(condition: Callable[[], bool]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s
        await asyncio.sleep(0.005)


async def test_a_touch_is_a_press_with_push_and_twist_and_force_0_lets_go(tmp_path: Path) -> None:
    async with emulating(tmp_path) as emulation, following(tmp_path) as hand:
        await until(lambda: hand.fingers == ("left", "right"))
        assert await hand.touch(json.dumps(PRESS)) == {"ok": True, "text": ""}
        assert await hand.touch(json.dumps(PRESS | {"force_n": 0})) == {"ok": True, "text": ""}
    press = "press left 5.000 N at 1.00 -2.50 mm in 0.1 s; push left 0.500 0.000 N; twist left -10.00 mNm"
    assert emulation.lines == ["show", press, "release left"]


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
    async with emulating(tmp_path) as emulation, following(tmp_path) as hand:
        await until(lambda: hand.fingers != ())
        assert (await hand.touch(touch))["ok"] is False
    assert emulation.lines == ["show"]


async def test_a_refusal_is_shown_in_the_words_of_the_emulation(tmp_path: Path) -> None:
    async with emulating(tmp_path) as emulation, following(tmp_path) as hand:
        await until(lambda: hand.fingers != ())
        emulation.answers["press"] = "error: press: FORCE must be from 0 to 1000\n"
        reply = await hand.touch(json.dumps(PRESS | {"force_n": 1e6}))
    assert reply == {"ok": False, "text": "press: FORCE must be from 0 to 1000"}


async def test_an_emulation_that_ends_leaves_no_finger_and_the_next_one_is_found(tmp_path: Path) -> None:
    async with following(tmp_path) as hand:
        async with emulating(tmp_path):
            await until(lambda: hand.fingers != ())
        await until(lambda: hand.fingers == ())
        assert (await hand.touch(json.dumps(PRESS)))["ok"] is False
        async with emulating(tmp_path):
            await until(lambda: hand.fingers != ())


async def test_an_emulation_that_does_not_answer_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with emulating(tmp_path) as emulation, following(tmp_path) as hand:
        await until(lambda: hand.fingers != ())
        monkeypatch.setattr(emulated_hand, "ANSWER_S", 0.01)
        emulation.answers["press"] = emulation.answers["show"] = None
        reply = await hand.touch(json.dumps(PRESS))
        assert reply["text"].startswith("the emulation has ended, or does not answer")
        await until(lambda: hand.fingers == ())
