"""Questions to the DSACON32m and its answers, both ways. Source: both Schunk libraries of the SDH hand."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from slipd.devices.weiss import BEHIND_PREAMBLE, STATUS_WORDS, encode

CONTROLLER = 0x01
SENSOR = 0x02
ACQUIRE = 0x03
MATRIX = 0x0B

_CONTROLLER = struct.Struct("<HIBHBBBBIB")  # the library's struct has a byte more, which the device does not send
_SENSOR = struct.Struct("<HHHBIB")
_MATRIX = struct.Struct("<H2f2H6s2sB3f3ffB")
_ACQUIRE = struct.Struct("<BH")

REPLY_SIZES = {CONTROLLER: _CONTROLLER.size, SENSOR: _SENSOR.size, ACQUIRE: 2, MATRIX: _MATRIX.size}
REQUEST_SIZES = {CONTROLLER: 0, SENSOR: 0, ACQUIRE: _ACQUIRE.size, MATRIX: 1}

ALREADY_RUNNING = 4

ERROR_WORDS = (*STATUS_WORDS[:12], *STATUS_WORDS[13:29])
"""By number: as the other Weiss controllers up to 11, then without their 12, "no parameter expected"."""

TYPE_DSACON32 = 1
_TYPES = ("DSACON16", "DSACON32", "DSA100-256")

_OPERABLE = 0x80
_PUSH = 0x80
_RLE = 0x01
_RS232 = 0x10
_REVISION = 0x20
_FIRMWARE = 288
_PITCH_MM = 3.4
_FULL_SCALE = 4095.0


@dataclass(frozen=True)
class ControllerInfo:
    """What the controller says of itself.

    Attributes:
        serial: Its serial number.
        kind: Number of its type; `TYPE_DSACON32` is the one whose images are known.
        operable: It says that it can measure.
    """

    serial: int
    kind: int = TYPE_DSACON32
    operable: bool = True

    @property
    def kind_name(self) -> str:
        """The type's name, for people."""
        return _TYPES[self.kind] if self.kind < len(_TYPES) else f"{self.kind}"


def ask(packet_id: int, payload: bytes = b"") -> bytes:
    """Return a question; one without payload has no checksum."""
    return encode(packet_id, payload, BEHIND_PREAMBLE, bare=True)


def ask_matrix(index: int) -> bytes:
    """Return the question for the form of matrix ``index``."""
    return ask(MATRIX, bytes((index,)))


def acquire(rate_hz: int, *, rle: bool) -> bytes:
    """Return the request for images at ``rate_hz``; at 0 they stop, as firmware from 276 on wants it: bit 7 clear."""
    return ask(ACQUIRE, _ACQUIRE.pack((_PUSH if rate_hz else 0) | (_RLE if rle else 0), rate_hz))


def parse_acquire(payload: bytes) -> tuple[int, bool]:
    """Return the rate that a request asks for, Hz, 0 for none, and whether run-length encoded."""
    flags, rate_hz = _ACQUIRE.unpack(payload)
    return rate_hz if flags & _PUSH else 0, bool(flags & _RLE)


def encode_error(packet_id: int, error: int = 0) -> bytes:
    """Return an answer that is nothing but its error number; 0 is none."""
    return encode(packet_id, error.to_bytes(2, "little"), BEHIND_PREAMBLE)


def encode_controller(info: ControllerInfo) -> bytes:
    """Return the answer about the controller."""
    status = _OPERABLE if info.operable else 0
    payload = _CONTROLLER.pack(0, info.serial, _REVISION, _FIRMWARE, status, _RS232, info.kind, 0, 0, 0)
    return encode(CONTROLLER, payload, BEHIND_PREAMBLE)


def parse_controller(payload: bytes) -> ControllerInfo:
    """Return what a whole answer about the controller says."""
    _, serial, _, _, status, _, kind, *_ = _CONTROLLER.unpack(payload)
    return ControllerInfo(serial, kind, bool(status & _OPERABLE))


def encode_sensor(matrices: int, serial: int, error: int = 0) -> bytes:
    """Return the answer about the sensor: how many matrices it has, and its serial number."""
    return encode(SENSOR, _SENSOR.pack(error, matrices, 0x0120, 1, serial, 0), BEHIND_PREAMBLE)


def parse_sensor(payload: bytes) -> int:
    """Return how many matrices a whole answer about the sensor tells of."""
    matrices: int = _SENSOR.unpack(payload)[1]
    return matrices


def encode_matrix(cols: int, rows: int) -> bytes:
    """Return the answer about a matrix."""
    zeros = (0.0,) * 6
    unique, reserved = bytes(range(1, 7)), bytes(2)
    payload = _MATRIX.pack(0, _PITCH_MM, _PITCH_MM, cols, rows, unique, reserved, 0x10, *zeros, _FULL_SCALE, 0)
    return encode(MATRIX, payload, BEHIND_PREAMBLE)


def parse_matrix(payload: bytes) -> tuple[int, int]:
    """Return columns and rows of a whole answer about a matrix."""
    _, _, _, cols, rows, *_ = _MATRIX.unpack(payload)
    return cols, rows
