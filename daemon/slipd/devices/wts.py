"""Weiss WTS and WTS-FT tactile modules: one matrix on USB or a serial line.

The module is asked what it is and what form its matrix has, and then pushes plain images. The layout of run-length
encoded ones is not confirmed: they are never asked for, and are no images. Source: the public WTS drivers, and the
contents of the command set manual.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slipd.devices import Device
from slipd.devices import weiss_tactile as tactile
from slipd.devices.weiss import STATUS_WORDS, WITH_PREAMBLE, encode
from slipd.devices.weiss_tactile import FULL_SCALE, MAX_CELLS, Question, TactileDecoder, TactileSession, Units
from slipd.samples import TactileSample

START = 0x21
STOP = 0x22
MATRIX = 0x30
SYSTEM = 0x50

MAX_INTERVAL_MS = 65_535
"""It is sent in two bytes."""

_FIRMWARE = 0x1000  # 1.0.0
_PITCH = 340  # 10 µm
_TYPICAL_BYTES = 77  # 4 x 8 cells
_ATTEMPTS = 4  # of the first question; how long a module boots is not known
_NOT_RUNNING = range(1, 1 << 16)
_ALREADY_RUNNING = (4,)

_SYSTEM = struct.Struct("<HBBHI")  # status, type, hardware revision, firmware, serial number
_MATRIX = struct.Struct("<6H")  # status, columns, rows, width and height of a cell in 10 µm, full scale
_START = struct.Struct("<BH")  # flags, interval in ms
REPLY_SIZES = {START: 2, STOP: 2, MATRIX: _MATRIX.size, SYSTEM: _SYSTEM.size}
REQUEST_SIZES = {START: _START.size, STOP: 0, MATRIX: 0, SYSTEM: 0}


@dataclass(frozen=True)
class Matrix:
    """Form of a module's matrix, by default that of a WTS-FT.

    Attributes:
        cols: Columns.
        rows: Rows.
        full_scale: Largest value of a cell, counts.
    """

    cols: int = 4
    rows: int = 8
    full_scale: int = FULL_SCALE


class Decoder(TactileDecoder):
    """Makes a sample of every plain image.

    ``values`` has shape (cols·rows,), counts, row by row. Status name: "saturated" (a cell is at full scale). Until
    the form of the matrix is known an image may have any number of cells, of 12 bits.
    """

    def __init__(self) -> None:
        super().__init__(WITH_PREAMBLE, REPLY_SIZES, _TYPICAL_BYTES)
        self._cells: int | None = None
        self._full_scale = FULL_SCALE

    def expect(self, matrix: Matrix) -> None:
        """Take the form of the matrix: what is of another is no image."""
        self._cells = matrix.cols * matrix.rows
        self._full_scale = matrix.full_scale

    def _admits_image(self, rle: bool, count: int, begun: Units) -> bool:
        return not rle and self._cells in (None, count) and not (begun > self._full_scale).any()

    def _images(self, rle: bool, units: Units, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        return [tactile.image(units, t_ns, device_time_ns, self._full_scale)]


def encode_frame(cells: Sequence[int] | Units, device_time_ms: int) -> bytes:
    """Return one plain image as the module sends it.

    Args:
        cells: Counts, integers from 0 to 65,535, shape (cells,).
        device_time_ms: The module's clock, ms; sent modulo 2^32.
    """
    return tactile.encode_frame(np.asarray(cells, dtype=np.uint16), device_time_ms, WITH_PREAMBLE)


def ask(packet_id: int) -> bytes:
    """Return a question that needs no payload."""
    return encode(packet_id, b"", WITH_PREAMBLE)


def start_request(interval_ms: int) -> bytes:
    """Return the request for plain images every ``interval_ms``, at 0 as fast as the module can."""
    return encode(START, _START.pack(0, interval_ms), WITH_PREAMBLE)


def parse_start(payload: bytes) -> int:
    """Return the interval that a request asks for, ms."""
    interval_ms: int = _START.unpack(payload)[1]
    return interval_ms


def encode_status(packet_id: int, status: int = 0) -> bytes:
    """Return an answer that is nothing but its status; 0 is well."""
    return encode(packet_id, status.to_bytes(2, "little"), WITH_PREAMBLE)


def encode_system(serial: int) -> bytes:
    """Return the answer about the module."""
    return encode(SYSTEM, _SYSTEM.pack(0, 1, 0, _FIRMWARE, serial), WITH_PREAMBLE)


def encode_matrix(matrix: Matrix) -> bytes:
    """Return the answer about the module's matrix."""
    form = (matrix.cols, matrix.rows, _PITCH, _PITCH, matrix.full_scale)
    return encode(MATRIX, _MATRIX.pack(0, *form), WITH_PREAMBLE)


class Session(TactileSession):
    """Learns module and matrix, and has the images pushed; `identity` is the module's serial number.

    Args:
        interval_ms: Time from one image to the next, 0 to 65,535 ms; at 0 they come as fast as the module can.

    Raises:
        ValueError: The interval is out of range, or no integer.
    """

    decoder: Decoder

    def __init__(self, interval_ms: int = 10) -> None:
        if not (isinstance(interval_ms, int) and 0 <= interval_ms <= MAX_INTERVAL_MS):
            raise ValueError(f"an interval of {interval_ms} ms is not supported: 0 to {MAX_INTERVAL_MS} is")
        stop = ask(STOP)
        questions = [
            Question("system information", ask(SYSTEM), attempts=_ATTEMPTS, reply_id=SYSTEM, take=self._take_system),
            Question("matrix information", ask(MATRIX), reply_id=MATRIX, take=self._take_matrix),
            Question("stop", stop, reply_id=STOP, forgives=_NOT_RUNNING),
            Question("start", start_request(interval_ms), reply_id=START, forgives=_ALREADY_RUNNING),
        ]
        super().__init__(Decoder(), questions, stop, STATUS_WORDS, interval_ms * 1_000_000)

    def _take_system(self, payload: bytes) -> str:
        self.identity = f"S/N {_SYSTEM.unpack(payload)[4]}"
        return ""

    def _take_matrix(self, payload: bytes) -> str:
        _, cols, rows, _, _, full_scale = _MATRIX.unpack(payload)
        if not 1 <= cols * rows <= MAX_CELLS or full_scale == 0:
            return f"matrix of {cols} x {rows} cells of {full_scale} counts: 1 to {MAX_CELLS} cells are supported"
        self.decoder.expect(Matrix(cols, rows, full_scale))
        return ""


DEVICE = Device(
    "wts",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1000.0 / MAX_INTERVAL_MS, 1000.0),
    baud=115_200,
    axes=1,
    clock_span_ns=(1 << 32) * 1_000_000,
    frame="a WTS packet",
)
