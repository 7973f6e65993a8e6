"""Messages between the daemon and an external driver of the gripper: msgpack maps, version 1 of the format.

The driver registers, reports, and answers set-points; the daemon sends set-points. docs/devices.md describes the
format. The bounds of a message are checked before it is unpacked: a flat map of known keys, each once, with short
values. Then every value is checked: a value that is not finite, or beyond any gripper's range, makes the whole message
invalid.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import msgpack

from slipd.devices.shared.msgpack_bounds import FIXARRAY, FIXSTR, NIL, NUMBER_LENGTHS, STR8, map_end, text_end
from slipd.devices.shared.partial_message import Malformed, arrived, byte_at, message_length

VERSION = 1

MAX_MESSAGE = 512
"""Longest message, bytes; a report with all fields fills 250."""

MAX_TEXT = 120
"""Longest name, fault or error, bytes."""

MAX_WIDTH_M = 2.0
MAX_SPEED_MPS = 10.0
MAX_FORCE_N = 10_000.0
"""No gripper is wider, faster or stronger; larger values are mistakes in units."""

LAST_ID = (1 << 63) - 1

OBJECTS = ("none", "moving", "contact_opening", "contact_closing")

REGISTERED, REFUSED = "registered", "refused"

_REGISTRATION = {"v", "name", "width_range_m", "force_range_n"}
_REPORT = {"v", "width_m"}
_OF_REGISTRATION = _REGISTRATION | {"speed_range_mps"}
_OF_REPORT = _REPORT | {"active", "moving", "object", "fault", "force_n", "id", "applied_n", "error"}
_SIZES = range(len(_REPORT), len(_OF_REPORT) + 1)
_SCALAR_LENGTHS = NUMBER_LENGTHS | {NIL: 1, 0xC2: 1, 0xC3: 1}  # numbers, nil, false, true
_NAME = re.compile(r"[A-Za-z0-9_./ -]+")
_WORD = re.compile(r"[a-z][a-z0-9_]*")

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Registration:
    """Name of a driver and ranges of its gripper; see `encode_registration`."""

    name: str
    width_range_m: Range
    force_range_n: Range
    speed_range_mps: Range | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """State of the gripper, sent regularly and as the answer to a set-point; see `encode_report`."""

    width_m: float | None
    active: bool = True
    moving: bool = False
    object: str = "none"
    fault: str = ""
    force_n: float | None = None
    id: int | None = None
    applied_n: float | None = None
    error: str = ""


@dataclass(frozen=True, slots=True)
class Foreign:
    """A message of another version of the format."""

    version: int


Message = Registration | Report | Foreign


def measure(buffer: bytes, at: int) -> int:
    """Return the length of the message at ``at``; 0 if more bytes are needed to decide, -1 if there is none."""
    return message_length(_message_end, buffer, at, MAX_MESSAGE)


def _message_end(buffer: bytes, at: int) -> int:
    return map_end(buffer, at, _SIZES, _VALUE_ENDS)[0]


def _value_end(buffer: bytes, at: int) -> int:
    """Return where a number, a flag, a text, nil or a pair of numbers ends."""
    head = byte_at(buffer, at)
    if head == FIXARRAY + 2:
        return _scalar_end(buffer, _scalar_end(buffer, at + 1))
    if head == STR8 or FIXSTR <= head < FIXSTR + 32:
        return text_end(buffer, at, 0, MAX_TEXT)
    return _scalar_end(buffer, at)


def _scalar_end(buffer: bytes, at: int) -> int:
    length = _SCALAR_LENGTHS.get(byte_at(buffer, at))
    if length is None:
        raise Malformed
    return arrived(buffer, at + length)


_VALUE_ENDS = {key.encode(): _value_end for key in _OF_REGISTRATION | _OF_REPORT}


def parse(data: bytes) -> Message | None:
    """Return the content of a measured message; None if a value is impossible."""
    try:
        body: dict[str, Any] = msgpack.unpackb(data)
    except UnicodeDecodeError:
        return None
    version = body.get("v")
    if type(version) is not int:
        return None
    if version != VERSION:
        return Foreign(version)
    if body.keys() >= _REGISTRATION and body.keys() <= _OF_REGISTRATION:
        return _registration(body)
    if body.keys() >= _REPORT and body.keys() <= _OF_REPORT:
        return _report(body)
    return None


def _registration(body: dict[str, Any]) -> Registration | None:
    name, speeds = body["name"], body.get("speed_range_mps")
    is_possible = (
        isinstance(name, str)
        and _NAME.fullmatch(name)
        and _is_range(body["width_range_m"], MAX_WIDTH_M)
        and _is_range(body["force_range_n"], MAX_FORCE_N)
        and (speeds is None or _is_range(speeds, MAX_SPEED_MPS))
    )
    if not is_possible:
        return None
    widths, forces = _pair(body["width_range_m"]), _pair(body["force_range_n"])
    return Registration(name, widths, forces, None if speeds is None else _pair(speeds))


def _report(body: dict[str, Any]) -> Report | None:
    moving = body.get("moving", False)
    answer, applied_n = body.get("id"), body.get("applied_n")
    found = body.get("object", "moving" if moving else "none")
    fault, error = body.get("fault", ""), body.get("error", "")
    is_possible = (
        _is_number(body["width_m"], 0.0, MAX_WIDTH_M)
        and _is_number(body.get("force_n"), -MAX_FORCE_N, MAX_FORCE_N)
        and _is_number(applied_n, 0.0, MAX_FORCE_N)
        and (answer is None or (type(answer) is int and 0 < answer <= LAST_ID))
        and isinstance(body.get("active", True), bool)
        and isinstance(moving, bool)
        and found in OBJECTS
        and isinstance(fault, str)
        and (not fault or _WORD.fullmatch(fault))
        and isinstance(error, str)
        and error.isprintable()
    )
    if not is_possible:
        return None
    width_m, force_n = _float(body["width_m"]), _float(body.get("force_n"))
    active = body.get("active", True)
    return Report(width_m, active, moving, found, fault, force_n, answer, _float(applied_n), error)


def _is_number(value: Any, low: float, high: float) -> bool:
    """Return whether a value is a number within bounds, or nil."""
    return value is None or (type(value) in (int, float) and low <= value <= high)


def _is_range(value: Any, high: float) -> bool:
    return (
        isinstance(value, list)
        and None not in value
        and all(_is_number(end, 0.0, high) for end in value)
        and value[0] < value[1]
    )


def _pair(value: list[float]) -> Range:
    return float(value[0]), float(value[1])


def _float(value: float | None) -> float | None:
    return None if value is None else float(value)


def encode_registration(registration: Registration) -> bytes:
    """Return the registration of a driver.

    Args:
        registration: Name (letters, digits, spaces and ``_./-``; the connection keeps it), and smallest and largest
            width between the pads, m, force on one pad, N, and speed, m/s (None if the speed cannot be set).

    Raises:
        ValueError: The daemon would reject it.
    """
    body: dict[str, Any] = {"v": VERSION, "name": registration.name}
    body |= {"width_range_m": registration.width_range_m, "force_range_n": registration.force_range_n}
    if registration.speed_range_mps is not None:
        body["speed_range_mps"] = registration.speed_range_mps
    return _checked(body)


def encode_report(report: Report) -> bytes:
    """Return a report of a driver, or its answer to a set-point.

    Raises:
        ValueError: The daemon would reject it.
    """
    body: dict[str, Any] = {"v": VERSION, "width_m": report.width_m, "active": report.active, "moving": report.moving}
    body |= {"object": report.object, "fault": report.fault, "force_n": report.force_n}
    if report.id is not None:
        body |= {"id": report.id, "applied_n": report.applied_n}
    if report.error:
        body["error"] = report.error
    return _checked(body)


def _checked(body: dict[str, Any]) -> bytes:
    data: bytes = msgpack.packb(body)
    if measure(data, 0) != len(data) or parse(data) is None:
        raise ValueError(f"a driver's message must have finite numbers within their bounds, got {body}")
    return data


def encode_setpoint(setpoint_id: int, operation: str, **values: float | None) -> bytes:
    """Return a set-point.

    Args:
        setpoint_id: Its id, from 1.
        operation: "activate", "move", "force", "stop" or "acknowledge".
        values: Its values, in SI units.
    """
    data: bytes = msgpack.packb({"v": VERSION, "id": setpoint_id, "op": operation, **values})
    return data


def encode_notice(key: str, text: str) -> bytes:
    """Return the daemon's notice to a driver.

    Args:
        key: `REGISTERED` or `REFUSED`.
        text: The name that registered, or the reason of the refusal.
    """
    data: bytes = msgpack.packb({"v": VERSION, key: text})
    return data
