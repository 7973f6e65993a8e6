"""One msgpack map to bytes and back, refusing what a hostile or broken peer may send.

msgpack accepts duplicate keys, NaN, extension types and nests of huge arrays by default; each of them is a
way to mislead or stall the reader, so ``decode`` refuses them before anyone looks at the content.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

import msgpack

from slipd_client.messages.names import ErrorCode

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
"""A request has under ten short fields; 64 entries a list keep a nest of list headers below 0.2 ms, and 256 in all a
bush of short lists, which would take 7 ms."""

MESSAGE_LIMITS = Limits(data_bytes=256 * 1024, text_bytes=4096, items=4096, values=16_384)
"""A pad image of 64 by 64 taxels, or a status of a few dozen streams."""


class MessageError(ValueError):
    """Bytes that are no acceptable message.

    Attributes:
        code: What kind of fault, as in the ``error`` of a reply.
        message: What is wrong and what would be right.
        field: Dotted path of the field at fault; "" where no single field is.
    """

    def __init__(self, code: ErrorCode, message: str, field: str = "") -> None:
        self.code: ErrorCode = code
        self.message = message
        self.field = field
        super().__init__(fault_text(code, message, field))


def fault_text(code: str, message: str, field: str) -> str:
    """Return a fault in one line for people; the field is named once."""
    named = not field or message.startswith((f"{field} ", f"{field}: "))
    return f"{code}: {message}" if named else f"{code}: {field}: {message}"


_PACKER = msgpack.Packer()  # kept: making one for each message costs as much as the packing


def encode(body: dict[str, Any]) -> bytes:
    """Pack a map of plain values (None, bool, int, float, str, bytes, list, tuple, dict).

    Numbers are not looked at, to keep the hot path short: a quantity that is not known must be None already,
    for the other end refuses NaN and infinity.

    Raises:
        TypeError: A value is of another type, e.g. a NumPy number.
    """
    packed: bytes = _PACKER.pack(body)
    return packed


def decode(data: bytes, limits: Limits = REQUEST_LIMITS) -> dict[str, Any]:
    """Unpack one map of plain values with string keys and finite numbers.

    Raises:
        MessageError: "malformed", or "not_finite" for NaN and infinity.
    """
    if len(data) > limits.data_bytes:
        raise MessageError("malformed", f"{len(data)} bytes; at most {limits.data_bytes} are read")
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
        raise MessageError("malformed", f"not one msgpack value: {error or type(error).__name__}") from error
    if type(body) is not dict:
        raise MessageError("malformed", f"a map is expected, this is {type(body).__name__}")
    _check(body, "", MAX_DEPTH)
    return body


class _Count:
    """Judges each list and map as soon as it is read, so that what holds too many is not read to its end."""

    def __init__(self, most: int) -> None:
        self._most = self._left = most

    def on_list(self, items: list[Any]) -> list[Any]:
        self._take(len(items))
        return items

    def on_map(self, pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
        self._take(len(pairs))
        body = dict(pairs)
        if len(body) != len(pairs):
            raise MessageError("malformed", "a key stands twice in one map")
        return body

    def _take(self, entries: int) -> None:
        self._left -= entries + 1
        if self._left < 0:
            raise MessageError("malformed", f"more than {self._most} entries in all lists and maps together")


def _check(value: Any, field: str, depth: int) -> None:
    """Refuse what msgpack lets through; ``depth`` is how much deeper the value may go."""
    kind = type(value)
    if kind is float:
        if not isfinite(value):
            raise MessageError("not_finite", f"{value} is no quantity; nil says that it is not known", field)
    elif kind is dict or kind is list:
        if depth == 0:
            raise MessageError("malformed", f"nested more than {MAX_DEPTH} deep", field)
        if kind is list and set(map(type, value)) == {float} and all(map(isfinite, value)):
            return  # a pad image, in a third of the time
        for key, item in value.items() if kind is dict else enumerate(value):
            if kind is dict and type(key) is not str:
                raise MessageError("malformed", f"key {key!r} is no string", field)
            _check(item, f"{field}.{key}" if field else str(key), depth - 1)
    elif kind not in (str, int, bool, bytes, type(None)):
        raise MessageError("malformed", f"{kind.__name__} is no plain value", field)
