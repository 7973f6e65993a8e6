"""The types of the package ``slipd_msgs``, made from the wire schema, and messages of the wire as values of them.

A ROS message knows no nil. What is not known is NaN in a float, -1 in a count, "unknown" in a text and an empty
sequence in a list; a boolean that may be unknown is an ``int8`` of 0, 1 and -1. Times are of type ``Time``: PlotJuggler
plots every number as a float, and refuses an integer that no float can hold.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from slipd_client.messages import topics
from slipd_client.messages.fields import (
    FLAG,
    INTEGER,
    LEVEL,
    NUMBER,
    PAIR,
    SEXTUPLE,
    TEXT,
    TRIPLE,
    Field,
    Kind,
    fields_of,
)
from slipd_client.messages.names import LEVELS, level_code
from slipd_client.messages.parts import HeldObject, LeaseStatus, ReflexAct
from slipd_client.messages.replies import MotionReply
from slipd_client.ros.ros_types import RosField, RosType

PACKAGE = "slipd_msgs"
UNKNOWN_COUNT, UNKNOWN_TEXT = -1, "unknown"
NAMES: dict[type[Any], str] = {
    topics.Slip: "Slip",
    topics.SlipWarning: "SlipWarning",
    topics.Wrench: "WrenchReading",
    topics.Tactile: "Tactile",
    topics.Grasp: "Grasp",
    topics.Motion: "Motion",
    topics.Gripper: "Gripper",
    LeaseStatus: "LeaseStatus",
    ReflexAct: "ReflexAct",
    HeldObject: "HeldObject",
    MotionReply: "MotionCheck",
}
"""Name of the type of each class of the wire; ``status`` becomes a ``diagnostic_msgs/DiagnosticArray``."""

_IN_HEADER = ("v", "timestamp", "frame")
"""Fields of every message that the header replaces; the version belongs to the wire."""

_HEADER = RosField("header", "std_msgs/Header", None, "time of acquisition, and frame of the vectors")
_OF_PLAN = RosField("header", "std_msgs/Header", None, "that of the planned motion")
_LEVELS = tuple(("int32", f"LEVEL_{level.upper()}", level_code(level)) for level in LEVELS)
_ASCII = str.maketrans({"−": "-", "π": "pi", "μ": "mu", "×": "x", "→": "->", "≤": "<=", "²": "^2", "`": "'"})  # noqa: RUF001
"""Characters that generators of ROS cannot be trusted with, and what stands for them."""
_UNITS = {
    "_n": "N", "_nm": "N m", "_m": "m", "_m2": "m^2", "_s": "s", "_hz": "Hz", "_a": "A", "_rad": "rad",
    "_mps2": "m/s^2", "_radps2": "rad/s^2",
}  # fmt: skip
_NS, _TIME = "_ns", "builtin_interfaces/Time"

_ELSEWHERE = re.compile(r"[;,] (see (below|\[[^]]*\]\([^)]*\))|in the order below)")
"""Pointers of a meaning to other places of docs/protocol.md."""

Convert = Callable[[Any], Any]


@dataclass(frozen=True)
class _Shape:
    """How a kind of the wire looks in ROS.

    Attributes:
        type: A primitive, "string", or a message as "package/Name".
        length: As in `RosField`.
        convert: Returns the value in ROS of a value on the wire, None included.
        unknown: What stands for nil, for people.
    """

    type: str
    length: int | None
    convert: Convert
    unknown: str


def _shape(kind: Kind, nullable: bool) -> _Shape:
    if kind in _SCALARS:
        return _SCALARS[kind]
    if kind is FLAG:
        return _Shape("int8", None, _integer, "-1") if nullable else _Shape("bool", None, bool, "false")
    if kind in _VECTORS:
        length = _VECTORS[kind]
        return _Shape("float64", length, lambda value: value or [math.nan] * length, "NaN")
    if kind.part is not None:
        name, convert = f"{PACKAGE}/{NAMES[kind.part]}", _part(kind.part)
        if nullable:
            return _Shape(name, -1, lambda value: [] if value is None else [convert(value)], "empty")
        return _Shape(name, None, lambda value: convert(value or {}), "unknown")
    if kind.inner is None:
        raise TypeError(f"a {kind.name} has no ROS type")
    return _map(kind.inner) if kind.name.startswith("map") else _list(kind.inner)


def _list(inner: Kind) -> _Shape:
    if inner is PAIR:
        return _Shape(
            "geometry_msgs/Point", -1, lambda values: [{"x": x, "y": y, "z": 0.0} for x, y in values or ()], "empty"
        )
    return _Shape(_SCALARS[inner].type, -1, lambda values: list(values or ()), "empty")


def _map(inner: Kind) -> _Shape:
    name, key = (NAMED_NUMBER.name, "value") if inner is NUMBER else (NAMED_WORDS.name, "words")
    return _Shape(
        name, -1, lambda values: [{"name": word, key: each} for word, each in (values or {}).items()], "empty"
    )


def _part(cls: type[Any]) -> Convert:
    plan = [(field.name, _ros_name(field), _field_shape(field).convert) for field in _kept(cls)]
    return lambda body: {name: convert(body.get(key)) for key, name, convert in plan}


def _kept(cls: type[Any]) -> list[Field]:
    return [field for field in fields_of(cls) if field.name not in _IN_HEADER]


def _ros_name(field: Field) -> str:
    """Return the name of a field in ROS; a time carries no unit."""
    return field.name.removesuffix(_NS) if field.kind is INTEGER else field.name


def _field_shape(field: Field) -> _Shape:
    if field.kind is INTEGER and field.name.endswith(_NS):
        return _Shape(_TIME, None, lambda t_ns: time_of(t_ns or 0), "0")
    if field.name == "seq":  # 2^31 messages are 99 days at 250 Hz
        return _Shape("int64", None, _integer, "-1")
    if field.name == "unknown":  # a reason; empty means that everything is known
        return _Shape("string", None, lambda reason: reason or "", "empty")
    return _shape(field.kind, field.nullable)


class TimeRangeError(ValueError):
    """A time does not fit ``builtin_interfaces/Time``."""


def time_of(t_ns: int) -> dict[str, int]:
    """Return a time in ns as ``builtin_interfaces/Time``.

    Raises:
        TimeRangeError: It is before 1901 or after January 2038, which the seconds of ROS 2, an int32, cannot hold.
    """
    seconds, nanoseconds = divmod(t_ns, 1_000_000_000)
    if not -(2**31) <= seconds < 2**31:
        text = "a time of ROS 2 must lie between 1901 and 2038-01-19 (int32 seconds)"
        raise TimeRangeError(f"{text}, got {seconds} s since 1970")
    return {"sec": seconds, "nanosec": nanoseconds}


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _integer(value: int | bool | None) -> int:
    return UNKNOWN_COUNT if value is None else int(value)


def _text(value: str | None) -> str:
    return UNKNOWN_TEXT if value is None else str(value)


_SCALARS = {
    NUMBER: _Shape("float64", None, _number, "NaN"),
    INTEGER: _Shape("int32", None, _integer, "-1"),
    TEXT: _Shape("string", None, _text, '"unknown"'),
    LEVEL: _Shape("string", None, _text, '"unknown"'),
}
_VECTORS = {PAIR: 2, TRIPLE: 3, SEXTUPLE: 6}

NAMED_NUMBER = RosType(
    f"{PACKAGE}/NamedNumber", (RosField("name", "string"), RosField("value", "float64")), (), "A number with its name."
)
NAMED_WORDS = RosType(
    f"{PACKAGE}/NamedWords", (RosField("name", "string"), RosField("words", "string", -1)), (), "Words with their name."
)


def _declare(cls: type[Any]) -> RosType:
    fields = [_HEADER] if issubclass(cls, topics.Message) else [_OF_PLAN] if cls is MotionReply else []
    fields += [_declared(field) for field in _kept(cls)]
    constants = _LEVELS if any(field.name == "level_code" for field in fields) else ()
    comment = (cls.__doc__ or "").strip().partition("\n")[0].replace("``", "`").translate(_ASCII)
    return RosType(f"{PACKAGE}/{NAMES[cls]}", tuple(fields), constants, comment)


def _declared(field: Field) -> RosField:
    shape = _field_shape(field)
    name = _ros_name(field)
    meaning = _ELSEWHERE.sub("", field.meaning)
    unit = next((f" [{unit}]" for end, unit in _UNITS.items() if name.endswith(end)), "")
    unknown = f"; {shape.unknown}: not known" if field.nullable and "nil" not in meaning else ""
    clock = ", by CLOCK_MONOTONIC of the daemon's machine" if shape.type == _TIME else ""
    comment = re.sub(r"\bnil\b", shape.unknown, meaning) + unit + clock + unknown
    return RosField(name, shape.type, shape.length, comment.translate(_ASCII))


SLIPD_TYPES = {kind.name: kind for kind in (NAMED_NUMBER, NAMED_WORDS, *map(_declare, NAMES))}
"""Every type of the package by its name, "package/Name"."""

CONVERTERS: dict[type[Any], Convert] = {cls: _part(cls) for cls in NAMES if issubclass(cls, topics.Message)}
"""Returns the fields of the type of each class of messages from a map of the wire, without the header."""

CHECKED = f"{PACKAGE}/{NAMES[MotionReply]}"
_checked = _part(MotionReply)


def motion_check(header: Mapping[str, Any], reply: Mapping[str, Any]) -> dict[str, Any]:
    """Return the reply to ``motion.check`` as a value of `CHECKED`.

    Args:
        header: Header of the planned motion.
        reply: Map of the reply; with ``unknown`` alone nothing is known of the motion.
    """
    return {"header": header, **_checked(reply)}
