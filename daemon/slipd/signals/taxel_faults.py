"""Detect taxels that are still, frozen, hot or saturated, by comparison with their neighbours.

The neighbours are the only reference for a taxel. Four tests use the last blocks of images; each rates a taxel bad,
good or neither:

* still: it rests while all its neighbours move together, as they do when the load changes. Taxels at the edge of a
  contact have resting neighbours, and those on a pivot line neighbours that move in opposite directions: neither is
  rated. A three-axis taxel whose shear moves like its neighbours' is not still: one sensor measures all its axes.
* frozen: its bits stay the same for longer than chance allows while its neighbours' bits keep changing.
* hot: it is high while nothing touches the pad, or far above loaded neighbours, or it jitters alone.
* saturated: it is at full scale.

Limits: a hole of one taxel in a contact looks like a dead taxel, and a straight groove along a row like a lost row. A
first or last row that reads noise around zero looks like the far side of a contact's edge and is not detected; neither
is a constant high reading beside a contact before the pad is free.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from slipd.signals.pad import STEPS, neighbours
from slipd.signals.taxel_blocks import Blocks, Surroundings
from slipd.types.arrays import Array, Mask

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
LINE_TAXELS = 3
"""Least number of taxels that are rated by themselves in a line that is rated as a whole."""

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
        around = neighbours(rows, cols)
        self._all, self._near = Surroundings(around), Surroundings(around)
        self._corner = self._all.count == 3
        row, col = np.divmod(np.arange(taxels), cols)
        inner_row, inner_col = (row > 0) & (row < rows - 1), (col > 0) & (col < cols - 1)
        self._directions = (
            (False, inner_row, Surroundings(around[:, _OTHER_ROWS])),
            (True, inner_col, Surroundings(around[:, _OTHER_COLS])),
        )
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
        self._near.trust(~masked)
        blocks = self._blocks
        jitter = blocks.jitter(blocks.squares)
        floor = float(np.partition(jitter, jitter.size // 4)[jitter.size // 4])
        self._noise = _lowest(self._noise, floor)
        self._shear_noise = _lowest(self._shear_noise, float(blocks.jitter(blocks.shear_squares).min()))
        mean = blocks.means[blocks.last(1)[0]]
        self._peak *= 1.0 - 1.0 / PEAK_TIMES
        self._peak = max(self._peak, float(np.where(masked, 0.0, mean).max()))
        middle = float(np.median(mean))
        self._spread = _lowest(self._spread, 1.4826 * float(np.median(np.abs(mean - middle))))
        self._active = max(self._threshold, JITTER * self._noise)
        self._pressed = max(self._active, LOADED * self._spread)
        rest = max(HOT_THRESHOLDS * self._threshold, HOT * self._noise, HOT * self._spread)
        self.away = np.abs(mean) > rest
        full, _ = saturated = self._saturated()
        tests = (
            self._still(jitter),
            self._frozen(np.abs(mean) <= self._pressed),
            self._hot(jitter, rest, max(middle, 0.0)),
        )
        bad, well = zip(*((bad & ~full, well) for bad, well in tests), saturated, strict=True)
        return np.array(bad), np.array(well)

    def _still(self, jitter: Array) -> tuple[Mask, Mask]:
        """Find taxels that rest while their surroundings move: single taxels, and lines by the lines beside them."""
        means = self._blocks.means
        span = np.ptp(means, axis=0)
        pressed_span = np.where(means.max(axis=0) > self._active, span, -1.0)

        def surroundings(near: Surroundings) -> tuple[Array, Mask]:
            moves = np.ptp(near.mean(means), axis=0)
            noise = np.maximum(self._threshold, ABOVE_NOISE * near.mean(jitter))
            along = (near.values(pressed_span, -1.0) >= MOVING * moves[:, None]).sum(axis=1)
            return moves, (moves > noise) & (near.count >= 3) & (along >= near.count - (near.count >= 7))

        moves, judged = surroundings(self._near)
        plateau = self._all.lowest(span, 0, math.inf) >= PLATEAU * span.max()
        sheared = self._sheared()
        bad = judged & (span <= STILL * moves) & (plateau | ~self._corner) & ~sheared
        well = judged & ((span >= MOVING * moves) | sheared)
        rests = span <= np.maximum(self._threshold, ABOVE_NOISE * jitter)
        for down, inner, beside in self._directions:
            if self._lines(rests & inner, down=down).any():
                moves, judged = surroundings(beside.trust(~self._masked))
                still = judged & inner & (span <= STILL * moves) & ~sheared
                bad |= self._lines(still | rests, down=down) & self._several(still, down=down)
            if self._masked.any():
                well |= self._lines(well | self._masked, down=down) & self._several(well, down=down)
        return bad, well

    def _sheared(self) -> Mask:
        """Return the taxels whose shear moves beyond the pad's noise, and not much less than their neighbours'."""
        span = np.hypot(*np.ptp(self._blocks.shear, axis=0).T)
        usual = self._near.mean(span)
        moves: Mask = span > np.maximum(ABOVE_NOISE * self._shear_noise, STILL * usual)
        return moves

    def _lines(self, which: Mask, *, down: bool) -> Mask:
        """Return the taxels in rows of which every taxel is set; ``down``: in such columns."""
        return self._in_lines(which, self._grid[not down], down=down)

    def _several(self, which: Mask, *, down: bool) -> Mask:
        """Return the taxels in rows, or columns, of which at least three taxels are set."""
        return self._in_lines(which, LINE_TAXELS, down=down)

    def _in_lines(self, which: Mask, least: int, *, down: bool) -> Mask:
        """Return the taxels in rows, or columns, of which at least ``least`` taxels are set."""
        lines = which.reshape(self._grid).sum(axis=0 if down else 1, keepdims=True) >= least
        return np.broadcast_to(lines, self._grid).ravel()

    def _frozen(self, resting: Mask) -> tuple[Mask, Mask]:
        """Find taxels whose bits rest for longer than chance allows; at rest only on a pad whose rest is noisy."""
        rate = self._blocks.change_rate()
        resting = resting & ~self._masked
        if 2 * np.count_nonzero(resting) > resting.size:  # otherwise a lost row might be most of the resting taxels
            self._noisy_rest = float(np.median(rate[resting])) >= CHANGING

        def frozen(near: Surroundings, least: int) -> Mask:
            lowest = near.lowest(rate, 1, 1.0)  # a frozen neighbour does not hide it
            unlikely = -self._blocks.run * np.log1p(-np.minimum(lowest, 0.95))
            found: Mask = (near.count >= least) & (lowest >= CHANGING) & (unlikely >= CHANCE)
            return found

        bad = frozen(self._near, 3)
        for down, _, beside in self._directions:
            if self._lines(self._blocks.run >= SHORTEST_RUN, down=down).any():
                bad |= self._lines(frozen(beside.trust(~self._masked), 2), down=down)
        return bad & (self.away | self._noisy_rest), rate >= 0.5 * CHANGING

    def _hot(self, jitter: Array, rest: float, middle: float) -> tuple[Mask, Mask]:
        """Find taxels that are high without a load, or jitter alone."""
        recent = self._blocks.last(FREE_BLOCKS)
        limit = max(rest, AFTER_EFFECT * self._peak, self._light_touch) + middle
        bad = self._blocks.means[recent].min(axis=0) > (limit if self._blocks.free[recent].all() else math.inf)
        low, top = self._blocks.pressures[recent].min(axis=0), self._blocks.pressures[recent].max(axis=0)
        loaded = self._near.values(low > self._pressed, 0.0).sum(axis=1)
        most = (loaded >= 3) & (loaded >= AROUND * self._near.count)
        bad |= most & (low > SPIRE * self._near.values(top, 0.0).max(axis=1))
        bad |= self._jitters_alone(jitter)
        return bad, ~bad & ((loaded >= 3) | ~self.away)

    def _jitters_alone(self, jitter: Array) -> Mask:
        usual = self._near.lowest(jitter, self._near.count.astype(np.int64) // 2, math.inf)  # the median
        blocks = self._blocks.squares > 2 * self._active**2 * np.maximum(self._blocks.new, 1)[:, None]
        alone: Mask = (jitter > np.maximum(self._active, ALONE * usual)) & (blocks.sum(axis=0) >= JUMPY_BLOCKS)
        if not alone.any():
            return alone
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
