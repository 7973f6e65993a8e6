"""Group the images of a pad into blocks of about 0.1 s, with statistics of each taxel and of its neighbours.

`slipd.signals.taxel_faults` judges taxels by these: means, changes from image to image (alone and with the others), and
the time for which the bits have not changed.
"""

from __future__ import annotations

import numpy as np

from slipd.types.arrays import Array, Indices, Mask

BLOCK_NS = 90_000_000
"""A block ends with the first image this long after the end of the previous block: three images at 30 Hz."""
WINDOW = 8
"""Number of blocks that are judged together: a lost taxel shows within 0.9 s, and a slow press changes readings."""
GAP_NS = 500_000_000
"""After a longer gap the blocks are discarded."""
BLOCK_IMAGES = 64
"""Largest number of images in a block; above 700 Hz the later images of a block are ignored."""


class Blocks:
    """Ring of the last blocks of one pad's images; the first axis of all arrays but `run` has length WINDOW.

    Args:
        taxels: Number of taxels.

    Attributes:
        count: Number of blocks since the last gap.
        means: Mean reading, shape (WINDOW, taxels), as the next ones down to `changes`.
        pressures: Pressure at the end of the block.
        least: Smallest magnitude of a reading.
        squares: Sum of squares of the steps from image to image.
        rough: Sum of squares of the second differences.
        shared: Sum of products of the taxel's steps with the summed steps of all others.
        rest: Sum of squares of the summed steps of all others.
        changes: Number of images in which the taxel's bits changed.
        new: Number of images in which any bits changed, shape (WINDOW,).
        free: Nothing touched the pad during the block, shape (WINDOW,).
        steady: The force did not move during the block, shape (WINDOW,).
        shear: Mean shear, shape (WINDOW, taxels, 2); 0 where the taxels measure none.
        shear_squares: Sum of squares of its steps, both axes together.
        run: Number of new images since the taxel's bits last changed, shape (taxels,).

    Many pads send each image several times. Steps are those between images that differ, or a held image would make any
    motion look like jumps.
    """

    def __init__(self, taxels: int) -> None:
        self.count = 0
        self.means, self.least, self.pressures = np.zeros((3, WINDOW, taxels))
        self.squares, self.rough, self.shared, self.rest = np.zeros((4, WINDOW, taxels))
        self.changes = np.zeros((WINDOW, taxels), dtype=np.int64)
        self.new = np.zeros(WINDOW, dtype=np.int64)
        self.free = np.zeros(WINDOW, dtype=bool)
        self.steady = np.zeros(WINDOW, dtype=bool)
        self.run = np.zeros(taxels, dtype=np.int64)
        self.shear = np.zeros((WINDOW, taxels, 2))
        self.shear_squares = np.zeros((WINDOW, taxels))
        self._images = np.empty((BLOCK_IMAGES + 2, taxels))  # the first two are the last of the previous block
        self._shears = np.zeros((BLOCK_IMAGES + 2, taxels, 2))
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
        if self._last_ns is None or not 0 <= t_ns - self._last_ns <= GAP_NS:
            self._begin(values, t_ns, shear)
        self._last_ns = t_ns
        if self._filled < len(self._images):
            self._images[self._filled] = values
            if shear is not None:
                self._shears[self._filled] = shear
            self._filled += 1
        self._all_free &= free
        self._all_steady &= steady
        if t_ns - self._block_ns < BLOCK_NS:
            return False
        self._end_block(t_ns, pressure)
        return True

    def last(self, blocks: int) -> Indices:
        """Return the indices of the last blocks, newest first."""
        return (self.count - 1 - np.arange(blocks)) % WINDOW

    def jitter(self, squares: Array) -> Array:
        """Return the standard deviation of the noise that explains the steps of each taxel, shape (taxels,).

        Args:
            squares: `squares`, or `shear_squares` for the noise of both axes of the shear together.
        """
        jitter: Array = np.sqrt(squares.sum(axis=0) / (2 * max(int(self.new.sum()), 1)))
        return jitter

    def change_rate(self) -> Array:
        """Return the fraction of new images in which each taxel's bits changed, shape (taxels,)."""
        rate: Array = self.changes.sum(axis=0) / max(int(self.new.sum()), 1)
        return rate

    def _begin(self, values: Array, t_ns: int, shear: Array | None) -> None:
        self._images[:2] = values
        self._sheared = shear is not None
        if shear is not None:
            self._shears[:2] = shear
        self._filled = 2
        self._all_free = self._all_steady = True
        self._block_ns = t_ns
        self.count = 0
        self.run[:] = 0

    def _end_block(self, t_ns: int, pressure: Array | None) -> None:
        """Replace the oldest block by the statistics of the images since."""
        slot, images, shears = self.count % WINDOW, self._images[: self._filled], self._shears[: self._filled]
        self.means[slot], self.least[slot] = images[2:].mean(axis=0), np.abs(images[2:]).min(axis=0)
        self.pressures[slot] = self.means[slot] if pressure is None else np.where(np.isnan(pressure), 0.0, pressure)
        new = np.ones(len(images), dtype=bool)
        new[2:] = (images[2:] != images[1:-1]).any(axis=1)
        newest = images[new]
        steps = newest[1:] - newest[:-1]
        step, bend = steps[1:], steps[1:] - steps[:-1]
        others = step.sum(axis=1, keepdims=True) - step
        self.squares[slot], self.rough[slot] = (step * step).sum(axis=0), (bend * bend).sum(axis=0)
        self.shared[slot], self.rest[slot] = (step * others).sum(axis=0), (others * others).sum(axis=0)
        if self._sheared:
            slid = shears[new]
            slide = slid[2:] - slid[1:-1]
            self.shear[slot], self.shear_squares[slot] = shears[2:].mean(axis=0), (slide * slide).sum(axis=(0, 2))
            shears[:2] = slid[-2:]
        changed = step != 0.0
        self.changes[slot], self.new[slot] = changed.sum(axis=0), len(step)
        since = np.argmax(changed[::-1], axis=0) if len(step) else 0
        self.run = np.where(changed.any(axis=0), since, self.run + len(step))
        self.free[slot], self.steady[slot] = self._all_free, self._all_steady
        images[:2] = newest[-2:]
        self.count += 1
        self._filled, self._block_ns = 2, t_ns
        self._all_free = self._all_steady = True


