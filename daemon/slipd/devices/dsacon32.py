"""Weiss DSACON32m, the tactile controller of the Schunk SDH hand: several matrices on one serial or TCP line.

The controller is asked what it is and which matrices it carries, and then pushes images of all of them, plain or
run-length encoded. Source: both Schunk libraries of the SDH hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from slipd.devices import Device
from slipd.devices import dsacon32_messages as messages
from slipd.devices import weiss_tactile as tactile
from slipd.devices.conversation import ANSWER_NS
from slipd.devices.weiss import BEHIND_PREAMBLE
from slipd.devices.weiss_tactile import FULL_SCALE, MAX_CELLS, RLE, Question, TactileDecoder, TactileSession, Units
from slipd.samples import TactileSample

MAX_RATE_HZ = 30
"""The controller is no faster."""

MAX_MATRICES = 16
"""The SDH hand has six."""

BOOT_NS = 9_000_000_000
"""The controller is deaf for about 8 s after power-up."""

BOOT_TEXT = b"\x1b[5n"
"""Sent three times while it boots."""

_TYPICAL_BYTES = 300
_RUN_SHIFT = 12
_LONGEST_RUN = 15


class Decoder(TactileDecoder):
    """Makes a sample of every matrix of every image; an image with other cells than the matrices have is dropped.

    ``values`` has shape (cols·rows,), counts of 12 bits, row by row. ``source`` is the index of the matrix. Status
    name: "saturated" (a cell is at full scale).

    Args:
        matrices: ``[[cols, rows], …]`` in the controller's order; None where not known: a whole image is one sample
            of source "0".

    Raises:
        ValueError: There is no matrix, or one without cells, or there are too many.
    """

    def __init__(self, matrices: Sequence[Sequence[float]] | None = None) -> None:
        super().__init__(BEHIND_PREAMBLE, messages.REPLY_SIZES, _TYPICAL_BYTES, BOOT_TEXT)
        self._ends: list[int] = []  # of each matrix among the cells of an image
        if matrices is not None:
            self.expect(matrices)

    def expect(self, matrices: Sequence[Sequence[float]]) -> None:
        """Take the form of the matrices, as of the option."""
        wrong = misfit(matrices)
        if wrong:
            raise ValueError(wrong)
        self._ends = [int(end) for end in np.cumsum([cols * rows for cols, rows in matrices])]

    def _admits_image(self, rle: bool, count: int, begun: Units) -> bool:
        cells = self._ends[-1] if self._ends else None
        if not rle:
            return cells in (None, count) and not (begun > FULL_SCALE).any()
        most = cells or MAX_CELLS
        expanded = int((begun >> _RUN_SHIFT).sum())
        if len(begun) < count:
            return count <= most and expanded <= most
        return expanded == cells if cells else 0 < expanded <= MAX_CELLS

    def _images(self, rle: bool, units: Units, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        cells = np.repeat(units & FULL_SCALE, units >> _RUN_SHIFT) if rle else units
        return [
            tactile.image(cells[begin:end], t_ns, device_time_ns, FULL_SCALE, str(index))
            for index, (begin, end) in enumerate(pairwise((0, *(self._ends or (len(cells),)))))
        ]


def misfit(matrices: Sequence[Sequence[float]]) -> str:
    """Return what is wrong with the form of the matrices, "" when nothing is."""
    if not 1 <= len(matrices) <= MAX_MATRICES:
        return f"{len(matrices)} matrices: 1 to {MAX_MATRICES} are supported"
    for index, sides in enumerate(matrices):
        if len(sides) != 2 or any(side < 1 or side % 1 for side in sides):
            return f"matrix {index} is {list(sides)}: columns and rows, whole numbers from 1 on, are right"
    cells = sum(cols * rows for cols, rows in matrices)
    return "" if cells <= MAX_CELLS else f"{cells} cells: at most {MAX_CELLS} are supported"


def encode_frame(cells: Sequence[int] | Units, device_time_ms: int, *, rle: bool = False) -> bytes:
    """Return one image as the controller sends it.

    Args:
        cells: Counts of all matrices in order, integers from 0 to 4095, shape (cells,).
        device_time_ms: The controller's clock, ms; sent modulo 2^32.
        rle: Run-length encoded.
    """
    units = np.asarray(cells, dtype=np.uint16)
    return tactile.encode_frame(_runs(units) if rle else units, device_time_ms, BEHIND_PREAMBLE, flags=RLE * rle)


def _runs(cells: Units) -> Units:
    starts = np.flatnonzero(np.diff(cells, prepend=cells[:1] ^ 1))
    units: list[int] = []
    for start, end in zip(starts, [*starts[1:], len(cells)], strict=True):
        whole, rest = divmod(int(end - start), _LONGEST_RUN)
        lengths = [_LONGEST_RUN] * whole + [rest] * (rest > 0)
        units += [length << _RUN_SHIFT | int(cells[start]) for length in lengths]
    return np.array(units, dtype=np.uint16)


class Session(TactileSession):
    """Learns controller and matrices, and has the images pushed.

    Beyond what every session of its kind does: `state` also says "controller not operable", or that the controller is
    of a type whose images are not known, which is not started. `identity` is the controller's serial number.

    Args:
        rate_hz: Images each second, 1 to 30.
        rle: Ask for run-length encoded images; a plain one of an SDH hand takes 85 ms at 115200 bit/s.

    Raises:
        ValueError: The rate is out of range, or no integer.
    """

    decoder: Decoder

    def __init__(self, rate_hz: int = MAX_RATE_HZ, rle: bool = True) -> None:
        if not (isinstance(rate_hz, int) and 1 <= rate_hz <= MAX_RATE_HZ):
            raise ValueError(f"{rate_hz} images each second are not supported: 1 to {MAX_RATE_HZ} are")
        stop, start = messages.acquire(0, rle=rle), messages.acquire(rate_hz, rle=rle)
        questions = [
            Question(
                "controller",
                messages.ask(messages.CONTROLLER),
                attempts=BOOT_NS // ANSWER_NS,
                reply_id=messages.CONTROLLER,
                take=self._take_controller,
            ),
            Question("sensor", messages.ask(messages.SENSOR), reply_id=messages.SENSOR, take=self._take_sensor),
            Question("stop", stop, reply_id=messages.ACQUIRE, forgives=range(1, 1 << 16)),
            Question("start", start, reply_id=messages.ACQUIRE, forgives=(messages.ALREADY_RUNNING,)),
        ]
        super().__init__(Decoder(), questions, stop, messages.ERROR_WORDS, 1_000_000_000 // rate_hz)
        self._matrices: list[tuple[int, int]] = []
        self._expected = 0

    def _take_controller(self, payload: bytes) -> str:
        info = messages.parse_controller(payload)
        if info.kind != messages.TYPE_DSACON32:
            return f"controller type {info.kind_name} is not supported: DSACON32 is"
        self.identity = f"S/N {info.serial}"
        return "" if info.operable else "controller not operable"

    def _take_sensor(self, payload: bytes) -> str:
        count = messages.parse_sensor(payload)
        if not 1 <= count <= MAX_MATRICES:
            return f"{count} matrices: 1 to {MAX_MATRICES} are supported"
        self._matrices = []
        self._expected = count
        self._questions[2:-2] = [
            Question(f"matrix {index}", messages.ask_matrix(index), reply_id=messages.MATRIX, take=self._take_matrix)
            for index in range(count)
        ]
        return ""

    def _take_matrix(self, payload: bytes) -> str:
        matrices = [*self._matrices, messages.parse_matrix(payload)]
        wrong = misfit(matrices)
        if not wrong:
            self._matrices = matrices
            if len(matrices) == self._expected:
                self.decoder.expect(matrices)
        return wrong


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
    frame="a DSACON32m packet",
)
