"""Weiss WTS and WTS-FT tactile modules: one matrix on USB or a serial line.

The session asks the module for its serial number and its matrix. The module then streams plain images. The layout of
run-length encoded images is unconfirmed: they are neither requested nor accepted. Source: the public WTS drivers, and
the table of contents of the command set manual.
"""

from __future__ import annotations

import struct
from functools import partial

from slipd.devices import Device, RateOption
from slipd.devices.shared import weiss_tactile as tactile
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.sensor_session import ATTEMPTS
from slipd.devices.shared.weiss_packets import ALREADY_RUNNING, SEED_WITH_PREAMBLE, STATUS_WORDS, encode
from slipd.devices.shared.weiss_tactile import FULL_SCALE, MAX_CELLS, TactileDecoder, TactileSession, Words
from slipd.types.samples import TactileSample

START = 0x21
STOP = 0x22
MATRIX = 0x30
SYSTEM = 0x50

MAX_INTERVAL_MS = 65_535
"""The interval is sent in two bytes."""

_TYPICAL_BYTES = 77  # 4 x 8 cells

SYSTEM_FIELDS = struct.Struct("<HBBHI")  # status, type, hardware revision, firmware, serial number
MATRIX_FIELDS = struct.Struct("<6H")  # status, columns, rows, width and height of a cell in 10 µm, full scale
START_FIELDS = struct.Struct("<BH")  # flags, interval in ms

REPLY_SIZES = {START: 2, STOP: 2, MATRIX: MATRIX_FIELDS.size, SYSTEM: SYSTEM_FIELDS.size}


class Decoder(TactileDecoder):
    """Return a sample of every plain image.

    ``values`` has shape (cols·rows,), counts, row by row. The only status name is "saturated": a cell is at full scale.
    Until the matrix is known, an image may have any number of 12-bit cells.
    """

    def __init__(self) -> None:
        super().__init__(SEED_WITH_PREAMBLE, REPLY_SIZES, _TYPICAL_BYTES)
        self._cells: int | None = None
        self._full_scale = FULL_SCALE

    def set_matrix(self, cells: int, full_scale: int) -> None:
        """Set the number of cells and their largest value; images that do not fit are rejected."""
        self._cells, self._full_scale = cells, full_scale

    def _accepts_image(self, rle: bool, count: int, words: Words) -> bool:
        return not rle and self._cells in (None, count) and not (words > self._full_scale).any()

    def _samples(self, rle: bool, words: Words, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        return [tactile.matrix_sample(words, t_ns, device_time_ns, self._full_scale)]


def encode_query(packet_id: int) -> bytes:
    """Return a request without payload."""
    return encode(packet_id, b"", SEED_WITH_PREAMBLE)


def encode_start(interval_ms: int) -> bytes:
    """Return the request for plain images every ``interval_ms``; 0 is as fast as the module can."""
    return encode(START, START_FIELDS.pack(0, interval_ms), SEED_WITH_PREAMBLE)


_query = partial(tactile.query, REPLY_SIZES, STATUS_WORDS)


class Session(TactileSession[Decoder]):
    """Read serial number and matrix, and start the images; `identity` is the module's serial number.

    Args:
        interval_ms: Time from one image to the next, 0 to 65,535 ms; 0 is as fast as the module can.

    Raises:
        ValueError: The interval is out of range or not an integer.
    """

    def __init__(self, interval_ms: int = 10) -> None:
        check_integer("interval_ms", interval_ms, 0, MAX_INTERVAL_MS)
        stop = encode_query(STOP)
        steps = [
            # the boot time of a module is unknown, so the first request has one more attempt than the others
            _query("system information", encode_query(SYSTEM), handle=self._handle_system, attempts=ATTEMPTS + 1),
            _query("matrix information", encode_query(MATRIX), handle=self._handle_matrix),
            _query("stop", stop, tolerates=range(1, 1 << 16)),
            _query("start", encode_start(interval_ms), tolerates=(ALREADY_RUNNING,)),
        ]
        super().__init__(Decoder(), steps, stop, interval_ms * 1_000_000)

    def _handle_system(self, payload: bytes) -> None:
        self.identity = f"S/N {SYSTEM_FIELDS.unpack(payload)[4]}"

    def _handle_matrix(self, payload: bytes) -> str:
        _, cols, rows, _, _, full_scale = MATRIX_FIELDS.unpack(payload)
        if not 1 <= cols * rows <= MAX_CELLS or full_scale == 0:
            return f"matrix of {cols} x {rows} cells of {full_scale} counts: 1 to {MAX_CELLS} cells are supported"
        self.decoder.set_matrix(cols * rows, full_scale)
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
    rate_option=RateOption("interval_ms", 1000.0),
    frame="a WTS packet",
    evidence="driver",
)
