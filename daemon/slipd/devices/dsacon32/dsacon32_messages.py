"""Requests to the DSACON32m and its answers: byte layout, encoders and parsers for both ends of the line.

Source: both Schunk libraries of the SDH hand.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from slipd.devices.shared.weiss_packets import SEED_AFTER_PREAMBLE, STATUS_WORDS, encode

CONTROLLER = 0x01
SENSOR = 0x02
ACQUIRE = 0x03
MATRIX = 0x0B

_CONTROLLER = struct.Struct("<HIBHBBBBIB")  # the library's struct has one more byte, which the device does not send
_SENSOR = struct.Struct("<HHHBIB")
_MATRIX = struct.Struct("<H2f2H6s2sB3f3ffB")
_ACQUIRE = struct.Struct("<BH")

REPLY_SIZES = {CONTROLLER: _CONTROLLER.size, SENSOR: _SENSOR.size, ACQUIRE: 2, MATRIX: _MATRIX.size}
REQUEST_SIZES = {CONTROLLER: 0, SENSOR: 0, ACQUIRE: _ACQUIRE.size, MATRIX: 1}

ALREADY_RUNNING = 4

ERROR_WORDS = (*STATUS_WORDS[:12], *STATUS_WORDS[13:29])
"""Meaning of each error number: that of the other Weiss controllers, without their 12, "no parameter expected"."""

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
    """Identity and condition of the controller.

    Attributes:
        serial: Serial number.
        kind: Number of its type; only the image format of `TYPE_DSACON32` is known.
        operable: Whether it reports that it can measure.
    """

    serial: int
    kind: int = TYPE_DSACON32
    operable: bool = True

    @property
    def kind_name(self) -> str:
        """The type's name, for people."""
        return _TYPES[self.kind] if self.kind < len(_TYPES) else f"{self.kind}"


def encode_query(packet_id: int, payload: bytes = b"") -> bytes:
    """Return a request; one without payload has no checksum."""
    return encode(packet_id, payload, SEED_AFTER_PREAMBLE, bare=True)


def encode_matrix_query(index: int) -> bytes:
    """Return the request for columns and rows of matrix ``index``."""
    return encode_query(MATRIX, bytes((index,)))


def acquire(rate_hz: int, *, rle: bool) -> bytes:
    """Return the request for images at ``rate_hz``; 0 stops them (bit 7 clear, as firmware from 276 on requires)."""
    return encode_query(ACQUIRE, _ACQUIRE.pack((_PUSH if rate_hz else 0) | (_RLE if rle else 0), rate_hz))


def parse_acquire(payload: bytes) -> tuple[int, bool]:
    """Return the requested rate, Hz, 0 for no images, and whether images are to be run-length encoded."""
    flags, rate_hz = _ACQUIRE.unpack(payload)
    return rate_hz if flags & _PUSH else 0, bool(flags & _RLE)


def encode_error(packet_id: int, error: int = 0) -> bytes:
    """Return an answer that consists of an error number alone; 0 is no error."""
    return encode(packet_id, error.to_bytes(2, "little"), SEED_AFTER_PREAMBLE)


def encode_controller(info: ControllerInfo) -> bytes:
    """Return the answer about the controller."""
    status = _OPERABLE if info.operable else 0
    payload = _CONTROLLER.pack(0, info.serial, _REVISION, _FIRMWARE, status, _RS232, info.kind, 0, 0, 0)
    return encode(CONTROLLER, payload, SEED_AFTER_PREAMBLE)


def parse_controller(payload: bytes) -> ControllerInfo:
    """Return the content of a complete answer about the controller."""
    _, serial, _, _, status, _, kind, *_ = _CONTROLLER.unpack(payload)
    return ControllerInfo(serial, kind, bool(status & _OPERABLE))


def encode_sensor(matrices: int, serial: int, error: int = 0) -> bytes:
    """Return the answer about the sensor: number of matrices and serial number."""
    return encode(SENSOR, _SENSOR.pack(error, matrices, 0x0120, 1, serial, 0), SEED_AFTER_PREAMBLE)


def parse_sensor(payload: bytes) -> int:
    """Return the number of matrices in a complete answer about the sensor."""
    matrices: int = _SENSOR.unpack(payload)[1]
    return matrices


def encode_matrix(cols: int, rows: int) -> bytes:
    """Return the answer about a matrix."""
    zeros = (0.0,) * 6
    unique, reserved = bytes(range(1, 7)), bytes(2)
    payload = _MATRIX.pack(0, _PITCH_MM, _PITCH_MM, cols, rows, unique, reserved, 0x10, *zeros, _FULL_SCALE, 0)
    return encode(MATRIX, payload, SEED_AFTER_PREAMBLE)


def parse_matrix(payload: bytes) -> tuple[int, int]:
    """Return columns and rows in a complete answer about a matrix."""
    _, _, _, cols, rows, *_ = _MATRIX.unpack(payload)
    return cols, rows
