"""Detect taxels that are still, frozen, hot or saturated, by comparison with their neighbours.

The neighbours are the only reference for a taxel. Four tests use the last blocks of images; each rates a taxel bad,
good or neither:

* still: it rests while all its neighbours move together, as they do when the load changes. Taxels at the edge of a
  contact have resting neighbours, and those on a pivot line neighbours that move in opposite directions: neither is
  rated. A three-axis taxel whose shear moves like its neighbours' is not still: one sensor measures all its axes.
* frozen: its bits stay the same for longer than chance allows while its neighbours' bits keep changing.
* hot: it is high while nothing touches the pad, or far above loaded neighbours, or it jitters alone.
* saturated: it is at full scale.

Limits of the method: a hole of one taxel in a contact looks like a dead taxel, and a straight groove along a row like a
lost row. A first or last row that reads noise around zero looks like the far side of a contact's edge and is not
detected; neither is a constant high reading beside a contact before the pad is free.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from slipd.arrays import Array
from slipd.signals.pad import STEPS, neighbours
from slipd.signals.taxel_blocks import WINDOW, Blocks

Mask = NDArray[np.bool_]

STILL = 0.15
"""A taxel that moves less than this fraction of its neighbours' mean is still; gains differ by far less."""
MOVING = 0.3
"""A taxel that moves at least this fraction is good."""
ABOVE_NOISE = 4.0
"""Least movement relative to the neighbours' jitter: four times the chance movement of means of three images."""
PLATEAU = 0.8
"""A corner is rated only if its three neighbours move at least this fraction of the pad's largest movement: a rounded
contact that omits the corner has less pressure there."""
CHANGING = 0.5
"""Fraction of images with changed bits from which the noise is wide enough that no taxel rests within one count."""
CHANCE = -math.log(1e-12)
"""A run of unchanged bits counts if its probability is below 1e-12: once a year on 128 taxels."""
SHORTEST_RUN = 9
"""Shortest run of unchanged bits that counts."""
FREE_BLOCKS = 5
"""Blocks for which a taxel must be high: longer than a touch takes to reach the force sensor."""
HOT = 12.0
"""A hot taxel is this multiple of the noise, or of the spread of the resting pad, above the pad's median."""
SLOWLY = 0.01
"""Fraction of a rise that counts as a change of the pad at rest; a fall counts at once."""
HOT_THRESHOLDS = 10.0
"""A hot taxel is above this multiple of the threshold of an active taxel."""
AFTER_EFFECT = 0.1
"""Fraction of the largest reading that rubber may still press after a release."""
PEAK_TIMES = 300.0
"""Number of ratings, about a minute, after which the largest reading is forgotten."""
SPIRE = 6.0
"""Among loaded neighbours a reading of this multiple is impossible: rubber spreads a point load."""
LOADED = 4.0
"""A taxel is pressed from this multiple of the spread of the resting pad; the rules need several at once."""
AROUND = 0.6
"""Fraction of the neighbours that must be loaded for that."""
JITTER = 8.0
"""A jitter counts from this multiple of the pad's noise."""
ALONE = 5.0
"""A taxel jitters alone from this multiple of its neighbours' jitter, or of the pad's, relative to the load."""
ROUGH = 1.6
"""Mean square of second over first differences: 3 for white noise, 2 for jumps, below 1 for well-sampled motion."""
SHAKEN = 0.3
"""Fraction of the load by which a steady force can shake a reading."""
EXPLAINED = 0.2
"""A jitter that the pad's common jitter explains to more than this fraction is that of the force."""
JUMPY_BLOCKS = 3
"""Blocks of the window that must have such a jitter: a single one may be a step, such as a tare."""
KNOCK_BLOCKS, BESIDE_KNOCK = 2, 0.1
"""A knock goes up and down within two images, which are two blocks at 10 images a second: the other blocks must have
this share of the jitter. Noise that lasts has less in one rating of seventy, with one image per block."""
SATURATED = 0.97
"""Fraction of full scale from which a taxel is saturated: taxels with different offsets stop a little apart."""
SATURATED_BLOCKS = 2

_OTHER_ROWS = [k for k, (down, _) in enumerate(STEPS) if down]
_OTHER_COLS = [k for k, (_, right) in enumerate(STEPS) if right]


class Kind(IntEnum):
    """Fault of a taxel, and the index of its row in the result of `TaxelFaults.judge`."""

    STILL = 0
    FROZEN = 1
    HOT = 2
    SATURATED = 3


