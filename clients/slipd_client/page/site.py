"""The files of the page, and the heads of every answer."""

from __future__ import annotations

import json
from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Response

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


class Site:
    """The files of the page, read once.

    Args:
        settings: What the page must know before its first message.
        start: The file that ``/`` serves.
    """

    def __init__(self, settings: dict[str, object], start: str = "index.html") -> None:
        self._answers = {
            f"/{path.relative_to(ASSETS).as_posix()}": (path.read_bytes(), f"{_TYPES[path.suffix]}; charset=utf-8")
            for path in sorted(ASSETS.rglob("*"))
            if path.suffix in _TYPES
        }
        self._answers["/"] = self._answers[f"/{start}"]
        self._answers["/commission"] = self._answers["/commission.html"]
        self._settings = settings | {"words": _words()}

    def settings(self) -> Response:
        """Return the settings with the words of the wire; they name the source, so they need the token."""
        return json_answer(self._settings)

    def answer(self, path: str) -> Response | None:
        """Return the file of a path; None if the page has no such file."""
        found = self._answers.get(path)
        return None if found is None else answer(HTTPStatus.OK, *found)


def _words() -> dict[str, object]:
    """Return every word of the wire that the page explains."""
    return {
        "levels": LEVELS,
        "level_meanings": LEVEL_MEANINGS,
        "reasons": REASONS,
        "evidence": EVIDENCE,
        "image_reasons": IMAGE_REASONS,
        "health": HEALTH,
    }
