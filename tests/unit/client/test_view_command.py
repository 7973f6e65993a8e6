"""Who may press the buttons of the page: ``slipctl view`` on this machine only, unless somebody says otherwise."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from slipd_client.arguments import parse_listen
from slipd_client.errors import CallError
from slipd_client.page.view_command import CommissionPage, view

PATIENCE_S = 60.0


@asynccontextmanager
async def opened(viewing: Awaitable[None], capsys: pytest.CaptureFixture[str]) -> AsyncIterator[tuple[str, str, str]]:
    """Yield port, token and warnings of a view that runs while the block does."""
    task = asyncio.ensure_future(viewing)
    said, warned = "", ""
    async with asyncio.timeout(PATIENCE_S):
        while "view: " not in said:
            await asyncio.sleep(0.01)
            said, warned = capsys.readouterr()
    url = urlsplit(said.partition("view: ")[2].strip())
    try:
        yield str(url.port), url.fragment, warned
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def settings(port: str, token: str) -> dict[str, Any]:
    request = Request(f"http://127.0.0.1:{port}/settings.json", headers={"Authorization": f"Bearer {token}"})
    with urlopen(request) as answer:
        found: dict[str, Any] = json.load(answer)
    return found


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
    listen: str, buttons: bool | None, allowed: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    endpoint = f"ipc://{tmp_path}/nobody"
    options: dict[str, Any] = {"buttons": buttons, "commission": CommissionPage(None)}
    async with opened(view(endpoint, endpoint, parse_listen(listen), **options), capsys) as (port, token, _):
        assert (await asyncio.to_thread(settings, port, token))["buttons"] is allowed
        page = f"http://127.0.0.1:{port}"
        async with connect(f"ws://127.0.0.1:{port}/live", origin=page) as browser:
            await browser.send(token)
            await browser.send(json.dumps({"do": "adjust", "delta_n": 1.0}))
            replies = [json.loads(await browser.recv())]
            while "reply" not in replies[-1]:
                replies.append(json.loads(await browser.recv()))
            assert ("only shows" in replies[-1]["reply"]["text"]) is not allowed
            assert ("nobody accepts requests" in replies[-1]["reply"]["text"]) is allowed
        guide = connect(f"ws://127.0.0.1:{port}/commission-guide", origin=page)
        if allowed:
            async with guide as browser:
                await browser.send(token)
                assert "unavailable" in json.loads(await browser.recv())
        else:
            with pytest.raises(InvalidStatus, match="404"):
                await guide


@pytest.mark.parametrize(("listen", "buttons"), [("0.0.0.0:0", None), ("127.0.0.1:0", False)])
async def test_pads_are_pressed_only_on_a_page_with_buttons(listen: str, buttons: bool | None, tmp_path: Path) -> None:
    with pytest.raises(CallError, match="--emulation needs a page with buttons"):
        await view(None, None, parse_listen(listen), buttons=buttons, emulation=tmp_path)


async def test_an_emulation_that_is_not_there_yet_is_named_with_its_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async with opened(view(None, None, parse_listen("127.0.0.1:0"), emulation=tmp_path), capsys) as (_, _, warned):
        assert warned == f"no emulation runs in {tmp_path} yet: slipd emulate CONFIG --dir {tmp_path}\n"
