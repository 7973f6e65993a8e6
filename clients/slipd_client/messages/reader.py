"""Turns the map of a message into its class: strict on what a program relies on, blind to what it does not know.

A message of another version, or with a known field of another type, is refused: to guess would be to steer by
it. Each class is taken apart once, so that reading a verdict costs a few microseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from typing import Any

from slipd_client.messages.codec import MESSAGE_LIMITS, MessageError, decode
from slipd_client.messages.names import PROTOCOL_VERSION, Health
from slipd_client.messages.typed import (
    FingerStatus,
    Grasp,
    Gripper,
    LeaseStatus,
    Message,
    RecordingStatus,
    ReflexAct,
    Slip,
    SlipLevel,
    SlipWarning,
    Status,
    StreamStatus,
    Tactile,
    Wrench,
)

_HEADER = {"seq": int, "boot": str, "t_ns": int}
"""What the receiver needs of every message to order it."""

OF_THE_RECEIVER = {"topic", "raw", "missed", "restarted"}
"""Fields of `Message` that do not stand in its map."""


def read(frames: list[bytes]) -> tuple[str, dict[str, Any]]:
    """Topic and map of the frames of one message of this version.

    Raises:
        MessageError: They are none.
    """
    if len(frames) != 2:
        raise MessageError("malformed", f"two frames are expected, these are {len(frames)}")
    try:
        topic = frames[0].decode()
    except UnicodeDecodeError as error:
        raise MessageError("malformed", f"the topic is no text: {error}") from error
    raw = decode(frames[1], MESSAGE_LIMITS)
    if raw.get("v") != PROTOCOL_VERSION:
        raise MessageError("unsupported_version", f"{raw.get('v')!r}; this client reads {PROTOCOL_VERSION}", "v")
    for field, kind in _HEADER.items():
        if type(raw.get(field)) is not kind:
            raise MessageError("bad_type", f"{kind.__name__} expected, this is {raw.get(field)!r}", field)
    return topic, raw


def typed_message(topic: str, raw: dict[str, Any], missed: int = 0, restarted: bool = False) -> Message:
    """The message of a topic, of its own class where this client knows the topic.

    Args:
        topic: Of the message.
        raw: Its map.
        missed: How many before it did not arrive.
        restarted: The daemon was started anew before it.

    Raises:
        MessageError: A field that must be there is not, or a field is of another type.
    """
    cls = _CLASSES.get(topic.partition(".")[0], Message)
    return cls(topic=topic, raw=raw, missed=missed, restarted=restarted, **_values(cls, raw))


def _values(cls: type[Any], raw: dict[str, Any]) -> dict[str, Any]:
    values = {}
    for name, wire, reader, required in _PLANS[cls]:
        value = raw.get(wire)
        if value is not None:
            try:
                values[name] = reader(value)
            except (TypeError, ValueError) as error:
                raise MessageError("bad_type", str(error), wire) from error
        elif required:
            raise MessageError("missing_field", "every message of this topic has it", wire)
    return values


def _number(value: Any) -> float:
    if type(value) is float:
        return value
    if type(value) is int:
        return float(value)
    raise TypeError(f"a number is expected, this is {value!r}")


def _exactly(kind: type[Any]) -> Callable[[Any], Any]:
    def read_exactly(value: Any) -> Any:
        if type(value) is not kind:
            raise TypeError(f"{kind.__name__} expected, this is {value!r}")
        return value

    return read_exactly


def _numbers(count: int | None) -> Callable[[Any], tuple[float, ...]]:
    def read_numbers(value: Any) -> tuple[float, ...]:
        if type(value) is not list or count not in (None, len(value)):
            raise TypeError(f"a list of {count or 'some'} numbers is expected, this is {value!r}")
        return tuple(map(_number, value))

    return read_numbers


def _list_of(reader: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    def read_list(value: Any) -> tuple[Any, ...]:
        if type(value) is not list:
            raise TypeError(f"a list is expected, this is {value!r}")
        return tuple(map(reader, value))

    return read_list


def _one(cls: type[Any]) -> Callable[[Any], Any]:
    def read_one(value: Any) -> Any:
        if type(value) is not dict:
            raise TypeError(f"a map is expected, this is {value!r}")
        return cls(**_values(cls, value))

    return read_one


def _map_of(reader: Callable[[Any], Any]) -> Callable[[Any], dict[str, Any]]:
    def read_map(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise TypeError(f"a map is expected, this is {value!r}")
        return {name: reader(entry) for name, entry in value.items()}

    return read_map


def _word(words: Mapping[Any, Any]) -> Callable[[Any], Any]:
    def read_word(value: Any) -> Any:
        if type(value) not in (str, int) or value not in words:
            raise ValueError(f"one of {', '.join(map(str, words))} is expected, this is {value!r}")
        return words[value]

    return read_word


_text, _pair = _exactly(str), _numbers(2)

_READERS: dict[str, Callable[[Any], Any]] = {
    "str": _text,
    "int": _exactly(int),
    "bool": _exactly(bool),
    "float": _number,
    "Pair": _pair,
    "Triple": _numbers(3),
    "SlipLevel": _word({level.value: level for level in SlipLevel}),
    "Health": _word({int(health): health for health in Health}),
    "tuple[str, ...]": _list_of(_text),
    "tuple[float, ...]": _numbers(None),
    "tuple[Pair, ...]": _list_of(_pair),
    "LeaseStatus": _one(LeaseStatus),
    "ReflexAct": _one(ReflexAct),
    "RecordingStatus": _one(RecordingStatus),
    "Mapping[str, float]": _map_of(_number),
    "Mapping[str, FingerStatus]": _map_of(_one(FingerStatus)),
    "Mapping[str, StreamStatus]": _map_of(_one(StreamStatus)),
}
"""By the annotation of a field, without its ``| None``."""


def _plan(cls: type[Any]) -> tuple[tuple[str, str, Callable[[Any], Any], bool], ...]:
    """Name, name on the wire, reader and whether it must be there, of each field that is read from the map."""
    return tuple(
        (
            each.name,
            each.metadata.get("wire", each.name),
            _READERS[str(each.type).removesuffix(" | None")],
            each.default is MISSING and each.default_factory is MISSING,
        )
        for each in fields(cls)
        if each.name not in OF_THE_RECEIVER
    )


_CLASSES: dict[str, type[Message]] = {
    "slip": Slip,
    "wrench": Wrench,
    "tactile": Tactile,
    "grasp": Grasp,
    "gripper": Gripper,
    "warning": SlipWarning,
    "status": Status,
}
_PARTS = (FingerStatus, StreamStatus, LeaseStatus, ReflexAct, RecordingStatus)
_PLANS = {cls: _plan(cls) for cls in (Message, *_PARTS, *_CLASSES.values())}
