"""The page /commission: what a browser hears where the guide cannot run, and from a guide that ends."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import ClientConnection, connect

from slipd_client.arguments import ListenAddress
from slipd_client.page import view_command
from slipd_client.page.page_server import COMMISSION_PATH, PageServer, Site
from slipd_client.page.view_command import CommissionPage

PATIENCE_S = 60.0


@asynccontextmanager
async def served(page: CommissionPage) -> AsyncIterator[str]:
    server = PageServer(ListenAddress("127.0.0.1", 0), Site({}), on_commission=page.view)
    async with server.serving() as url:
        yield url


@asynccontextmanager
async def browser(url: str) -> AsyncIterator[ClientConnection]:
    where = urlsplit(url)
    async with connect(f"ws://{where.netloc}{COMMISSION_PATH}", origin=f"http://{where.netloc}") as socket:  # type: ignore[arg-type]
        await socket.send(where.fragment)
        yield socket


async def heard(socket: ClientConnection) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(await asyncio.wait_for(socket.recv(), PATIENCE_S))
    return found


async def test_a_machine_without_slipd_says_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view_command.importlib.util, "find_spec", lambda _: None)
    async with served(CommissionPage(Path("rig.toml"))) as url, browser(url) as socket:
        assert await heard(socket) == {"unavailable": view_command.NO_SLIPD}


async def test_a_view_without_a_config_says_how_to_start_it() -> None:
    async with served(CommissionPage(None)) as url, browser(url) as socket:
        assert await heard(socket) == {"unavailable": view_command.NO_CONFIG}


async def test_a_config_with_faults_ends_the_guide_with_the_reason_and_one_window_runs_it(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("[finger.left]\nmu = -1\n", encoding="utf-8")
    async with served(CommissionPage(file)) as url, browser(url) as socket:
        assert await heard(socket) == {"config": str(file)}
        async with browser(url) as second:
            assert await heard(second) == {"unavailable": view_command.BUSY}
        for text in ("skip", "[]", "[" * 4000, "{}", '{"choose": 1}', '{"choose": "a\\nb"}', '{"choose": "skip"}'):
            await socket.send(text)
        ended = (await heard(socket))["ended"]
        assert ended["code"] != 0
        assert "finger.left.mu" in ended["error"]


async def test_the_error_of_a_guide_is_not_hidden_by_its_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    guide = tmp_path / "guide"
    guide.write_text("#!/bin/sh\necho log >&2; sleep 0.1; yes log | head -n 50000 >&2; echo the reason >&2; exit 1\n")
    guide.chmod(0o700)
    monkeypatch.setattr(view_command.sys, "executable", str(guide))
    async with served(CommissionPage(tmp_path / "rig.toml")) as url, browser(url) as socket:
        assert "config" in await heard(socket)
        ended = (await heard(socket))["ended"]
    assert ended["code"] == 1
    assert ended["error"].endswith("log\nthe reason")
    assert len(ended["error"]) <= view_command.STDERR_BYTES