class Surroundings:
    """Neighbours of each taxel, and which of them count.

    Args:
        around: Neighbours, shape (taxels, k), −1 beyond the border.

    Attributes:
        count: How many each taxel has, shape (taxels,).
    """

    def __init__(self, around: Indices) -> None:
        self._around, taxels = around, len(around)
        self._linked = np.zeros((taxels + 1, taxels))
        self._linked[around, np.arange(taxels)[:, None]] = 1.0
        self._linked = self._linked[:-1]  # the last one is beyond the border
        self.trust(np.ones(taxels, dtype=bool))

    def trust(self, trusted: Mask) -> Surroundings:
        """Count these taxels only, shape (taxels,); return the same surroundings."""
        self._trusted, self._known = trusted, (self._around >= 0) & trusted[self._around]
        self.count = trusted @ self._linked
        return self

    def values(self, values: Array | Mask, otherwise: float) -> Array:
        """Return the neighbours' values, shape (taxels, k); ``otherwise`` for one that does not count."""
        return np.where(self._known, values.take(self._around), otherwise)

    def mean(self, values: Array) -> Array:
        """Return the mean of the neighbours' values, shape (…, taxels); 0 without any."""
        return np.asarray((values * self._trusted) @ self._linked / np.maximum(self.count, 1.0))

    def lowest(self, values: Array, rank: int | Indices, beyond: float) -> Array:
        """Return the neighbours' value of a rank, 0 for the lowest; ``beyond``, above all, is one that is missing."""
        found: Array = np.sort(self.values(values, beyond), axis=1)[np.arange(len(values)), rank]
        return found
