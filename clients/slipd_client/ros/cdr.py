"""Bytes of ROS 2 messages: CDR, little-endian, as every ROS 2 middleware and bag has them (XCDR version 1).

Each value is aligned to its own size, counted from the end of the four bytes that state the encoding (OMG DDS-XTypes
1.3, 7.4.1 and 7.6.3.1.2). A string is its length with the final zero, its UTF-8 bytes, and the zero.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from slipd_client.ros.ros_types import PRIMITIVES, RosField, RosType

Write = Callable[[bytearray, Any], None]
"""Appends a value to a message."""

ENCAPSULATION = b"\x00\x01\x00\x00"
"""Plain CDR, little-endian, no options."""

_PADDING = tuple(bytes(count) for count in range(8))


class CdrError(ValueError):
    """A message that does not fit its type; the text begins with the path of the field."""


class CdrEncoder:
    """Encodes messages of one type.

    Args:
        name: "package/Name".
        types: Every type by its name.

    Raises:
        KeyError: A type is not declared.
    """

    def __init__(self, name: str, types: Mapping[str, RosType]) -> None:
        self._name = name
        self._write = _message(types[name], types)

    def encode(self, message: Mapping[str, Any]) -> bytes:
        """Return the bytes of a message.

        Args:
            message: A value for each field, by name: numbers, strings, sequences, and maps for messages.

        Raises:
            CdrError: A field is missing, is not declared, or its value does not fit.
        """
        out = bytearray(ENCAPSULATION)
        try:
            self._write(out, message)
        except CdrError as error:
            raise CdrError(f"{self._name}: {error}") from None
        return bytes(out)


def _message(kind: RosType, types: Mapping[str, RosType]) -> Write:
    if not kind.fields:
        raise ValueError(f"{kind.name} must have a field")
    writers = [(field.name, _field(field, types)) for field in kind.fields]

    def write(out: bytearray, message: Mapping[str, Any]) -> None:
        if len(message) > len(writers):
            stray = ", ".join(sorted(set(message) - {name for name, _ in writers}))
            raise CdrError(f"{stray}: not declared")
        for name, write_field in writers:
            try:
                write_field(out, message[name])
            except KeyError:
                raise CdrError(f"{name}: is missing") from None
            except CdrError as error:
                raise CdrError(f"{name}.{error}") from None
            except (struct.error, TypeError, AttributeError, UnicodeEncodeError) as error:
                wanted = next(field.type_text for field in kind.fields if field.name == name)
                raise CdrError(f"{name}: must be {wanted}: {error}") from None

    return write


def _field(field: RosField, types: Mapping[str, RosType]) -> Write:
    if field.length is None:
        return _single(field.type, types)
    if field.type in PRIMITIVES:
        return _numbers(PRIMITIVES[field.type], field.length)
    return _entries(_single(field.type, types), field.length)


def _single(kind: str, types: Mapping[str, RosType]) -> Write:
    if kind == "string":
        return _string
    return _number(PRIMITIVES[kind]) if kind in PRIMITIVES else _message(types[kind], types)


def _number(code: str) -> Write:
    packer = struct.Struct(f"<{code}")
    pack, mask = packer.pack, packer.size - 1

    def write(out: bytearray, value: float) -> None:
        out += _PADDING[(len(ENCAPSULATION) - len(out)) & mask]
        out += pack(value)

    return write


def _numbers(code: str, length: int) -> Write:
    mask = struct.calcsize(f"<{code}") - 1

    def write(out: bytearray, values: Sequence[float]) -> None:
        _begin(out, len(values), length)
        if isinstance(values, bytes) and not mask:
            out += values
        elif values:  # an empty sequence is not aligned
            out += _PADDING[(len(ENCAPSULATION) - len(out)) & mask]
            out += struct.pack(f"<{len(values)}{code}", *values)

    return write


def _entries(write_entry: Write, length: int) -> Write:
    def write(out: bytearray, values: Sequence[Any]) -> None:
        _begin(out, len(values), length)
        for value in values:
            write_entry(out, value)

    return write


def _begin(out: bytearray, count: int, length: int) -> None:
    """Write the number of entries of a sequence, or check that of an array."""
    if length < 0:
        _count(out, count)
    elif count != length:
        raise TypeError(f"got {count} entries")


_count = _number("I")


def _string(out: bytearray, text: str) -> None:
    data = text.encode()
    _count(out, len(data) + 1)
    out += data
    out += b"\x00"
