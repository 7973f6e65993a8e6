"""Packets of the Robotous RFT series: byte layout, encoders and parsers for both ends of the line.

Commands have 11 bytes, responses 19: ``55``, eight or sixteen bytes of data that begin with the command number, their
sum modulo 256, ``AA``. A reading has, big-endian, force x y z and torque x y z (6 × i16), overload bits (u8), and two
unused bytes. Source: Robotous RFT sample source, Rev 1.2.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from slipd.devices.shared.padded_text import strip_padding

SYNC = b"\x55"
RESPONSE_LENGTH = 19
COMMAND_LENGTH = 11

PRODUCT_NAME, SERIAL_NUMBER = 1, 2
SET_FILTER, GET_FILTER = 8, 9
READ_ONCE, START, STOP = 10, 11, 12
SET_RATE, GET_RATE = 15, 16
READINGS = (READ_ONCE, START)

_ANSWERS = frozenset((PRODUCT_NAME, SERIAL_NUMBER, SET_FILTER, GET_FILTER, SET_RATE, GET_RATE))
_END = 0xAA
_READING = struct.Struct(">6hB2x")
_UNKNOWN_OVERLOAD = 0xC0
_NAME_LENGTH = 15


def is_valid_response(buffer: bytes, at: int) -> bool:
    """Return whether the 19 bytes from ``at`` are a valid response."""
    number = buffer[at + 1]
    if buffer[at + 18] != _END or (number not in READINGS and number not in _ANSWERS):
        return False
    if number in READINGS and buffer[at + 14] & _UNKNOWN_OVERLOAD:
        return False
    return sum(buffer[at + 1 : at + 17]) & 0xFF == buffer[at + 17]


def encode_command(number: int, arguments: bytes = b"") -> bytes:
    """Return a command with up to seven bytes of arguments."""
    return _encode(bytes((number,)) + arguments, COMMAND_LENGTH)


def encode_response(number: int, content: bytes = b"") -> bytes:
    """Return a response with up to fifteen bytes of content."""
    return _encode(bytes((number,)) + content, RESPONSE_LENGTH)


def encode_reading(counts: Sequence[int], overload: int = 0, number: int = START) -> bytes:
    """Return a reading as the sensor sends it.

    Args:
        counts: Force x y z, torque x y z; each within an int16.
        overload: One bit per axis, from 0x20 (force x) to 0x01 (torque z).
        number: The command that it answers: `READ_ONCE` or `START`.
    """
    return encode_response(number, _READING.pack(*counts, overload))


def parse_reading(buffer: bytes, at: int) -> tuple[tuple[int, ...], int, bytes]:
    """Return counts, overload bits and the two unused bytes of the reading at ``at``."""
    *counts, overload = _READING.unpack_from(buffer, at + 2)
    return tuple(counts), overload, buffer[at + 15 : at + 17]


def parse_name(content: bytes) -> str:
    """Return the text in the answer to a request for a name; "" if it is not printable."""
    return strip_padding(content[:_NAME_LENGTH])


def parse_commands(received: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Parse the bytes that a sensor received.

    Returns:
        Number and arguments of each command, and the bytes to keep for the next call.
    """
    commands: list[tuple[int, bytes]] = []
    at = received.find(SYNC)
    while 0 <= at <= len(received) - COMMAND_LENGTH:
        data = received[at + 1 : at + 9]
        if sum(data) & 0xFF == received[at + 9] and received[at + 10] == _END:
            commands.append((data[0], data[1:]))
            at += COMMAND_LENGTH
        else:
            at += 1
        at = received.find(SYNC, at)
    return commands, received[at:] if at >= 0 else b""


def _encode(data: bytes, length: int) -> bytes:
    data = data.ljust(length - 3, b"\0")
    return SYNC + data + bytes((sum(data) & 0xFF, _END))
