"""The topic ``status`` as a ``diagnostic_msgs/DiagnosticArray``: the daemon, its fingers, gripper and streams."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from slipd_client.messages.names import Health

_IN_STATUS = ("health", "message", "hardware_id")
"""Fields of a stream that a ``DiagnosticStatus`` has a place for."""

Entry = dict[str, Any]


def diagnostics(header: Mapping[str, Any], body: Mapping[str, Any]) -> dict[str, Any]:
    """Return the ``DiagnosticArray`` of one message of ``status``."""
    return {"header": header, "status": list(_entries(body))}


def stale_diagnostics(last: Mapping[str, Any], header: Mapping[str, Any], why: str) -> dict[str, Any]:
    """Return a ``DiagnosticArray`` in which every entry of an earlier one is stale, because of ``why``."""
    entries = [{**each, "level": int(Health.STALE), "message": why} for each in last["status"]]
    return {"header": header, "status": entries}


def _entries(body: Mapping[str, Any]) -> Iterator[Entry]:
    yield _daemon(body)
    for finger, state in body.get("fingers", {}).items():
        yield _finger(finger, state)
    if body.get("gripper") is not None:
        yield _gripper(body["gripper"])
    for stream, state in body.get("streams", {}).items():
        values = {key: value for key, value in state.items() if key not in _IN_STATUS}
        yield entry(stream, state["health"], state.get("message") or "", state.get("hardware_id") or "", values)


def _daemon(body: Mapping[str, Any]) -> Entry:
    late_s = body.get("late_s") or 0.0
    failed = [name for name in ("recording", "run_recording") if (body.get(name) or {}).get("state") == "failed"]
    failed += ["incident"] if (body.get("incidents") or {}).get("failure") else []
    faults = [f"stalled for {late_s:.3f} s"] * (late_s > 0.0) + [f"{name} failed" for name in failed]
    values = {key: body.get(key) for key in ("version", "uptime_s", "late_s", "object_name", "lease", "publisher")}
    return entry("daemon", Health.WARN if faults else Health.OK, "; ".join(faults), "", values)


def _finger(finger: str, state: Mapping[str, Any]) -> Entry:
    """Return a finger: a verdict that is unknown is a warning, every other is in order; it is no fault to slip."""
    level = Health.WARN if state["level"] == "unknown" else Health.OK
    message = " ".join(filter(None, (state["level"], ", ".join(state.get("reasons") or ()))))
    return entry(f"finger {finger}", level, message, "", state)


def _gripper(state: Mapping[str, Any]) -> Entry:
    if state.get("fault") is None:
        level, message = Health.STALE, "the gripper does not answer"
    elif fault := state["fault"] or state.get("latched_fault"):
        level, message = Health.ERROR, fault
    else:
        level, message = Health.OK, ""
    return entry("gripper", level, message, "", state)


def entry(name: str, level: Health, message: str, hardware_id: str, values: Mapping[str, Any]) -> Entry:
    """Return a ``DiagnosticStatus``; without a message it is the name of the level."""
    return {
        "level": int(level),
        "name": f"slipd: {name}",
        "message": message or Health(level).name,
        "hardware_id": hardware_id,
        "values": [{"key": key, "value": _text(value)} for key, value in values.items()],
    }


def _text(value: Any) -> str:
    """Return a value for people; "unknown" for nil."""
    if value is None:
        return "unknown"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
