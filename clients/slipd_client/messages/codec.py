"""Encode and decode one msgpack map, and refuse what a hostile or broken peer may send.

By default msgpack accepts duplicate keys, NaN, extension types and nested huge arrays. Each of them can mislead or
stall the reader, so `decode` refuses them before anyone looks at the content. A message of another version, or with a
known field of another kind, is refused too: a program must not steer by a guess. Unknown fields and topics are ignored.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from math import isfinite
from typing import Any

import msgpack

from slipd_client.errors import MessageError
from slipd_client.messages.fields import read_fields
from slipd_client.messages.names import PROTOCOL_VERSION
from slipd_client.messages.topics import TOPICS, Message

_HEADER = {"seq": int, "boot": str, "t_ns": int}
"""What a subscriber needs to order a message."""


def read(frames: list[bytes]) -> tuple[str, dict[str, Any]]:
    """Return topic and map of the frames of one message of this version.

    Raises:
        MessageError: The frames are no such message.
    """
    if len(frames) != 2:
        raise MessageError("malformed", f"a message must have two frames, got {len(frames)}")
    try:
        topic = frames[0].decode()
    except UnicodeDecodeError as error:
        raise MessageError("malformed", f"the topic must be UTF-8: {error}") from error
    raw = decode(frames[1], MESSAGE_LIMITS)
    if raw.get("v") != PROTOCOL_VERSION:
        rule = f"the version of the API must be {PROTOCOL_VERSION}, got {raw.get('v')!r:.40}"
        raise MessageError("unsupported_version", rule, "v")
    for field, kind in _HEADER.items():
        if type(raw.get(field)) is not kind:
            raise MessageError(
                "bad_type", f"{field} must be of type {kind.__name__}, got {raw.get(field)!r:.40}", field
            )
    return topic, raw


def typed_message(topic: str, raw: dict[str, Any], missed: int = 0, restarted: bool = False) -> Message:
    """Return the message of a topic as its class, or as `Message` where this client does not know the topic.

    Args:
        topic: Topic of the message.
        raw: Its map.
        missed: Number of messages just before it that did not arrive.
        restarted: The daemon was restarted before it.

    Raises:
        MessageError: A field that must be there is missing, or a field is of another kind.
    """
    cls = TOPICS.get(topic.partition(".")[0], Message)
    return cls(topic=topic, raw=raw, missed=missed, restarted=restarted, **read_fields(cls, raw))


class RunOrder:
    """The numbers of the messages of one run of the daemon: which repeat, and how many did not arrive."""

    def __init__(self) -> None:
        self._seq: dict[str, int] = {}
        self._known: set[tuple[str, str]] = set()  # topics and fingers of the messages so far

    def accept(self, topic: str, raw: dict[str, Any], restarted: bool = False) -> Message | None:
        """Return a message as its class; None for a repeat: after a reconnection the last of each topic comes again.

        Raises:
            MessageError: See `typed_message`.
        """
        seq = raw["seq"]
        last = self._seq.get(topic, seq - 1)
        if seq <= last:
            return None
        about = topic, str(raw.get("finger"))
        # who comes late gets the last warning of each finger, and none of those between them
        message = typed_message(topic, raw, seq - last - 1 if about in self._known else 0, restarted)
        self._seq[topic] = seq
        self._known.add(about)
        return message


MAX_DEPTH = 6
"""Nested maps and lists; the deepest message (a stream in ``status``) has three levels."""


@dataclass(frozen=True)
class Limits:
    """How large a message may be.

    Attributes:
        data_bytes: Of the whole message.
        text_bytes: Of one string or byte string.
        items: Entries of one list or map.
        values: Entries of all of them together.
    """

    data_bytes: int
    text_bytes: int
    items: int
    values: int


REQUEST_LIMITS = Limits(data_bytes=16 * 1024, text_bytes=1024, items=64, values=256)
"""A request has fewer than ten short fields. With 64 entries a list, nested list headers take less than 0.2 ms to
decode; 256 entries in all do the same for many short lists, which would take 7 ms."""

CHECK_LIMITS = Limits(data_bytes=256 * 1024, text_bytes=1024, items=2000, values=24_100)
"""A request of ``motion.check`` with 2,000 points of ten numbers each."""

_CHECK = b"\xa2op\xacmotion.check"

MESSAGE_LIMITS = Limits(data_bytes=256 * 1024, text_bytes=4096, items=4096, values=16_384)
"""A pad image of 64 by 64 taxels, or a status of a few dozen streams."""


_PACKER = msgpack.Packer()  # shared: creating one for each message costs as much as the packing


def encode(body: dict[str, Any]) -> bytes:
    """Pack a map of plain values (None, bool, int, float, str, bytes, list, tuple, dict).

    Numbers are not checked, to keep the hot path short. A quantity that is not known must already be None, because
    the other end refuses NaN and infinity.

    Raises:
        TypeError: A value is of another type, e.g. a NumPy number.
    """
    packed: bytes = _PACKER.pack(body)
    return packed


def request_limits(data: bytes) -> Limits:
    """Return how large a packed request may be: those of ``motion.check`` bring a whole trajectory."""
    return CHECK_LIMITS if _CHECK in data else REQUEST_LIMITS


def decode(data: bytes, limits: Limits = REQUEST_LIMITS) -> dict[str, Any]:
    """Unpack one map of plain values with string keys and finite numbers.

    Raises:
        MessageError: "malformed", or "not_finite" for NaN and infinity.
    """
    if len(data) > limits.data_bytes:
        raise MessageError("malformed", f"a message must have at most {limits.data_bytes} bytes, got {len(data)}")
    count = _Count(limits.values)
    try:
        body = msgpack.unpackb(
            data,
            list_hook=count.on_list,
            object_pairs_hook=count.on_map,
            max_str_len=limits.text_bytes,
            max_bin_len=limits.text_bytes,
            max_array_len=limits.items,
            max_map_len=limits.items,
        )
    except MessageError:
        raise
    except ValueError as error:  # every fault msgpack finds, broken UTF-8 included
        raise MessageError(
            "malformed", f"the bytes must be one msgpack value: {str(error) or type(error).__name__}"
        ) from error
    if type(body) is not dict:
        raise MessageError("malformed", f"the message must be a map, got {type(body).__name__}")
    try:
        _check(body, "", MAX_DEPTH)
    except MessageError as error:
        if type(number := body.get("id")) in (str, int):
            error.number = number
        raise
    return body


class _Count:
    """Counts the entries of each list and map as it is read, so that reading ends where there are too many."""

    def __init__(self, most: int) -> None:
        self._most = self._left = most

    def on_list(self, items: list[Any]) -> list[Any]:
        self._count(len(items))
        return items

    def on_map(self, pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
        self._count(len(pairs))
        body = dict(pairs)
        if len(body) != len(pairs):
            raise MessageError("malformed", "a map must not hold the same key twice")
        return body

    def _count(self, entries: int) -> None:
        self._left -= entries + 1
        if self._left < 0:
            raise MessageError("malformed", f"all lists and maps together must have at most {self._most} entries")


def _are_finite(values: list[Any], *, nested: bool) -> bool:
    """Return whether a list holds finite floats alone, or ``nested`` rows of them: a fast check of pads and paths."""
    if nested and type(next(iter(values), None)) is list and set(map(type, values)) == {list}:
        values = list(chain.from_iterable(values))
    return set(map(type, values)) == {float} and isfinite(sum(values))  # numbers with a finite sum are finite


def _check(value: Any, field: str, depth: int) -> None:
    """Refuse what msgpack accepts and slipd does not; ``depth`` is how many levels may follow."""
    kind = type(value)
    if kind is float:
        if not isfinite(value):
            raise MessageError(
                "not_finite", f"a number must be finite, got {value}; nil stands for an unknown quantity", field
            )
    elif kind is dict or kind is list:
        if depth == 0:
            raise MessageError("malformed", f"lists and maps must be nested at most {MAX_DEPTH} deep", field)
        if kind is list and _are_finite(value, nested=depth > 1):
            return
        for key, item in value.items() if kind is dict else enumerate(value):
            if kind is dict and type(key) is not str:
                raise MessageError("malformed", f"every key must be a string, got {key!r:.40}", field)
            _check(item, f"{field}.{key}" if field else str(key), depth - 1)
    elif kind not in (str, int, bool, bytes, type(None)):
        raise MessageError(
            "malformed",
            f"a value must be nil, a boolean, number, string, byte string, list or map, got {kind.__name__}",
            field,
        )
