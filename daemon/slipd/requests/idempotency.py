"""Carry out no request twice: a repeated one gets the same reply, a copy by another client is refused."""

from __future__ import annotations

import heapq
import itertools
from typing import Any

from slipd.types.permit import RefusalError
from slipd_client.messages import encode
from slipd_client.messages.ops import OPEN_OPS

PER_CLIENT = 64
"""Requests of one client that are kept at once: 50 per second with the longest deadline are 25, plus a burst."""

MOST_CLIENTS = 1024
"""Clients that are kept at once: several times as many as can be connected, as some reconnect. Beyond this number new
clients are refused, and never one of those kept."""


class IdempotencyCache:
    """Keep every reply until the deadline of its request, as the request may be sent again until then.

    Requests are checked: they have ``id``, ``op`` and, except `OPEN_OPS`, a ``deadline_ns`` in the future. A time
    before the last one counts as the last one, so that no request that was dropped can be carried out again.
    """

    def __init__(self) -> None:
        self._now_ns = 0
        self._clients: dict[bytes, dict[str | int, tuple[bytes, dict[str, Any]]]] = {}  # request, reply
        self._senders: dict[bytes, bytes] = {}
        self._deadlines: list[tuple[int, int, bytes, str | int]] = []
        self._numbers = itertools.count()

    def seen(self, client: bytes, body: dict[str, Any], t_ns: int, *, urgent: bool = False) -> dict[str, Any] | None:
        """Return the reply kept for a request; None for a new one, which must be kept (`keep`).

        Args:
            client: The client.
            body: The request.
            t_ns: Now, CLOCK_MONOTONIC.
            urgent: The request is never refused as "busy".

        Raises:
            RefusalError: It is late, a copy of another client's, or one too many.
        """
        if body["op"] in OPEN_OPS:
            return None
        self._forget(t_ns)
        if body["deadline_ns"] <= self._now_ns:
            raise RefusalError("deadline_passed", "the deadline has passed", "deadline_ns")
        content = _content(body)
        mine = self._clients.get(client, {})
        if body["id"] in mine:
            kept, reply = mine[body["id"]]
            if kept == content:
                return reply
            rule = "id must be new for every request: this one was used for another request"
            raise RefusalError("repeated_id", rule, "id")
        if content in self._senders:
            raise RefusalError("replayed", "another client has already sent this request")
        if not urgent and (len(mine) >= PER_CLIENT or (not mine and len(self._clients) >= MOST_CLIENTS)):
            rule = "too many requests whose deadlines have not passed: wait, or use shorter deadlines"
            raise RefusalError("busy", rule)
        return None

    def keep(self, client: bytes, body: dict[str, Any], reply: dict[str, Any], t_ns: int) -> None:
        """Keep the reply to a new request."""
        if body["op"] in OPEN_OPS:
            return
        self._forget(t_ns)
        content = _content(body)
        self._clients.setdefault(client, {})[body["id"]] = content, reply
        self._senders[content] = client
        heapq.heappush(self._deadlines, (body["deadline_ns"], next(self._numbers), client, body["id"]))

    def _forget(self, t_ns: int) -> None:
        """Drop requests whose deadline has passed."""
        self._now_ns = max(self._now_ns, t_ns)
        while self._deadlines and self._deadlines[0][0] <= self._now_ns:
            _, _, client, name = heapq.heappop(self._deadlines)
            mine = self._clients[client]
            del self._senders[mine.pop(name)[0]]
            if not mine:
                del self._clients[client]


def _content(body: dict[str, Any]) -> bytes:
    """Return the request packed by msgpack, where 1, 1.0 and true differ; the order of its fields does not count."""
    return encode(dict(sorted(body.items())))
