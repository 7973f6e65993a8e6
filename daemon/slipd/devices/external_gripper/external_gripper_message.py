"""The messages between the daemon and another driver that holds the gripper: msgpack maps, version 1 of their format.

The driver registers, reports, and answers set-points; the daemon sends set-points. It is written down in
docs/devices.md. What a driver sends is walked before it is unpacked: a flat map of known keys, each once, of short
values; msgpack itself accepts nests without end. Then every value is judged: one that is not finite, or beyond what a
gripper can be, makes the whole message none.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import msgpack

from slipd.devices.walking import FIXARRAY, FIXMAP, FIXSTR, STR8, Wrong, byte_at, known_key, length_of, within

VERSION = 1

MAX_MESSAGE = 512
"""Bytes. A report with everything in it fills 250."""

MAX_TEXT = 120
"""Bytes of a name, a fault or an error."""

MAX_WIDTH_M = 2.0
MAX_SPEED_MPS = 10.0
MAX_FORCE_N = 10_000.0
"""No gripper is wider, faster or stronger: beyond them stands a mistake in units."""

LAST_ID = (1 << 63) - 1

OBJECTS = ("none", "moving", "contact_opening", "contact_closing")

REGISTERED, REFUSED = "registered", "refused"

_KEYS = {
    b"v",
    b"name",
    b"width_range_m",
    b"force_range_n",
    b"speed_range_mps",
    b"width_m",
    b"active",
    b"moving",
    b"object",
    b"fault",
    b"force_n",
    b"id",
    b"applied_n",
    b"error",
}
_REGISTRATION = {"v", "name", "width_range_m", "force_range_n"}
_REPORT = {"v", "width_m"}
_OF_REGISTRATION = _REGISTRATION | {"speed_range_mps"}
_OF_REPORT = _REPORT | {"active", "moving", "object", "fault", "force_n", "id", "applied_n", "error"}
_FEWEST, _MOST = len(_REPORT), len(_OF_REPORT)
_LENGTHS = {0xC0: 1, 0xC2: 1, 0xC3: 1, 0xCA: 5, 0xCB: 9}  # nil, false, true, float 32, float 64
_LENGTHS |= {0xCC + power: 1 + (1 << power) for power in range(4)} | {
    0xD0 + power: 1 + (1 << power) for power in range(4)
}
_LENGTHS |= dict.fromkeys((*range(0x80), *range(0xE0, 0x100)), 1)
_NAME = re.compile(r"[A-Za-z0-9_./ -]+")
_WORD = re.compile(r"[a-z][a-z0-9_]*")

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Registration:
    """A driver tells who it is and what its gripper can do, on one pad; see `encode_registration`."""

    name: str
    width_range_m: Range
    force_range_n: Range
    speed_range_mps: Range | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """A driver tells the state of its gripper, by itself or as the answer to a set-point; see `encode_report`."""

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
    """Return the length of the message at ``at``; 0 where more bytes are needed to tell, -1 where there is none."""
    return length_of(_map_end, buffer, at, MAX_MESSAGE)


def _map_end(buffer: bytes, at: int) -> int:
    fields = buffer[at] - FIXMAP
    if not _FEWEST <= fields <= _MOST:
        raise Wrong
    at += 1
    seen = set()
    for _ in range(fields):
        key, at = known_key(buffer, at, _KEYS)
        if key in seen:
            raise Wrong
        seen.add(key)
        at = _value_end(buffer, at)
    return at


def _value_end(buffer: bytes, at: int) -> int:
    """Return where a number, a flag, a text, nil or a pair of numbers ends."""
    head = byte_at(buffer, at)
    if head == FIXARRAY + 2:
        return _number_end(buffer, _number_end(buffer, at + 1))
    if FIXSTR <= head < FIXSTR + 32:
        return within(buffer, at + 1 + head - FIXSTR)
    if head == STR8:
        size = byte_at(buffer, at + 1)
        if size > MAX_TEXT:
            raise Wrong
        return within(buffer, at + 2 + size)
    return _number_end(buffer, at)


def _number_end(buffer: bytes, at: int) -> int:
    length = _LENGTHS.get(byte_at(buffer, at))
    if length is None:
        raise Wrong
    return within(buffer, at + length)


def parse(data: bytes) -> Message | None:
    """Return what a measured message says; None where a value is impossible."""
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
    well = (
        isinstance(name, str)
        and _NAME.fullmatch(name)
        and _is_range(body["width_range_m"], MAX_WIDTH_M)
        and _is_range(body["force_range_n"], MAX_FORCE_N)
        and (speeds is None or _is_range(speeds, MAX_SPEED_MPS))
    )
    if not well:
        return None
    widths, forces = _pair(body["width_range_m"]), _pair(body["force_range_n"])
    return Registration(name, widths, forces, None if speeds is None else _pair(speeds))


def _report(body: dict[str, Any]) -> Report | None:
    moving = body.get("moving", False)
    answer, applied_n = body.get("id"), body.get("applied_n")
    found = body.get("object", "moving" if moving else "none")
    fault, error = body.get("fault", ""), body.get("error", "")
    well = (
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
    if not well:
        return None
    width_m, force_n = _float(body["width_m"]), _float(body.get("force_n"))
    active = body.get("active", True)
    return Report(width_m, active, moving, found, fault, force_n, answer, _float(applied_n), error)


def _is_number(value: Any, low: float, high: float) -> bool:
    """Say whether a value is a number within bounds, or nil."""
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
    """Return a driver's registration.

    Args:
        registration: Its name (letters, digits, spaces and ``_./-``; no other may register behind it), and the
            least and largest width between the pads, m, force on one pad, N, and speed, m/s (None: none can be asked).

    Raises:
        ValueError: The daemon would not take it.
    """
    body: dict[str, Any] = {"v": VERSION, "name": registration.name}
    body |= {"width_range_m": registration.width_range_m, "force_range_n": registration.force_range_n}
    if registration.speed_range_mps is not None:
        body["speed_range_mps"] = registration.speed_range_mps
    return _checked(body)


def encode_report(report: Report) -> bytes:
    """Return a driver's report or answer.

    Raises:
        ValueError: The daemon would not take it.
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
        raise ValueError(f"{body} is no message of a gripper's driver: numbers are finite and within their bounds")
    return data


def encode_setpoint(setpoint_id: int, operation: str, **values: float | None) -> bytes:
    """Return a set-point: "activate", "move", "force", "stop" or "acknowledge", with its values in SI units."""
    data: bytes = msgpack.packb({"v": VERSION, "id": setpoint_id, "op": operation, **values})
    return data


def encode_notice(key: str, text: str) -> bytes:
    """Return what the daemon says of a registration or of a driver: `REGISTERED` or `REFUSED`, and to whom or why."""
    data: bytes = msgpack.packb({"v": VERSION, key: text})
    return data
