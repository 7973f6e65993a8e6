"""Encode and decode frames, commands and metadata of ZMTP 3.1 (ZeroMQ RFC 37). Pure."""

from __future__ import annotations

import struct
from collections.abc import Mapping

MORE, LARGE, COMMAND = 0x01, 0x02, 0x04
"""Flags of a frame; the other bits are reserved."""

GREETING_BYTES = 64

_SHORT_HEAD, _LARGE_HEAD = 2, 9
_LONGEST_SHORT = 255


class ProtocolError(Exception):
    """A peer violated ZMTP or the limits of this endpoint; its connection ends."""


def encode_frame(body: bytes, flags: int = 0) -> bytes:
    """Return a frame as it goes on the wire."""
    size = len(body)
    if size <= _LONGEST_SHORT:
        return bytes((flags, size)) + body
    return struct.pack(">BQ", flags | LARGE, size) + body


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
        value_at = name_end + 4
        end = value_at + int.from_bytes(data[name_end:value_at], "big")
        if value_at > len(data) or end > len(data):
            raise ProtocolError("the metadata of the handshake is truncated")
        properties[data[at + 1 : name_end].lower()] = data[value_at:end]
        at = end
    return properties


def next_frame(data: bytearray, most_bytes: int) -> tuple[int, bytes] | None:
    """Remove the first frame from received bytes, and return its flags and body; None until it is complete.

    Args:
        data: The received bytes.
        most_bytes: Longest frame; a longer one is refused by its header, before its body arrives.

    Raises:
        ProtocolError: Reserved flags, or a frame longer than ``most_bytes``.
    """
    if not data:
        return None
    flags = data[0]
    if flags & ~(MORE | LARGE | COMMAND):
        raise ProtocolError(f"a frame has reserved flags (0x{flags:02x})")
    head = _LARGE_HEAD if flags & LARGE else _SHORT_HEAD
    if len(data) < head:
        return None
    size = int.from_bytes(data[1:head], "big")
    if size > most_bytes:
        raise ProtocolError(f"a frame has {size} bytes; at most {most_bytes} are allowed here")
    end = head + size
    if len(data) < end:
        return None
    body = bytes(data[head:end])
    del data[:end]
    return flags & ~LARGE, body
