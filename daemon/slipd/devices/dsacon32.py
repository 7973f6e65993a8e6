"""Weiss DSACON32m, the tactile controller of the Schunk SDH hand: several matrices on one serial or TCP line.

The session asks the controller for its type and its matrices. The controller then streams images: the cells of all
matrices in one packet. A plain image is one u16 per cell, 0 to 4095. A run-length encoded one is one u16 per run of
equal cells: the length of the run (1 to 15) in the upper 4 bits, the value in the lower 12.

Source: both Schunk libraries of the SDH hand.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from slipd.devices import Device, RateOption
from slipd.devices.shared import weiss_tactile as tactile
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.sensor_session import ANSWER_NS
from slipd.devices.shared.weiss_packets import ALREADY_RUNNING, SEED_AFTER_PREAMBLE, STATUS_WORDS, encode
from slipd.devices.shared.weiss_tactile import FULL_SCALE, MAX_CELLS, RLE, TactileDecoder, TactileSession, Words
from slipd.types.samples import TactileSample

CONTROLLER = 0x01
SENSOR = 0x02
ACQUIRE = 0x03
MATRIX = 0x0B

CONTROLLER_FIELDS = struct.Struct("<HIBHBBBBIB")  # the library has one more byte, which is not sent
SENSOR_FIELDS = struct.Struct("<HHHBIB")
MATRIX_FIELDS = struct.Struct("<H2f2H6s2sB3f3ffB")
ACQUIRE_FIELDS = struct.Struct("<BH")

REPLY_SIZES = {CONTROLLER: CONTROLLER_FIELDS.size, SENSOR: SENSOR_FIELDS.size, ACQUIRE: 2, MATRIX: MATRIX_FIELDS.size}

ERROR_WORDS = (*STATUS_WORDS[:12], *STATUS_WORDS[13:29])
"""Meaning of each error number: that of the other Weiss controllers, without their 12, "no parameter expected"."""

TYPE_DSACON32 = 1
_TYPES = ("DSACON16", "DSACON32", "DSA100-256")

OPERABLE = 0x80
PUSH = 0x80


def encode_query(packet_id: int, payload: bytes = b"") -> bytes:
    """Return a request; one without payload has no checksum."""
    return encode(packet_id, payload, SEED_AFTER_PREAMBLE, bare=True)


def acquire(rate_hz: int, *, rle: bool) -> bytes:
    """Return the request for images at ``rate_hz``; 0 stops them (bit 7 clear, as firmware from 276 on requires)."""
    return encode_query(ACQUIRE, ACQUIRE_FIELDS.pack((PUSH if rate_hz else 0) | (RLE if rle else 0), rate_hz))


MAX_MATRICES = 16
"""The SDH hand has six."""

BOOT_TEXT = b"\x1b[5n"
"""Sent three times while the controller boots."""

_TYPICAL_BYTES = 300
RUN_SHIFT = 12


class Decoder(TactileDecoder):
    """Return a sample of every matrix of every image; drop images whose cells do not fit the matrices.

    ``values`` has shape (cols·rows,), counts of 12 bits, row by row. ``source`` is the index of the matrix. The only
    status name is "saturated": a cell is at full scale.

    Args:
        matrices: ``[[cols, rows], …]`` in the controller's order. None if unknown: a whole image is then one sample
            with source "0".

    Raises:
        ValueError: There are no matrices or too many, or a matrix has no cells.
    """

    def __init__(self, matrices: Sequence[Sequence[float]] | None = None) -> None:
        super().__init__(SEED_AFTER_PREAMBLE, REPLY_SIZES, _TYPICAL_BYTES, BOOT_TEXT)
        self._ends: list[int] = []  # index after the last cell of each matrix
        if matrices is not None:
            self.set_matrices(matrices)

    def set_matrices(self, matrices: Sequence[Sequence[float]]) -> None:
        """Set columns and rows of the matrices, as in the option."""
        problem = matrices_problem(matrices)
        if problem:
            raise ValueError(problem)
        self._ends = [int(end) for end in np.cumsum([cols * rows for cols, rows in matrices])]

    def _accepts_image(self, rle: bool, count: int, words: Words) -> bool:
        cells = self._ends[-1] if self._ends else None
        if not rle:
            return cells in (None, count) and not (words > FULL_SCALE).any()
        most = cells or MAX_CELLS
        expanded = int((words >> RUN_SHIFT).sum())
        if len(words) < count:
            return count <= most and expanded <= most
        return expanded == cells if cells else 0 < expanded <= MAX_CELLS

    def _samples(self, rle: bool, words: Words, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        cells = np.repeat(words & FULL_SCALE, words >> RUN_SHIFT) if rle else words
        return [
            tactile.matrix_sample(cells[begin:end], t_ns, device_time_ns, FULL_SCALE, str(index))
            for index, (begin, end) in enumerate(pairwise((0, *(self._ends or (len(cells),)))))
        ]


def matrices_problem(matrices: Sequence[Sequence[float]]) -> str:
    """Return what is wrong with columns and rows of the matrices; "" if nothing is."""
    if not 1 <= len(matrices) <= MAX_MATRICES:
        return f"a controller must have 1 to {MAX_MATRICES} matrices, got {len(matrices)}"
    for index, sides in enumerate(matrices):
        if len(sides) != 2 or any(side < 1 or side % 1 for side in sides):
            return f"matrix {index} must be columns and rows, integers of at least 1, got {list(sides)}"
    cells = sum(cols * rows for cols, rows in matrices)
    return "" if cells <= MAX_CELLS else f"the matrices must have at most {MAX_CELLS} cells, got {cells}"


MAX_RATE_HZ = 30
"""Highest rate of the controller."""

BOOT_NS = 9_000_000_000
"""Time allowed for booting; the controller ignores requests for about 8 s after power-up."""


_query = partial(tactile.query, REPLY_SIZES, ERROR_WORDS)


class Session(TactileSession[Decoder]):
    """Read controller type and matrices, and start the images.

    `state` may also be "controller not operable", or name a controller whose image format is unknown; neither is
    started. `identity` is the controller's serial number.

    Args:
        rate_hz: Images per second, 1 to 30.
        rle: Whether to request run-length encoded images; a plain one of an SDH hand takes 85 ms at 115200 bit/s.

    Raises:
        ValueError: The rate is out of range or not an integer.
    """

    def __init__(self, rate_hz: int = MAX_RATE_HZ, rle: bool = True) -> None:
        check_integer("rate_hz", rate_hz, 1, MAX_RATE_HZ)
        stop, start = acquire(0, rle=rle), acquire(rate_hz, rle=rle)
        attempts = BOOT_NS // ANSWER_NS
        steps = [
            _query("controller", encode_query(CONTROLLER), handle=self._handle_controller, attempts=attempts),
            _query("sensor", encode_query(SENSOR), handle=self._handle_sensor),
            _query("stop", stop, tolerates=range(1, 1 << 16)),
            _query("start", start, tolerates=(ALREADY_RUNNING,)),
        ]
        super().__init__(Decoder(), steps, stop, 1_000_000_000 // rate_hz)
        self._matrices: list[tuple[int, int]] = []
        self._expected = 0

    def _handle_controller(self, payload: bytes) -> str:
        _, serial, _, _, status, _, kind, *_ = CONTROLLER_FIELDS.unpack(payload)
        if kind != TYPE_DSACON32:
            name = _TYPES[kind] if kind < len(_TYPES) else kind
            return f"the controller must be a DSACON32, got type {name}"
        self.identity = f"S/N {serial}"
        return "" if status & OPERABLE else "controller not operable"

    def _handle_sensor(self, payload: bytes) -> str:
        count = SENSOR_FIELDS.unpack(payload)[1]
        if not 1 <= count <= MAX_MATRICES:
            return f"a controller must have 1 to {MAX_MATRICES} matrices, got {count}"
        self._matrices = []
        self._expected = count
        self._steps[2:-2] = [
            _query(f"matrix {index}", encode_query(MATRIX, bytes((index,))), handle=self._handle_matrix)
            for index in range(count)
        ]
        return ""

    def _handle_matrix(self, payload: bytes) -> str:
        _, _, _, cols, rows, *_ = MATRIX_FIELDS.unpack(payload)
        matrices = [*self._matrices, (cols, rows)]
        problem = matrices_problem(matrices)
        if not problem:
            self._matrices = matrices
            if len(matrices) == self._expected:
                self.decoder.set_matrices(matrices)
        return problem


DEVICE = Device(
    "dsacon32",
    "tactile",
    ("serial", "tcp"),
    Decoder,
    Session,
    rates_hz=(1.0, MAX_RATE_HZ),
    baud=115_200,
    axes=1,
    shared=True,
    clock_span_ns=(1 << 32) * 1_000_000,
    rate_option=RateOption("rate_hz"),
    frame="a DSACON32m packet",
    evidence="maker",
)
