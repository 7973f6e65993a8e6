"""Msgpack messages from other processes: maps of known keys in a stream that may contain anything.

msgpack waits for as many bytes as a length in the stream states, and unpacks lists and maps of any size. So a message
is read value by value: a wrong value is found before the next one arrives, and none is awaited for longer than a text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import msgpack

from slipd.devices.shared.frame_scanner import NO_FRAME

MAX_TEXT = 120
"""Longest text, bytes."""

MAX_ITEMS = 8
"""Most items of a list, except where its key allows more."""

_TOO_LONG = re.compile(rb"[\xc4-\xc9\xd4-\xd8\xda\xdb]|\xd9[^\x00-%c]" % MAX_TEXT, re.DOTALL)
"""First bytes of a text beyond `MAX_TEXT`, of binary data or of an extension type."""
_LISTS = frozenset(bytes((0x90 + items,)) for items in range(MAX_ITEMS + 1))
"""First byte of a list of up to `MAX_ITEMS` items."""


class MessageReader:
    """Reads the values of one message in order.

    Every method raises ValueError if the next value is not of its kind, and msgpack.OutOfData if its bytes have not
    arrived.

    Args:
        data: The bytes from the beginning of the message on.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._unpacker = msgpack.Unpacker(
            max_buffer_size=len(data),
            use_list=False,
            max_str_len=MAX_TEXT,
            max_array_len=MAX_ITEMS,
            max_map_len=0,
            max_bin_len=0,
            max_ext_len=0,
        )
        self._unpacker.feed(data)

    @property
    def length(self) -> int:
        """Length of what was read so far, bytes."""
        return int(self._unpacker.tell())

    def value(self) -> Any:
        """Return the next value: a number, text, flag or nil, or a list of up to `MAX_ITEMS` of them as a tuple."""
        begin = self._unpacker.tell()
        if self._data[begin : begin + 1] in _LISTS:
            return tuple(self.items(MAX_ITEMS))
        if _TOO_LONG.match(self._data, begin):
            raise ValueError("too long")
        return self._unpacker.unpack()

    def items(self, most: int) -> list[Any]:
        """Return the items of the list that comes next; each is a value, or a list of up to `MAX_ITEMS`."""
        count = self._unpacker.read_array_header()
        if count > most:
            raise ValueError("too many items")
        return [self._unpacker.unpack() for _ in range(count)]

    def fields(self, read_values: Mapping[str, ReadValue]) -> dict[str, Any]:
        """Return the next value: a map of known keys, each once.

        Args:
            read_values: Reads the value of each known key.
        """
        fields: dict[str, Any] = {}
        for _ in range(self._unpacker.read_map_header()):
            key = self.value()
            if not isinstance(key, str) or key not in read_values or key in fields:
                raise ValueError("unknown or repeated key")
            fields[key] = read_values[key](self)
        return fields


ReadValue = Callable[[MessageReader], Any]
"""``read_value(reader)`` returns the next value, or raises as the methods of the reader do."""

MessageT = TypeVar("MessageT")


def read_message(
    buffer: bytes, at: int, most: int, parse: Callable[[MessageReader], MessageT]
) -> tuple[int, MessageT | None]:
    """Read the message at ``at``, for `MessageScanner`.

    Args:
        buffer: Bytes received so far.
        at: Where the message begins.
        most: Length of the longest message, bytes.
        parse: ``parse(reader)`` returns the content of the message, or raises ValueError if its values are impossible.

    Returns:
        Its length and content; (0, None) if more bytes are needed; (`NO_FRAME`, None) if no message begins there.
    """
    reader = MessageReader(buffer[at : at + most])
    try:
        message = parse(reader)
    except msgpack.OutOfData:
        waits = len(buffer) - at < most and len(buffer) - at - reader.length <= MAX_TEXT
        return 0 if waits else NO_FRAME, None
    except ValueError:
        return NO_FRAME, None
    return reader.length, message


def checked(accepts: Callable[[Any], object]) -> ReadValue:
    """Return the function that reads a value which ``accepts(value)`` accepts."""

    def read_value(reader: MessageReader) -> Any:
        value = reader.value()
        if not accepts(value):
            raise ValueError("impossible value")
        return value

    return read_value


def converted(convert: Callable[[Any], Any]) -> ReadValue:
    """Return the function that reads a value and converts it; ``convert`` raises ValueError for a wrong one."""
    return lambda reader: convert(reader.value())


def are_numbers(values: Iterable[object]) -> bool:
    """Return whether all values are numbers, and none is true or false."""
    return {*map(type, values)} <= {int, float}
