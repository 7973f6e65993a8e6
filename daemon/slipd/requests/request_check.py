"""Check requests: the envelope, which keeps stale ones out, and the fields, by the schema of the wire."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from slipd.types.permit import RefusalError
from slipd_client.messages import PROTOCOL_VERSION
from slipd_client.messages.fields import INTEGER, NUMBER, TEXT_OR_INTEGER, TRIPLE, Field, Kind
from slipd_client.messages.ops import OPEN_OPS, OPS
from slipd_client.messages.request_fields import ENVELOPE

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
        raise RefusalError(
            "unsupported_version", f"the version of the API must be {PROTOCOL_VERSION}, {_found(body, 'v')}", "v"
        )
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
