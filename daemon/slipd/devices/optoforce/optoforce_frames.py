"""Frames of an OptoForce DAQ's serial line: byte layout, what is asked of a DAQ, and parsers.

Every frame begins with a header of four bytes, the last of which is the length of the body, and ends with a 16-bit sum
of all bytes before it; all numbers are big-endian. The body of a reading is counter (u16), status (u16), and 3, 6 or 12
counts (i16). Source: OptoForce General DAQ manual.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from slipd.devices.shared.frame_scanner import NO_FRAME

ONE_3_AXIS, ONE_6_AXIS, FOUR_3_AXIS = b"\xaa\x07\x08\x0a", b"\xaa\x07\x08\x10", b"\xaa\x07\x08\x1c"
ACK, SERIAL_NUMBER = b"\xaa\x00\x50\x01", b"\xaa\x00\x12\x08"
NOMINAL, SENSITIVITY = b"\xaa\x01\x5e\x0e", b"\xaa\x01\xc2\x0e"
"""Frames of seven u16 that a six-axis DAQ sends among its readings (shadow-robot/optoforce#31).

No document that explains them was found, so this is unconfirmed. The first fits the nominal loads of a HEX-E, Fx Fy Fz
in N and Tx Ty Tz in N mm, and the second the counts at these loads, the two parts of a sensitivity report. The seventh
of each may be Fz in the other direction.
"""
SYNC = b"\xaa"
HEADER = 4
TYPICAL_LENGTH = 22
"""Length of a frame of one six-axis sensor, bytes."""

GET_SERIAL_NUMBER = b"\xab\x00\x12\x08\x00\xc5"

_SUM = 2
ANSWERS = frozenset((ACK, SERIAL_NUMBER, NOMINAL, SENSITIVITY))
_LENGTHS = {header: HEADER + header[3] + _SUM for header in (ONE_3_AXIS, ONE_6_AXIS, FOUR_3_AXIS, *ANSWERS)}
_REPORT = struct.Struct(">7H")
CONFIGURE = b"\xaa\x00\x32\x03"
_NO_TARE = 0


@dataclass(frozen=True, slots=True)
class Configuration:
    """Settings of a configure request.

    Attributes:
        period_ms: Period of the frames, ms; 0 stops them.
        filter_code: Code of the filter.
    """

    period_ms: int
    filter_code: int


def measure(buffer: bytes, at: int) -> int:
    """Return the length of the valid frame from the DAQ at ``at``, 0 if it is incomplete, else `NO_FRAME`."""
    if at + HEADER > len(buffer):
        return 0
    length = _LENGTHS.get(buffer[at : at + HEADER], NO_FRAME)
    if at + length > len(buffer):
        return 0
    return length if length > 0 and sum_matches(buffer[at : at + length]) else NO_FRAME


def encode_frame(header: bytes, body: bytes) -> bytes:
    """Return a frame of header, body and their sum."""
    frame = header + body
    return frame + (sum(frame) & 0xFFFF).to_bytes(2, "big")


def parse_report(nominal: bytes, counts: bytes) -> list[float]:
    """Return counts per N of x y z and per N·m of x y z from the bodies of `NOMINAL` and `SENSITIVITY`."""
    loads = [load * (1.0 if axis < 3 else 1e-3) for axis, load in enumerate(_REPORT.unpack(nominal)[:6])]
    return [count / load if load else 0.0 for count, load in zip(_REPORT.unpack(counts)[:6], loads, strict=True)]


def encode_configuration(configuration: Configuration) -> bytes:
    """Return the request that sets period and filter; it removes a tare and never sets one."""
    return encode_frame(CONFIGURE, bytes((configuration.period_ms, configuration.filter_code, _NO_TARE)))


def sum_matches(frame: bytes) -> bool:
    """Return whether a frame ends with its sum."""
    return sum(frame[:-_SUM]) & 0xFFFF == int.from_bytes(frame[-_SUM:], "big")
