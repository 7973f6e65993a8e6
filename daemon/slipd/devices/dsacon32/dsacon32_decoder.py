"""Images of the DSACON32m: cells of all matrices in one packet, plain or run-length encoded.

A plain image is one u16 per cell, 0 to 4095. A run-length encoded one is one u16 per run of equal cells: the length of
the run (1 to 15) in the upper 4 bits, the value in the lower 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from slipd.devices.dsacon32 import dsacon32_messages as messages
from slipd.devices.shared import weiss_tactile as tactile
from slipd.devices.shared.weiss_packets import SEED_AFTER_PREAMBLE
from slipd.devices.shared.weiss_tactile import FULL_SCALE, MAX_CELLS, RLE, TactileDecoder, Words
from slipd.types.samples import TactileSample

MAX_MATRICES = 16
"""The SDH hand has six."""

BOOT_TEXT = b"\x1b[5n"
"""Sent three times while the controller boots."""

_TYPICAL_BYTES = 300
_RUN_SHIFT = 12
_LONGEST_RUN = 15


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
        super().__init__(SEED_AFTER_PREAMBLE, messages.REPLY_SIZES, _TYPICAL_BYTES, BOOT_TEXT)
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
        expanded = int((words >> _RUN_SHIFT).sum())
        if len(words) < count:
            return count <= most and expanded <= most
        return expanded == cells if cells else 0 < expanded <= MAX_CELLS

    def _samples(self, rle: bool, words: Words, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        cells = np.repeat(words & FULL_SCALE, words >> _RUN_SHIFT) if rle else words
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


def encode_frame(cells: Sequence[int] | Words, device_time_ms: int, *, rle: bool = False) -> bytes:
    """Return one image as the controller sends it.

    Args:
        cells: Counts of all matrices in order, integers from 0 to 4095, shape (cells,).
        device_time_ms: Device time, ms; sent modulo 2^32.
        rle: Whether to encode runs.
    """
    words = np.asarray(cells, dtype=np.uint16)
    return tactile.encode_frame(_runs(words) if rle else words, device_time_ms, SEED_AFTER_PREAMBLE, flags=RLE * rle)


def _runs(cells: Words) -> Words:
    starts = np.flatnonzero(np.diff(cells, prepend=cells[:1] ^ 1))
    words: list[int] = []
    for start, end in zip(starts, [*starts[1:], len(cells)], strict=True):
        whole, rest = divmod(int(end - start), _LONGEST_RUN)
        lengths = [_LONGEST_RUN] * whole + [rest] * (rest > 0)
        words += [length << _RUN_SHIFT | int(cells[start]) for length in lengths]
    return np.array(words, dtype=np.uint16)
