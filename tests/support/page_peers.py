"""A browser's side of the page: its WebSockets, and what arrives on them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import urlsplit

from client_peers import PATIENCE_S
from websockets.asyncio.client import ClientConnection, connect


@asynccontextmanager
async def browser(url: str, path: str = "/live", **different: str | None) -> AsyncIterator[ClientConnection]:
    """Open a WebSocket of the page at this address with its token; ``different``: another token or origin."""
    where = urlsplit(url)
    origin: Any = different.get("origin", f"http://{where.netloc}")
    async with connect(f"ws://{where.netloc}{path}", origin=origin) as socket:
        await socket.send(different.get("token", where.fragment))
        yield socket


async def reply(socket: ClientConnection, kind: str) -> Any:
    """Wait for a message with this key, and return its value."""
    while True:
        found = json.loads(await asyncio.wait_for(socket.recv(), PATIENCE_S))
        if kind in found:
            return found[kind]
