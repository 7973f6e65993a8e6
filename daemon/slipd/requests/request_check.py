"""Check requests: the envelope, which keeps stale ones out, and the fields, by the schema of the wire; and no repeats.

No request is carried out twice: a repeated one gets the same reply, a copy by another client is refused.
"""

from __future__ import annotations

import heapq
import itertools
import math
import re
from collections.abc import Mapping
from typing import Any

from slipd.types.permit import RefusalError
from slipd_client.messages import PROTOCOL_VERSION, encode
from slipd_client.messages.schema.fields import Field
from slipd_client.messages.schema.kinds import INTEGER, NUMBER, TEXT_OR_INTEGER, TRIPLE, Kind
from slipd_client.messages.schema.ops import OPEN_OPS, OPS
from slipd_client.messages.schema.request_fields import ENVELOPE

LONGEST_DEADLINE_NS = 500_000_000
"""A deadline may be this far ahead: a request that waited longer was meant for another situation."""

_ENVELOPE = frozenset(field.name for field in ENVELOPE)


_TYPES = {
    bool: "a boolean",
    int: "an integer",
    float: "a number",
    str: "a string",
    bytes: "a byte string",
    list: "a list",
    dict: "a map",
}
"""Names of the types of msgpack, for refusals."""


def check_request(body: dict[str, Any], boot: str, t_ns: int) -> None:
    """Go on if a handler may judge a request.

    Raises:
        RefusalError: Its envelope or its fields are wrong.
    """
    if not INTEGER.fits(body.get("v")) or body["v"] != PROTOCOL_VERSION:
        raise RefusalError("unsupported_version", f"v must be {PROTOCOL_VERSION}, {_found(body, 'v')}", "v")
    if "id" not in body:
        rule = "id is missing: it must be a string or an integer, new for every request"
        raise RefusalError("missing_field", rule, "id")
    _check_value("id", body["id"], TEXT_OR_INTEGER)
    op = body.get("op")
    if not isinstance(op, str) or op not in OPS:
        raise RefusalError("unknown_op", f"op must be one of {', '.join(OPS)}, {_found(body, 'op')}", "op")
    if op != "hello":  # by this op a client learns the id of the run
        _check_freshness(body, op, boot, t_ns)
    _check_fields(body, OPS[op].fields)


def _check_freshness(body: dict[str, Any], op: str, boot: str, t_ns: int) -> None:
    for name in ("boot", "deadline_ns"):
        if name not in body and op not in OPEN_OPS:
            raise RefusalError("missing_field", f"{name} is missing: the op hello returns boot and t_ns", name)
    if body.get("boot", boot) != boot:
        raise RefusalError("wrong_boot", f"boot must be {boot!r}, the id of this run, got {body['boot']!r:.40}", "boot")
    if "deadline_ns" not in body:
        return
    deadline = body["deadline_ns"]
    _check_value("deadline_ns", deadline, INTEGER)
    ahead_ms = (deadline - t_ns) * 1e-6
    if ahead_ms <= 0:
        rule = f"deadline_ns must not have passed: it passed {abs(ahead_ms):.0f} ms ago"
        raise RefusalError("deadline_passed", rule, "deadline_ns")
    if deadline - t_ns > LONGEST_DEADLINE_NS:
        rule = f"deadline_ns must be at most {LONGEST_DEADLINE_NS * 1e-6:.0f} ms ahead, got {ahead_ms:.0f} ms"
        raise RefusalError("deadline_too_far", rule, "deadline_ns")


def _check_fields(body: dict[str, Any], fields: Mapping[str, Field]) -> None:
    for name in body:
        if name not in fields and name not in _ENVELOPE:
            known = ", ".join(fields) or "no fields of its own"
            rule = f"{name!r:.40} is an unknown field: {body['op']} has {known}"
            raise RefusalError("unknown_field", rule, str(name))
    for name, field in fields.items():
        if name not in body:
            if field.required:
                raise RefusalError("missing_field", f"{name} is missing", name)
        elif body[name] is not None or not field.nullable:
            _check_field(field, body[name])


def _check_field(field: Field, value: Any) -> None:
    if field.kind is TRIPLE and isinstance(value, list):
        if len(value) != 3:
            rule = f"{field.name} must be {TRIPLE.phrase}, got a list of {len(value)}"
            raise RefusalError("bad_type", rule, field.name)
        for entry in value:
            _check_value(field.name, entry, NUMBER)
    else:
        _check_value(field.name, value, field.kind)
    if field.pattern and not re.fullmatch(field.pattern, value):
        raise RefusalError("out_of_range", f"{field.name} must have {field.limit}, got {value!r:.80}", field.name)


def _check_value(name: str, value: Any, kind: Kind) -> None:
    if not kind.fits(value):
        raise RefusalError("bad_type", f"{name} must be {kind.phrase}, got {_TYPES.get(type(value), 'nil')}", name)
    if kind is NUMBER and not math.isfinite(value):
        raise RefusalError("not_finite", f"{name} must be finite, got {value}", name)


def _found(body: dict[str, Any], name: str) -> str:
    return f"got {body[name]!r:.40}" if name in body else "but it is missing"


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
