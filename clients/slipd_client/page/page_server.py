"""Serves the page, and one WebSocket to each browser that shows it.

Three locks keep others out. ``Host`` must be an address or a name of this machine, against DNS rebinding. ``Origin``
must be the page itself, against pages of other sites. And every message, recording and request needs the token of this
start, which is only in the address that was printed: any user of the machine can connect to a port of 127.0.0.1.
Without it one gets the files of the page, which are the same everywhere, and nothing of what it shows.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import logging
import os
import re
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable
from html import escape
from http import HTTPStatus
from pathlib import Path
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError
from slipd_client.messages.names import (
    EVIDENCE,
    HEALTH,
    IMAGE_REASONS,
    LEVEL_MEANINGS,
    LEVELS,
    REASONS,
)

ASSETS = Path(__file__).with_name("assets")

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
"""Kinds of files that are served; no other file of the folder is."""

_HEADS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""The page loads nothing from elsewhere, and no other site may embed it or read it."""


_WORDS = {
    "levels": LEVELS,
    "level_meanings": LEVEL_MEANINGS,
    "reasons": REASONS,
    "evidence": EVIDENCE,
    "image_reasons": IMAGE_REASONS,
    "health": HEALTH,
}
"""Every word of the wire that the page explains."""


def answer(
    status: HTTPStatus, body: bytes, kind: str = "text/plain; charset=utf-8", encoding: str | None = None
) -> Response:
    """Return a whole answer."""
    heads = Headers(_HEADS | {"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"})
    if encoding is not None:
        heads["Content-Encoding"] = encoding
    return Response(status.value, status.phrase, heads, body)


def refusal(status: HTTPStatus, why: str) -> Response:
    """Return an answer that says why a request is refused."""
    return answer(status, f"{why}\n".encode())


def json_answer(value: object) -> Response:
    """Return a value as JSON."""
    return answer(HTTPStatus.OK, json.dumps(value).encode(), "application/json")


_TEXT = """\
<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={url}">
<title>slipd</title>
<a href="{url}">The live view of slipd</a>
"""


def redirect_file(folder: Path, url: str) -> Path:
    """Write a file that leads a browser to ``url``, and return its path.

    Raises:
        OSError: The file exists already, or cannot be written.
    """
    path = folder / "view.html"
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(_TEXT.format(url=escape(url)))
    return path


LIVE_PATH, COMMISSION_PATH, SETTINGS_PATH = "/live", "/commission-guide", "/settings.json"

TOKEN_S = 5.0
"""How long a WebSocket may take to send the token."""

CLOSE_S = 1.0
"""How long a browser may take to close its WebSocket."""

MESSAGE_BYTES = 4096
"""Longest message from a page."""

WRONG_TOKEN = 4403
"""Close code of a WebSocket whose token is not that of this start."""

_ORIGIN = re.compile(r"https?://[^/\s]+")

_LOG = logging.getLogger("slipd_client.page")
_LOG.setLevel(logging.CRITICAL)  # a browser that breaks off is no matter of the log

OnViewer = Callable[[ServerConnection], Awaitable[None]]
"""Serves one browser until it leaves."""

OnData = Callable[[str], Response | None]
"""Returns the answer to the path of a request for data; None for a path that does not exist."""


class PageServer:
    """The server of one page.

    Args:
        address: Where to listen.
        settings: What the page must know before its first message; it names the source, so it needs the token.
        on_viewer: Serves the WebSocket of a browser; None if the page opens no WebSocket.
        on_commission: Serves the WebSocket of the page ``/commission``; None: the server has no such page.
        on_data: Answers requests for data below ``/data/``; None if the page requests no data.
        start: The file that ``/`` serves.

    Attributes:
        token: What a browser must know to see or request anything; new for each server.
    """

    def __init__(
        self,
        address: ListenAddress,
        settings: dict[str, object],
        on_viewer: OnViewer | None = None,
        on_data: OnData | None = None,
        on_commission: OnViewer | None = None,
        start: str = "index.html",
    ) -> None:
        self.token = secrets.token_urlsafe(16)
        self._address = address
        self._settings = settings | {"words": _WORDS}
        self._files = {
            f"/{path.relative_to(ASSETS).as_posix()}": (path.read_bytes(), f"{_TYPES[path.suffix]}; charset=utf-8")
            for path in sorted(ASSETS.rglob("*"))
            if path.suffix in _TYPES
        }
        self._files |= {"/": self._files[f"/{start}"], "/commission": self._files["/commission.html"]}
        self._on_viewer = {LIVE_PATH: on_viewer, COMMISSION_PATH: on_commission}
        self._on_data = on_data

    @contextlib.asynccontextmanager
    async def serving(self) -> AsyncIterator[str]:
        """Serve while the block runs; yield the address for a browser, with the token.

        Raises:
            CallError: The port cannot be opened.
        """
        host, port = self._address.host, self._address.port
        try:
            server = await serve(
                self._view,
                host,
                port,
                origins=[_ORIGIN],  # one that must be stated; `_request` compares it with Host
                process_request=self._request,
                max_size=MESSAGE_BYTES,
                max_queue=4,
                close_timeout=CLOSE_S,
                compression=None,
                server_header=None,
                logger=_LOG,
            )
        except OSError as error:
            hint = f"; --listen {host}:0 takes any free port" if port else ""
            raise CallError(f"the page cannot be served on {host}:{port}: {error.strerror or error}{hint}") from error
        async with server:
            opened = next(iter(server.sockets)).getsockname()[1]
            yield f"{self._address.url(opened)}#{self.token}"

    def _request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file or for data; None lets the handshake of a WebSocket go on."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or not self._address.allows(hosts[0]):
            return refusal(HTTPStatus.FORBIDDEN, "Host must be an IP address or the name of this machine")
        if origins and [urlsplit(origin).netloc for origin in origins] != hosts:
            return refusal(HTTPStatus.FORBIDDEN, "Origin must be the page itself")
        path = request.path.partition("?")[0]
        if self._on_viewer.get(path) is not None:
            return None if origins else refusal(HTTPStatus.FORBIDDEN, "a WebSocket must state its Origin")
        if path in self._files:
            return answer(HTTPStatus.OK, *self._files[path])
        found = self._private(path, request.headers.get("Authorization", ""))
        return found or refusal(HTTPStatus.NOT_FOUND, "there is no such page")

    def _private(self, path: str, authorization: str) -> Response | None:
        """Answer a request that needs the token in ``Authorization``."""
        data = path.startswith("/data/") and self._on_data is not None
        if path != SETTINGS_PATH and not data:
            return None
        if not self._knows(authorization.removeprefix("Bearer ")):
            return refusal(HTTPStatus.UNAUTHORIZED, "the token must be that of the address that was printed")
        return self._on_data(path) if data and self._on_data is not None else json_answer(self._settings)

    def _knows(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self.token.encode())

    async def _view(self, connection: ServerConnection) -> None:
        """Serve one browser, once it has sent the token."""
        path = "" if connection.request is None else connection.request.path.partition("?")[0]
        if (on_viewer := self._on_viewer.get(path)) is None:
            return
        try:
            first = await asyncio.wait_for(connection.recv(), TOKEN_S)
        except asyncio.TimeoutError:
            first = ""
        if isinstance(first, str) and self._knows(first):
            await on_viewer(connection)
        else:
            await connection.close(WRONG_TOKEN, "the token must be that of the address that was printed")
