"""No request is done twice: a repeated one gets the reply of the first, another client's copy of it is refused."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

from slipd.refusal import Refusal

#: Ops that change nothing and need neither the id of the run nor a deadline: asked again, they are answered again.
OPEN_OPS = frozenset({"hello", "status"})
#: Requests of one client that are remembered at once: 50 a second with the longest deadline are 25, and a burst.
PER_CLIENT = 64
#: Clients that are remembered at once: several times as many as can be connected, for some reconnect. A crowd of new
#: ones shuts out newcomers, never one that keeps asking.
MOST_CLIENTS = 1024
#: Ops that keep a grip as it is or make it safer: the holder of the lease is never "busy" for them.
URGENT_OPS = frozenset({"lease.renew", "grip.hold", "gripper.stop"})


@dataclass(frozen=True, slots=True)
class _Kept:
    content: Hashable
    reply: dict[str, Any]


class IdempotencyCache:
    """Remembers what was answered, as long as the request's own deadline lets it be sent again.

    Bodies are those of well-formed requests: with ``id``, ``op`` and, but for `OPEN_OPS`, a ``deadline_ns`` ahead. An
    earlier time than the last counts as the last, so that nothing forgotten can come back.
    """

    def __init__(self) -> None:
        self._now_ns = 0
        self._clients: dict[bytes, dict[str | int, _Kept]] = {}
        self._senders: dict[Hashable, bytes] = {}
        self._deadlines: list[tuple[int, int, bytes, str | int]] = []
        self._numbers = itertools.count()

    def seen(
        self, client: bytes, body: dict[str, Any], t_ns: int, *, urgent: bool = False
    ) -> dict[str, Any] | Refusal | None:
        """Return the reply kept for this request, why it is refused, or None: it is new.

        What is new is judged, carried out or refused, and then kept with its reply whatever that was.

        Args:
            client: Who asks.
            body: What is asked.
            t_ns: Now, ns.
            urgent: It is never refused as "busy".
        """
        if body["op"] in OPEN_OPS:
            return None
        self._forget(t_ns)
        if body["deadline_ns"] <= self._now_ns:
            return Refusal("deadline_passed", "the deadline passed", "deadline_ns")
        content = _content(body)
        mine = self._clients.get(client, {})
        kept = mine.get(body["id"])
        if kept is not None:
            if kept.content == content:
                return kept.reply
            return Refusal("repeated_id", "this id was used for another request; use each only once", "id")
        if content in self._senders:
            return Refusal("replayed", "another client sent exactly this request")
        if not urgent and (len(mine) >= PER_CLIENT or (not mine and len(self._clients) >= MOST_CLIENTS)):
            return Refusal("busy", "too many requests whose deadlines have not passed; ask again later")
        return None

    def keep(self, client: bytes, body: dict[str, Any], reply: dict[str, Any], t_ns: int) -> None:
        """Remembers the reply to a request that was new."""
        if body["op"] in OPEN_OPS:
            return
        self._forget(t_ns)
        content = _content(body)
        self._clients.setdefault(client, {})[body["id"]] = _Kept(content, reply)
        self._senders[content] = client
        heapq.heappush(self._deadlines, (body["deadline_ns"], next(self._numbers), client, body["id"]))

    def _forget(self, t_ns: int) -> None:
        """Drops what is too late to be sent again."""
        self._now_ns = max(self._now_ns, t_ns)
        while self._deadlines and self._deadlines[0][0] <= self._now_ns:
            _, _, client, name = heapq.heappop(self._deadlines)
            mine = self._clients[client]
            del self._senders[mine.pop(name).content]
            if not mine:
                del self._clients[client]


def _content(value: Any) -> Hashable:
    """A value that compares equal only to the same content: 1, 1.0 and true are three."""
    if isinstance(value, dict):
        return frozenset((key, _content(entry)) for key, entry in value.items())
    if isinstance(value, list):
        return tuple(_content(entry) for entry in value)
    return type(value), value
