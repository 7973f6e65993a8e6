"""What a request must look like: operations, their fields, and the envelope that keeps stale ones out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from slipd.refusal import Refusal
from slipd.requests.idempotency import OPEN_OPS
from slipd_client.messages import PROTOCOL_VERSION

#: A deadline may lie this far ahead: a request that waited longer was meant for another situation.
LONGEST_DEADLINE_NS = 500_000_000
_ENVELOPE = frozenset({"v", "id", "op", "boot", "deadline_ns"})


#: What each kind of field is called in a refusal, and each type of msgpack.
_KINDS = {"number": "a number", "integer": "an integer", "text": "a string", "flag": "true or false"}
_TYPES = {
    bool: "a boolean",
    int: "an integer",
    float: "a number",
    str: "a string",
    bytes: "a byte string",
    list: "a list",
    dict: "a map",
}


@dataclass(frozen=True, slots=True)
class Field:
    """One field of an operation: "number", "integer", "text", "flag" or "vector" (three numbers)."""

    kind: str
    required: bool = True


OPS: dict[str, dict[str, Field]] = {
    "hello": {},
    "status": {},
    "tare": {
        "finger": Field("text"),
        "seconds": Field("number", required=False),
        "stream": Field("text", required=False),
        "unloaded": Field("flag", required=False),
    },
    "tare.get": {"finger": Field("text"), "stream": Field("text", required=False)},
    "tare.undo": {"finger": Field("text"), "stream": Field("text", required=False)},
    "gravity.set": {"finger": Field("text"), "gravity_mps2": Field("vector")},
    "lease.acquire": {"ttl_ms": Field("integer")},
    "lease.renew": {},
    "lease.release": {},
    "grip.set": {"force_n": Field("number")},
    "grip.adjust": {"delta_n": Field("number")},
    "grip.hold": {},
    "gripper.activate": {"drop": Field("flag", required=False)},
    "gripper.close": {
        "force_n": Field("number"),
        "width_m": Field("number", required=False),
        "speed_mps": Field("number", required=False),
    },
    "gripper.open": {
        "width_m": Field("number", required=False),
        "speed_mps": Field("number", required=False),
        "drop": Field("flag", required=False),
    },
    "gripper.stop": {},
    "fault.ack": {},
    "friction.set": {"finger": Field("text"), "mu_s": Field("number"), "mu_d": Field("number", required=False)},
    "record.start": {},
    "record.stop": {},
}


def check_request(body: dict[str, Any], boot: str, t_ns: int) -> Refusal | None:
    """Refuses a request whose envelope or fields are wrong; None where it may be judged."""
    if not _is_integer(body.get("v")) or body["v"] != PROTOCOL_VERSION:
        return Refusal("unsupported_version", f"v must be {PROTOCOL_VERSION}, {_found(body, 'v')}", "v")
    if "id" not in body:
        return Refusal("missing_field", "id is missing: a string or an integer of the client's choice", "id")
    if not isinstance(body["id"], str) and not _is_integer(body["id"]):
        return Refusal("bad_type", f"id must be a string or an integer, not {_type_of(body['id'])}", "id")
    op = body.get("op")
    if not isinstance(op, str) or op not in OPS:
        return Refusal("unknown_op", f"op must be one of {', '.join(OPS)}, {_found(body, 'op')}", "op")
    return _check_freshness(body, op, boot, t_ns) or _check_fields(body, OPS[op])


def _check_freshness(body: dict[str, Any], op: str, boot: str, t_ns: int) -> Refusal | None:
    if op == "hello":
        return None  # it is how a client learns of another run
    for name in ("boot", "deadline_ns"):
        if name not in body and op not in OPEN_OPS:
            return Refusal("missing_field", f"{name} is missing; op hello returns boot and t_ns", name)
    if body.get("boot", boot) != boot:
        return Refusal("wrong_boot", f"the request is meant for run {body['boot']!r:.40}; this is {boot!r}", "boot")
    if "deadline_ns" not in body:
        return None
    deadline = body["deadline_ns"]
    if not _is_integer(deadline):
        return Refusal("bad_type", f"deadline_ns must be an integer, not {_type_of(deadline)}", "deadline_ns")
    if deadline <= t_ns:
        late = (t_ns - deadline) * 1e-6
        return Refusal("deadline_passed", f"the deadline passed {late:.0f} ms ago", "deadline_ns")
    if deadline - t_ns > LONGEST_DEADLINE_NS:
        ahead = (deadline - t_ns) * 1e-6
        return Refusal("deadline_too_far", f"the deadline is {ahead:.0f} ms ahead; at most 500", "deadline_ns")
    return None


def _check_fields(body: dict[str, Any], fields: dict[str, Field]) -> Refusal | None:
    for name in body:
        if name not in fields and name not in _ENVELOPE:
            known = ", ".join(fields) or "no fields of its own"
            return Refusal("unknown_field", f"{name!r:.40} is unknown; this op has {known}", str(name))
    for name, wanted in fields.items():
        if name not in body:
            if wanted.required:
                return Refusal("missing_field", f"{name} is missing", name)
            continue
        refusal = _check_value(name, body[name], wanted.kind)
        if refusal is not None:
            return refusal
    return None


def _check_value(name: str, value: Any, kind: str) -> Refusal | None:
    if kind == "vector":
        return _check_vector(name, value)
    right = {
        "number": _is_integer(value) or isinstance(value, float),
        "integer": _is_integer(value),
        "text": isinstance(value, str),
        "flag": isinstance(value, bool),
    }[kind]
    if not right:
        return Refusal("bad_type", f"{name} must be {_KINDS[kind]}, not {_type_of(value)}", name)
    if kind == "number" and not math.isfinite(value):
        return Refusal("not_finite", f"{name} must be finite, not {value}", name)
    return None


def _check_vector(name: str, value: Any) -> Refusal | None:
    if not isinstance(value, list) or len(value) != 3:
        found = f"a list of {len(value)}" if isinstance(value, list) else _type_of(value)
        return Refusal("bad_type", f"{name} must be a list of three numbers, not {found}", name)
    for entry in value:
        refusal = _check_value(name, entry, "number")
        if refusal is not None:
            return refusal
    return None


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _found(body: dict[str, Any], name: str) -> str:
    return f"not {body[name]!r:.40}" if name in body else "and is missing"


def _type_of(value: Any) -> str:
    return _TYPES.get(type(value), "nil")
