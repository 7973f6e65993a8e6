"""Group the images of a pad into blocks of about 0.1 s, with statistics of each taxel and of its neighbours.

`slipd.signals.taxel_faults` judges taxels by these: means, changes from image to image (alone and with the others), and
the time for which the bits have not changed.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array, Indices

BLOCK_NS = 90_000_000
"""A block ends with the first image this long after the end of the previous block: three images at 30 Hz."""
WINDOW = 8
"""Number of blocks that are judged together: a lost taxel shows within 0.9 s, and a slow press changes readings."""
GAP_NS = 500_000_000
"""After a longer gap the blocks are discarded."""

MEAN, SHEAR_X, SHEAR_Y, LEAST, PRESSURE, SQUARES, ROUGH, SHARED, REST, CHANGES, SHEAR_SQUARES = range(11)
"""Statistics of one taxel over one block, by their row.

- MEAN, SHEAR_X, SHEAR_Y: Mean reading and mean shear; 0 where the taxels measure none.
- LEAST: Smallest magnitude of a reading.
- PRESSURE: Pressure at the end of the block.
- SQUARES: Sum of squares of the steps from image to image.
- ROUGH: Sum of squares of the second differences.
- SHARED: Sum of products of the taxel's steps with the summed steps of all others.
- REST: Sum of squares of the summed steps of all others.
- CHANGES: Number of images in which the taxel's bits changed.
- SHEAR_SQUARES: Sum of squares of the steps of the shear, both axes together.
"""
_READING, _LAST_X, _LAST_Y, _STEP, _RUN = range(5)  # of the newest image that differs from the one before


class Blocks:
    """Ring of the last blocks of one pad's images; the first axis of all arrays but `run` has length WINDOW.

    Args:
        taxels: Number of taxels.

    Attributes:
        count: Number of blocks since the last gap.
        window: Statistics of the taxels, shape (WINDOW, 11, taxels).
        new: Number of images in which any bits changed, shape (WINDOW,).
        free: Nothing touched the pad during the block, shape (WINDOW,).
        steady: The force did not move during the block, shape (WINDOW,).
        run: Number of new images since the taxel's bits last changed, shape (taxels,).

    Many pads send each image several times. Steps are those between images that differ, or a held image would make any
    motion look like jumps.
    """

    def __init__(self, taxels: int) -> None:
        self.count = 0
        self.window = np.zeros((WINDOW, 11, taxels))
        self.new = np.zeros(WINDOW, dtype=np.int64)
        self.free, self.steady = np.zeros((2, WINDOW), dtype=bool)
        self._sums, self._last = np.zeros((11, taxels)), np.zeros((5, taxels))
        self.run = self._last[_RUN]
        self._shear = np.zeros((2, taxels))
        self._last_ns: int | None = None

    def update(
        self,
        values: Array,
        t_ns: int,
        *,
        free: bool,
        steady: bool,
        pressure: Array | None = None,
        shear: Array | None = None,
    ) -> bool:
        """Update with an image; return True if it ends a block.

        Args:
            values: Readings, shape (taxels,), all finite.
            t_ns: Time of the image.
            free: Nothing touches the pad.
            steady: The force does not move.
            pressure: Pressure, shape (taxels,), NaN if not known; None if the readings are the pressure.
            shear: Shear, shape (taxels, 2), all finite; None where the taxels measure none.
        """
        if shear is not None:
            self._shear[:] = shear.T
        if self._last_ns is None or not 0 <= t_ns - self._last_ns <= GAP_NS:
            self.count = 0
            self._last[:] = 0.0
            self._last[_READING], self._last[_LAST_X : _LAST_Y + 1] = values, self._shear
            self._begin_block(t_ns)
        self._last_ns = t_ns
        self._images += 1
        self._new += _add(self._sums, self._last, values, self._shear)
        self._all_free &= free
        self._all_steady &= steady
        if t_ns - self._block_ns < BLOCK_NS:
            return False
        slot = self.count % WINDOW
        block = self.window[slot]
        block[:] = self._sums
        block[MEAN : SHEAR_Y + 1] /= self._images
        block[PRESSURE] = block[MEAN] if pressure is None else np.where(np.isnan(pressure), 0.0, pressure)
        self.new[slot], self.free[slot], self.steady[slot] = self._new, self._all_free, self._all_steady
        self.count += 1
        self._begin_block(t_ns)
        return True

    def last(self, blocks: int) -> Indices:
        """Return the indices of the last blocks, newest first."""
        return (self.count - 1 - np.arange(blocks)) % WINDOW

    def _begin_block(self, t_ns: int) -> None:
        self._sums[:] = 0.0
        self._sums[LEAST] = math.inf
        self._images = self._new = 0
        self._all_free = self._all_steady = True
        self._block_ns = t_ns


@compiled
def _add(sums: Array, last: Array, values: Array, shear: Array) -> int:
    """Add an image to the statistics of a block.

    Args:
        sums: Statistics, shape (11, taxels), with sums in place of means; updated.
        last: Newest image that differed from the one before, shape (5, taxels); updated.
        values: Readings, shape (taxels,).
        shear: Shear, shape (2, taxels).

    Returns:
        1 if a reading changed, else 0.
    """
    moved, steps = False, 0.0
    for k in range(len(values)):
        moved = moved or values[k] != last[_READING, k]
        steps += values[k] - last[_READING, k]
        sums[MEAN, k] += values[k]
        sums[SHEAR_X, k] += shear[0, k]
        sums[SHEAR_Y, k] += shear[1, k]
        sums[LEAST, k] = min(sums[LEAST, k], abs(values[k]))
    if not moved:
        return 0
    for k in range(len(values)):
        step = values[k] - last[_READING, k]
        bend, others = step - last[_STEP, k], steps - step
        x, y = shear[0, k] - last[_LAST_X, k], shear[1, k] - last[_LAST_Y, k]
        sums[SQUARES, k] += step * step
        sums[ROUGH, k] += bend * bend
        sums[SHARED, k] += step * others
        sums[REST, k] += others * others
        sums[SHEAR_SQUARES, k] += x * x + y * y
        last[_READING, k], last[_LAST_X, k], last[_LAST_Y, k], last[_STEP, k] = (
            values[k],
            shear[0, k],
            shear[1, k],
            step,
        )
        last[_RUN, k] += 1.0
        if step != 0.0:
            sums[CHANGES, k] += 1.0
            last[_RUN, k] = 0.0
    return 1
