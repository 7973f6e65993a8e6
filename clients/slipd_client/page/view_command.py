"""``slipctl view``: shows a running slipd in a browser, and commissions it on the page ``/commission``.

The guide is that of the terminal, ``slipd commission``, in a process of its own: the client imports nothing of the
daemon. It is only run for the config that was named when the view was started.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import importlib.util
import json
import sys
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import cast

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError
from slipd_client.keys import Keys
from slipd_client.page.live_feed import LiveFeed
from slipd_client.page.page_server import PageServer
from slipd_client.page.requests_of_page import ADJUST_N, EmulatedHand, PageRequests
from slipd_client.paths import publish_endpoint

LONGEST_WORD = 100
"""Longest answer of a person."""

STDERR_BYTES = 10_000
"""Most that is kept of what the guide reports as an error."""

BUSY = "the guide is open in another window; close that first"
NO_SLIPD = "commissioning changes the config, so it needs the package slipd on the machine of this view"
NO_CONFIG = "this view was started without a config; start it with: slipctl view --config FILE"


class CommissionPage:
    """Serves the page to one browser at a time.

    Args:
        config: The config that the daemon runs; None: the page only says what is missing.
        arguments: More arguments of ``slipd commission``, such as endpoints.
    """

    def __init__(self, config: Path | None, arguments: Sequence[str] = ()) -> None:
        self._config = config
        self._arguments = arguments
        self._turn = asyncio.Lock()

    async def view(self, connection: ServerConnection) -> None:
        """Run the guide for one browser until it ends or the browser leaves."""
        missing = self._missing()
        with contextlib.suppress(ConnectionClosed):
            if missing or self._config is None:
                await connection.send(json.dumps({"unavailable": missing}))
                return
            async with self._turn, _guide(self._config, self._arguments) as guide:
                await _converse(connection, guide, self._config)

    def _missing(self) -> str:
        """Return why the guide cannot be run; "" if it can."""
        if importlib.util.find_spec("slipd") is None:
            return NO_SLIPD
        if self._config is None:
            return NO_CONFIG
        return BUSY if self._turn.locked() else ""


@contextlib.asynccontextmanager
async def _guide(config: Path, arguments: Sequence[str]) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run the guide until the block ends; it changes the config in one step, so it may be ended at any time."""
    pipe = asyncio.subprocess.PIPE
    command = [sys.executable, "-m", "slipd", "commission", str(config), "--page", *arguments]
    process = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe, stderr=pipe)
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def _converse(connection: ServerConnection, guide: asyncio.subprocess.Process, config: Path) -> None:
    """Pass on what the guide says, and what the person chooses, until one of them ends."""
    out, err = (cast("asyncio.StreamReader", stream) for stream in (guide.stdout, guide.stderr))
    await connection.send(json.dumps({"config": str(config)}))
    choosing = asyncio.create_task(_pass_choices(connection, guide))
    errors = asyncio.create_task(_read_end(err))
    try:
        async for line in out:
            if line.startswith(b"{"):
                await connection.send(line.decode())
        ended = {"code": await guide.wait(), "error": (await errors).decode(errors="replace").strip()}
        await connection.send(json.dumps({"ended": ended}))
    finally:
        for task in (choosing, errors):
            task.cancel()
        await asyncio.gather(choosing, errors, return_exceptions=True)


async def _read_end(stream: asyncio.StreamReader) -> bytes:
    """Read all of a stream; return its last STDERR_BYTES, since the error of a guide follows its log."""
    kept = b""
    while piece := await stream.read(STDERR_BYTES):
        kept = (kept + piece)[-STDERR_BYTES:]
    return kept


async def _pass_choices(connection: ServerConnection, guide: asyncio.subprocess.Process) -> None:
    """Give the guide each word that the person chooses; end it when the browser leaves."""
    stdin = cast("asyncio.StreamWriter", guide.stdin)
    async for text in connection:
        try:
            word = json.loads(text)["choose"]
        except (ValueError, TypeError, KeyError, RecursionError):
            continue
        if isinstance(word, str) and word.isprintable() and len(word) <= LONGEST_WORD:
            stdin.write(f"{word}\n".encode())
    with contextlib.suppress(ProcessLookupError):
        guide.terminate()


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command until interrupted.

    Raises:
        CallError: The config is missing; see `view`.
    """
    if chosen.config is not None and not chosen.config.is_file():
        raise CallError(f"{chosen.config}: there is no such file")
    named = {"--publish": chosen.publish, "--requests": chosen.requests}
    named |= {"--key": chosen.key, "--server-key": chosen.server_key}
    guide = CommissionPage(chosen.config, [part for each in named.items() if each[1] is not None for part in each])
    options = {"keys": keys, "buttons": chosen.buttons, "emulation": chosen.emulation, "commission": guide}
    asyncio.run(view(chosen.publish, chosen.requests, chosen.listen, **options))


async def view(
    publish: str | None,
    requests: str | None,
    address: ListenAddress,
    *,
    keys: Keys | None = None,
    buttons: bool | None = None,
    emulation: Path | None = None,
    commission: CommissionPage | None = None,
) -> None:
    """Serve the page of a running slipd until the task is cancelled, and print its address.

    Args:
        publish: Endpoint on which slipd publishes; its default when None.
        requests: Endpoint on which it accepts requests, likewise.
        address: Where to serve the page.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        buttons: The page may request; None: only where no other machine can open it.
        emulation: Folder of a running ``slipd emulate``, whose pads can be pressed on the page; None: no pad can.
        commission: Serves the page ``/commission``; None: the live view has no such page.

    Raises:
        CallError: An endpoint is wrong, the port cannot be opened, or a page without buttons is to press pads.
    """
    allowed = address.loopback if buttons is None else buttons
    if emulation is not None and not allowed:
        raise CallError("--emulation needs a page with buttons: add --buttons, or serve it on this machine only")
    where = publish_endpoint() if publish is None else publish
    hand = None if emulation is None else EmulatedHand(emulation)
    feed = LiveFeed(where, PageRequests(requests, keys) if allowed else None, keys, hand)
    guide = commission.view if commission is not None and allowed else None
    settings: dict[str, object] = {"live": True, "source": where, "buttons": allowed, "adjust_n": ADJUST_N}
    async with PageServer(address, settings, feed.view, on_commission=guide).serving() as url:
        print(f"view: {url}", flush=True)
        if hand is not None and not hand.path.exists():
            print(f"no emulation runs in {emulation} yet: slipd emulate CONFIG --dir {emulation}", file=sys.stderr)
        await feed.run()
