"""Why a request must be refused whatever the state of the daemon."""

from __future__ import annotations

import math
from typing import Any

from fuzz.asking import FIELDS

from slipd_client.messages.schema.ops import OPS
from slipd_client.messages.schema.request_fields import ENVELOPE as ENVELOPE_FIELDS

MS = 1_000_000

LONGEST_DEADLINE_NS = 500 * MS

ENVELOPE = {field.name for field in ENVELOPE_FIELDS}
REQUIRED = {op.name: {field.name for field in op.fields.values() if field.required} for op in OPS.values()}
NUMBERS = ("force_n", "delta_n", "width_m", "speed_mps", "seconds", "mu_s", "mu_d", "ttl_ms", "deadline_ns")


def malformed(body: dict[str, Any], boot: str, t_ns: int) -> str:
    """Return why the daemon must refuse a request from any client; "" if it need not."""
    op = body.get("op")
    if body.get("v") != 1 or isinstance(body.get("v"), bool):
        return "of another version"
    if not isinstance(op, str) or op not in FIELDS:
        return "its op is unknown"
    if isinstance(body.get("id"), bool) or not isinstance(body.get("id"), (str, int)):
        return "it has no id"
    if op not in ("hello", "status"):
        deadline = body.get("deadline_ns")
        if body.get("boot") != boot:
            return "meant for another run"
        if isinstance(deadline, bool) or not isinstance(deadline, int):
            return "its deadline is no integer"
        if not t_ns < deadline <= t_ns + LONGEST_DEADLINE_NS:
            return "late, or far too early"
    if set(body) - ENVELOPE - set(FIELDS[op]) or REQUIRED.get(op, set()) - set(body):
        return "its fields are not those of its op"
    for name in FIELDS[op] if op == "hello" else (*NUMBERS, "gravity_mps2"):
        values = body.get(name, 0) if name == "gravity_mps2" else (body.get(name, 0),)
        for value in values if isinstance(values, (list, tuple)) else (values,):
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                return f"{name} is no number"
    if op == "object.set" and not (body["name"] is None or _is_a_name(body["name"])):
        return "its name is no name"
    for name in ("drop", "unloaded"):
        if not isinstance(body.get(name, False), bool):
            return f"{name} is no flag"
    return ""


def _is_a_name(value: Any) -> bool:
    """Whether it is 1 to 64 letters, digits, dots, underscores and hyphens, the first a letter or digit."""
    if not isinstance(value, str) or not 1 <= len(value) <= 64 or not value.isascii() or not value[0].isalnum():
        return False
    return all(character.isalnum() or character in "._-" for character in value)
