"""Check the envelope of a request, which keeps stale requests out, and its fields, by the schema of the wire."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from slipd.types.refusal import Refusal
from slipd_client.messages import PROTOCOL_VERSION
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


def check_request(body: dict[str, Any], boot: str, t_ns: int) -> Refusal | None:
    """Return why the envelope or the fields of a request are wrong; None where a handler may judge it."""
    if not _is_integer(body.get("v")) or body["v"] != PROTOCOL_VERSION:
        return Refusal("unsupported_version", f"v must be {PROTOCOL_VERSION}, {_found(body, 'v')}", "v")
    if "id" not in body:
        return Refusal("missing_field", "id is missing: it must be a string or an integer, new for every request", "id")
    if not TEXT_OR_INTEGER.fits(body["id"]):
        return Refusal("bad_type", f"id must be a string or an integer, got {_type_of(body['id'])}", "id")
    op = body.get("op")
    if not isinstance(op, str) or op not in OPS:
        return Refusal("unknown_op", f"op must be one of {', '.join(OPS)}, {_found(body, 'op')}", "op")
    return _check_freshness(body, op, boot, t_ns) or _check_fields(body, OPS[op].fields)


def _check_freshness(body: dict[str, Any], op: str, boot: str, t_ns: int) -> Refusal | None:
    if op == "hello":
        return None  # by this op a client learns the id of the run
    for name in ("boot", "deadline_ns"):
        if name not in body and op not in OPEN_OPS:
            return Refusal("missing_field", f"{name} is missing: the op hello returns boot and t_ns", name)
    if body.get("boot", boot) != boot:
        return Refusal("wrong_boot", f"boot must be {boot!r}, the id of this run, got {body['boot']!r:.40}", "boot")
    if "deadline_ns" not in body:
        return None
    deadline = body["deadline_ns"]
    if not _is_integer(deadline):
        return Refusal("bad_type", f"deadline_ns must be an integer, got {_type_of(deadline)}", "deadline_ns")
    if deadline <= t_ns:
        late = (t_ns - deadline) * 1e-6
        return Refusal(
            "deadline_passed", f"deadline_ns must not have passed: it passed {late:.0f} ms ago", "deadline_ns"
        )
    if deadline - t_ns > LONGEST_DEADLINE_NS:
        ahead = (deadline - t_ns) * 1e-6
        return Refusal(
            "deadline_too_far",
            f"deadline_ns must be at most {LONGEST_DEADLINE_NS * 1e-6:.0f} ms ahead, got {ahead:.0f} ms",
            "deadline_ns",
        )
    return None


def _check_fields(body: dict[str, Any], fields: Mapping[str, Field]) -> Refusal | None:
    for name in body:
        if name not in fields and name not in _ENVELOPE:
            known = ", ".join(fields) or "no fields of its own"
            return Refusal("unknown_field", f"{name!r:.40} is an unknown field: {body['op']} has {known}", str(name))
    for name, field in fields.items():
        if name not in body:
            if field.required:
                return Refusal("missing_field", f"{name} is missing", name)
            continue
        if body[name] is None and field.nullable:
            continue
        check = _check_triple if field.kind is TRIPLE else _check_value
        refusal = check(name, body[name], field.kind) or _check_pattern(field, body[name])
        if refusal is not None:
            return refusal
    return None


def _check_value(name: str, value: Any, kind: Kind) -> Refusal | None:
    if not kind.fits(value):
        return Refusal("bad_type", f"{name} must be {kind.phrase}, got {_type_of(value)}", name)
    if kind is NUMBER and not math.isfinite(value):
        return Refusal("not_finite", f"{name} must be finite, got {value}", name)
    return None


def _check_pattern(field: Field, value: Any) -> Refusal | None:
    if not field.pattern or re.fullmatch(field.pattern, value):
        return None
    return Refusal("out_of_range", f"{field.name} must have {field.limit}, got {value!r:.80}", field.name)


def _check_triple(name: str, value: Any, kind: Kind) -> Refusal | None:
    if not isinstance(value, list) or len(value) != 3:
        found = f"a list of {len(value)}" if isinstance(value, list) else _type_of(value)
        return Refusal("bad_type", f"{name} must be {kind.phrase}, got {found}", name)
    for entry in value:
        refusal = _check_value(name, entry, NUMBER)
        if refusal is not None:
            return refusal
    return None


def _is_integer(value: Any) -> bool:
    return INTEGER.fits(value)


def _found(body: dict[str, Any], name: str) -> str:
    return f"got {body[name]!r:.40}" if name in body else "but it is missing"


def _type_of(value: Any) -> str:
    return _TYPES.get(type(value), "nil")