class TaxelFaults:
    """The four tests on one pad, and what they have learned of the pad at rest.

    Args:
        blocks: Statistics of the taxels over the last blocks.
        rows: Rows of the scan.
        cols: Columns of the scan.
        full_scale: As of `TaxelHealth`; infinite if not known.
        threshold: As of `TaxelHealth`.
        light_touch: As of `TaxelHealth`.

    Attributes:
        away: Taxels that were far from the resting value in the last block, shape (taxels,).
    """

    def __init__(
        self, blocks: Blocks, rows: int, cols: int, full_scale: float, threshold: float, light_touch: float
    ) -> None:
        self._blocks = blocks
        self._grid = rows, cols
        self._full = SATURATED * full_scale
        self._threshold, self._light_touch = threshold, light_touch
        taxels = rows * cols
        self._around = neighbours(rows, cols)
        self._within = self._around >= 0
        self._corner = self._within.sum(axis=1) == 3
        row, col = np.divmod(np.arange(taxels), cols)
        self._inner_rows = (row > 0) & (row < rows - 1)
        self._inner_cols = (col > 0) & (col < cols - 1)
        self._noise = self._shear_noise = self._spread = math.inf
        self._peak = 0.0
        self._active = self._pressed = threshold
        self._noisy_rest = False
        self._masked: Mask = np.zeros(taxels, dtype=bool)
        self.away: Mask = np.zeros(taxels, dtype=bool)

    def judge(self, masked: Mask) -> tuple[Mask, Mask]:
        """Rate the taxels by the last blocks.

        Args:
            masked: Taxels that are not trusted, shape (taxels,); they are no reference for their neighbours.

        Returns:
            Taxels that each test rates bad, and good; each of shape (4, taxels), first axis `Kind`.
        """
        self._masked = masked
        jitter = self._blocks.jitter()
        floor = float(np.partition(jitter, jitter.size // 4)[jitter.size // 4])
        self._noise = _lowest(self._noise, floor)
        self._shear_noise = _lowest(self._shear_noise, float(self._blocks.shear_jitter().min()))
        mean = self._blocks.means[self._blocks.last(1)[0]]
        self._peak *= 1.0 - 1.0 / PEAK_TIMES
        self._peak = max(self._peak, float(np.where(masked, 0.0, mean).max()))
        middle = float(np.median(mean))
        self._spread = _lowest(self._spread, 1.4826 * float(np.median(np.abs(mean - middle))))
        self._active = max(self._threshold, JITTER * self._noise)
        self._pressed = max(self._active, LOADED * self._spread)
        rest = max(HOT_THRESHOLDS * self._threshold, HOT * self._noise, HOT * self._spread)
        self.away = np.abs(mean) > rest
        believed = np.append(~masked, False)[self._around]
        full, _ = saturated = self._saturated()
        tests = (
            self._still(jitter, believed),
            self._frozen(np.abs(mean) <= self._pressed, believed),
            self._hot(jitter, rest, max(middle, 0.0), believed),
        )
        bad, well = zip(*((bad & ~full, well) for bad, well in tests), saturated, strict=True)
        return np.array(bad), np.array(well)

    def _still(self, jitter: Array, believed: Mask) -> tuple[Mask, Mask]:
        """Find taxels that rest while their surroundings move: single taxels, and lines by the lines beside them."""
        span = np.ptp(self._blocks.means, axis=0)
        near = np.append(self._blocks.means, np.zeros((WINDOW, 1)), axis=1)[:, self._around]
        near_span, near_jitter = np.append(span, 0.0)[self._around], np.append(jitter, 0.0)[self._around]
        pressed = near.max(axis=0) > self._active

        def surroundings(use: Mask) -> tuple[Array, Mask]:
            count = use.sum(axis=1)
            n = np.maximum(count, 1)
            moves = np.ptp(np.einsum("wtk,tk->wt", near, use) / n, axis=0)
            loud = moves > np.maximum(self._threshold, ABOVE_NOISE * np.einsum("tk,tk->t", near_jitter, use) / n)
            along = (use & pressed & (near_span >= MOVING * moves[:, None])).sum(axis=1)
            return moves, loud & (count >= 3) & (along >= count - (count >= 7))

        moves, judged = surroundings(believed)
        plateau = near_span.min(axis=1, where=self._within, initial=math.inf) >= PLATEAU * span.max()
        sheared = self._sheared(believed)
        bad = judged & (span <= STILL * moves) & (plateau | ~self._corner) & ~sheared
        well = judged & ((span >= MOVING * moves) | sheared)
        rests = span <= np.maximum(self._threshold, ABOVE_NOISE * jitter)
        for inner, beside, axis in ((self._inner_rows, _OTHER_ROWS, 1), (self._inner_cols, _OTHER_COLS, 0)):
            if self._lines(rests & inner, axis).any():
                use = np.zeros_like(believed)
                use[:, beside] = believed[:, beside]
                moves, judged = surroundings(use)
                still = judged & inner & (span <= STILL * moves) & ~sheared
                bad |= self._lines(still | rests, axis) & self._several(still, axis)
            if self._masked.any():
                well |= self._lines(well | self._masked, axis) & self._several(well, axis)
        return bad, well

    def _sheared(self, believed: Mask) -> Mask:
        """Return the taxels whose shear moves beyond the pad's noise, and not much less than their neighbours'."""
        span = np.hypot(*np.ptp(self._blocks.shear, axis=0).T)
        near = np.append(span, 0.0)[self._around]
        usual = np.einsum("tk,tk->t", near, believed) / np.maximum(believed.sum(axis=1), 1)
        moves: Mask = span > np.maximum(ABOVE_NOISE * self._shear_noise, STILL * usual)
        return moves

    def _lines(self, which: Mask, axis: int) -> Mask:
        """Return the taxels in lines in which all taxels are set."""
        every = which.reshape(self._grid).all(axis=axis, keepdims=True)
        return np.broadcast_to(every, self._grid).ravel()

    def _several(self, which: Mask, axis: int) -> Mask:
        """Return the taxels in lines in which at least three taxels are set."""
        several = which.reshape(self._grid).sum(axis=axis, keepdims=True) >= 3
        return np.broadcast_to(several, self._grid).ravel()

    def _frozen(self, resting: Mask, believed: Mask) -> tuple[Mask, Mask]:
        """Find taxels whose bits rest for longer than chance allows; at rest only on a pad whose rest is noisy."""
        rate = self._blocks.change_rate()
        resting = resting & ~self._masked
        if 2 * np.count_nonzero(resting) > resting.size:  # otherwise a lost row might be most of the resting taxels
            self._noisy_rest = float(np.median(rate[resting])) >= CHANGING
        near = np.append(rate, 1.0)[self._around]

        def frozen(use: Mask, least: int) -> Mask:
            lowest = np.partition(np.where(use, near, 1.0), 1, axis=1)[:, 1]  # a frozen neighbour does not hide it
            unlikely = -self._blocks.run * np.log1p(-np.minimum(lowest, 0.95))
            found: Mask = (use.sum(axis=1) >= least) & (lowest >= CHANGING) & (unlikely >= CHANCE)
            return found

        bad = frozen(believed, 3)
        for beside, axis in ((_OTHER_ROWS, 1), (_OTHER_COLS, 0)):
            if not self._lines(self._blocks.run >= SHORTEST_RUN, axis).any():
                continue
            use = np.zeros_like(believed)
            use[:, beside] = believed[:, beside]
            bad |= self._lines(frozen(use, 2), axis)
        return bad & (self.away | self._noisy_rest), rate >= 0.5 * CHANGING

    def _hot(self, jitter: Array, rest: float, middle: float, believed: Mask) -> tuple[Mask, Mask]:
        """Find taxels that are high without a load, or jitter alone."""
        recent = self._blocks.last(FREE_BLOCKS)
        limit = max(rest, AFTER_EFFECT * self._peak, self._light_touch) + middle
        bad = self._blocks.means[recent].min(axis=0) > (limit if self._blocks.free[recent].all() else math.inf)
        low, top = self._blocks.pressures[recent].min(axis=0), self._blocks.pressures[recent].max(axis=0)
        near_low, near_top = np.append(low, 0.0)[self._around], np.append(top, 0.0)[self._around]
        loaded = (believed & (near_low > self._pressed)).sum(axis=1)
        highest = near_top.max(axis=1, where=believed, initial=0.0)
        bad |= (loaded >= 3) & (loaded >= AROUND * believed.sum(axis=1)) & (low > SPIRE * highest)
        bad |= self._jitters_alone(jitter, believed)
        return bad, ~bad & ((loaded >= 3) | ~self.away)

    def _jitters_alone(self, jitter: Array, believed: Mask) -> Mask:
        count = believed.sum(axis=1, keepdims=True)
        near = np.sort(np.where(believed, np.append(jitter, 0.0)[self._around], math.inf), axis=1)
        usual = np.take_along_axis(near, np.minimum(count // 2, near.shape[1] - 1), axis=1)[:, 0]
        blocks = self._blocks.squares > 2 * self._active**2 * np.maximum(self._blocks.new, 1)[:, None]
        alone: Mask = (jitter > np.maximum(self._active, ALONE * usual)) & (blocks.sum(axis=0) >= JUMPY_BLOCKS)
        squares = self._blocks.squares.sum(axis=0)
        alone &= np.sort(self._blocks.squares, axis=0)[:-KNOCK_BLOCKS].sum(axis=0) > BESIDE_KNOCK * squares
        alone &= self._blocks.rough.sum(axis=0) > ROUGH * squares
        power = squares * self._blocks.rest.sum(axis=0)
        alone &= np.square(self._blocks.shared.sum(axis=0)) < EXPLAINED * power
        if self._blocks.free.all():
            return alone
        load = self._blocks.means.mean(axis=0)
        alone &= jitter > SHAKEN * np.abs(load)
        pressed = int(np.count_nonzero(~self._masked & (load > self._pressed)))
        return alone if self._blocks.steady.all() or pressed >= 4 else np.zeros_like(alone)

    def _saturated(self) -> tuple[Mask, Mask]:
        recent = self._blocks.last(SATURATED_BLOCKS)
        bad = self._blocks.least[recent].min(axis=0) >= self._full
        return bad, ~bad


def _lowest(known: float, seen: float) -> float:
    """Return the updated resting level: a contact raises it for a while, so it rises slowly and falls at once."""
    return seen if seen < known else known + SLOWLY * (seen - known)
