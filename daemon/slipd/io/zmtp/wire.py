"""Encode and decode frames, commands and metadata of ZMTP 3.1 (ZeroMQ RFC 37). Pure."""

from __future__ import annotations

import struct
from collections.abc import Mapping

MORE, LARGE, COMMAND = 0x01, 0x02, 0x04
"""Flags of a frame; the other bits are reserved."""

GREETING_BYTES = 64

_SHORT_HEAD, _LARGE_HEAD = 2, 9
_LONGEST_SHORT = 255
_SPENT_BYTES = 16 * 1024
"""Consumed bytes that are kept before the rest is moved to the front."""


class ProtocolError(Exception):
    """A peer violated ZMTP or the limits of this endpoint; its connection ends."""


def encode_frame(body: bytes, flags: int = 0) -> bytes:
    """Return a frame as it goes on the wire."""
    size = len(body)
    if size <= _LONGEST_SHORT:
        return bytes((flags, size)) + body
    return struct.pack(">BQ", flags | LARGE, size) + body


def encode_message(frames: tuple[bytes, ...]) -> bytes:
    """Return a message of one or more frames as it goes on the wire."""
    return b"".join(encode_frame(frame, MORE) for frame in frames[:-1]) + encode_frame(frames[-1])


def encode_command(name: bytes, body: bytes = b"") -> bytes:
    """Return the body of a command frame."""
    return bytes((len(name),)) + name + body


def decode_command(body: bytes) -> tuple[bytes, bytes]:
    """Return name and data of a command.

    Raises:
        ProtocolError: The frame is shorter than the name in it.
    """
    end = 1 + body[0] if body else 1
    if len(body) < end:
        raise ProtocolError("a command is shorter than its name")
    return body[1:end], body[end:]


def encode_greeting(mechanism: bytes, *, as_server: bool) -> bytes:
    """Return the 64 bytes that each side sends first."""
    signature = b"\xff" + bytes(7) + b"\x01\x7f"
    return (signature + b"\x03\x01" + mechanism.ljust(20, b"\0") + bytes((as_server,))).ljust(GREETING_BYTES, b"\0")


def check_greeting(greeting: bytes, mechanism: bytes) -> None:
    """Refuse a peer with another protocol.

    Args:
        greeting: First ``GREETING_BYTES`` bytes of the peer.
        mechanism: The security mechanism of this endpoint.

    Raises:
        ProtocolError: Another protocol, a version before 3.0, or another mechanism.
    """
    if greeting[0] != 0xFF or greeting[9] != 0x7F:
        raise ProtocolError("the peer does not speak ZMTP")
    if greeting[10] < 3:
        raise ProtocolError("the peer must use ZMTP 3.0 or later, which ZeroMQ has since 4.0")
    if greeting[12:32].rstrip(b"\0") != mechanism:
        raise ProtocolError("the peer uses another security mechanism")


def encode_metadata(properties: Mapping[bytes, bytes]) -> bytes:
    """Return the properties that a READY command carries."""
    return b"".join(
        bytes((len(name),)) + name + struct.pack(">I", len(value)) + value for name, value in properties.items()
    )


def decode_metadata(data: bytes) -> dict[bytes, bytes]:
    """Return the properties of a READY or INITIATE command, names in lower case.

    Raises:
        ProtocolError: A name or value is longer than the data.
    """
    properties: dict[bytes, bytes] = {}
    at = 0
    while at < len(data):
        name_end = at + 1 + data[at]
        value_begin = name_end + 4
        if value_begin > len(data):
            raise ProtocolError("the metadata of the handshake is truncated")
        value_end = value_begin + int.from_bytes(data[name_end:value_begin], "big")
        if value_end > len(data):
            raise ProtocolError("the metadata of the handshake is truncated")
        properties[data[at + 1 : name_end].lower()] = data[value_begin:value_end]
        at = value_end
    return properties


class FrameReader:
    """Cut a stream of bytes into frames; it holds at most one frame more than the last bytes fed.

    Args:
        most_bytes: Longest frame; a longer one is refused by its header, before its body arrives.
    """

    def __init__(self, most_bytes: int) -> None:
        self.most_bytes = most_bytes
        self._data = bytearray()
        self._at = 0

    def feed(self, data: bytes) -> None:
        """Append received bytes."""
        if self._at == len(self._data):
            self._data[:] = data
            self._at = 0
            return
        if self._at > _SPENT_BYTES:
            del self._data[: self._at]
            self._at = 0
        self._data += data

    def read(self, size: int) -> bytes | None:
        """Return the next ``size`` bytes; None until they have arrived."""
        end = self._at + size
        if end > len(self._data):
            return None
        found = bytes(self._data[self._at : end])
        self._at = end
        return found

    def next(self) -> tuple[int, bytes] | None:
        """Return flags and body of the next frame; None until it is complete.

        Raises:
            ProtocolError: Reserved flags, or a frame longer than ``most_bytes``.
        """
        data, at = self._data, self._at
        left = len(data) - at
        if left < _SHORT_HEAD:
            return None
        flags = data[at]
        if flags & ~(MORE | LARGE | COMMAND):
            raise ProtocolError(f"a frame has reserved flags (0x{flags:02x})")
        if flags & LARGE:
            if left < _LARGE_HEAD:
                return None
            head, size = _LARGE_HEAD, int.from_bytes(data[at + 1 : at + _LARGE_HEAD], "big")
        else:
            head, size = _SHORT_HEAD, data[at + 1]
        if size > self.most_bytes:
            raise ProtocolError(f"a frame has {size} bytes; at most {self.most_bytes} are allowed here")
        if left < head + size:
            return None
        begin = at + head
        self._at = begin + size
        return flags & ~LARGE, bytes(data[begin : begin + size])
