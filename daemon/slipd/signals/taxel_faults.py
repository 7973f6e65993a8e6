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

from slipd.fusion.compiled import compiled
from slipd.fusion.ranked import median, ranked
from slipd.signals.pad import STEPS, neighbours
from slipd.signals.taxel_blocks import (
    CHANGES,
    LEAST,
    MEAN,
    PRESSURE,
    REST,
    ROUGH,
    SHARED,
    SHEAR_SQUARES,
    SHEAR_X,
    SHEAR_Y,
    SQUARES,
    WINDOW,
    Blocks,
)
from slipd.types.arrays import Array, Indices, Mask

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
ROUGHNESS = 1.6
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


class Kind(IntEnum):
    """Fault of a taxel, and the index of its row in the result of `TaxelFaults.judge`."""

    STILL = 0
    FROZEN = 1
    HOT = 2
    SATURATED = 3


_STILL, _FROZEN, _HOT = int(Kind.STILL), int(Kind.FROZEN), int(Kind.HOT)
_NOW, _SPAN, _TOP, _SLID, _JITTER, _RATE, _RUN, _FLOOR, _LOW, _HIGH = range(10)
"""What one taxel did over the window, by its row.

- NOW: Mean reading of the newest block.
- SPAN, TOP: Range and maximum of the means.
- SLID: Range of the mean shear.
- JITTER: Standard deviation of the noise that explains the steps.
- RATE: Fraction of the new images in which the bits changed.
- RUN: Number of new images since they last changed.
- FLOOR, LOW, HIGH: Smallest mean, and smallest and largest pressure, of the last FREE_BLOCKS blocks.
"""


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
        self._full = SATURATED * full_scale
        self._threshold, self._light_touch = threshold, light_touch
        self._around = around = neighbours(rows, cols)
        lines = np.arange(rows * cols).reshape(rows, cols)
        self._lines = [
            (np.ascontiguousarray(each), np.ascontiguousarray(around[:, [step[axis] != 0 for step in STEPS]]))
            for axis, each in enumerate((lines, lines.T))
        ]
        self._noise = self._shear_noise = self._spread = math.inf
        self._peak = 0.0
        self._noisy_rest = False
        self.away: Mask = np.zeros(rows * cols, dtype=bool)

    def judge(self, masked: Mask) -> tuple[Mask, Mask]:
        """Rate the taxels by the last blocks.

        Args:
            masked: Taxels that are not trusted, shape (taxels,); they are no reference for their neighbours.

        Returns:
            Taxels that each test rates bad, and good; each of shape (4, taxels), first axis `Kind`.
        """
        blocks, window, threshold = self._blocks, self._blocks.window, self._threshold
        images, total = max(int(blocks.new.sum()), 1), window.sum(axis=0)
        span, recent = np.ptp(window, axis=0), window[blocks.last(FREE_BLOCKS)]
        mean, jitter, rate = recent[0, MEAN], np.sqrt(total[SQUARES] / (2 * images)), total[CHANGES] / images
        pressures = recent[:, PRESSURE]
        did = np.array((
            mean, span[MEAN], window[:, MEAN].max(axis=0), np.hypot(span[SHEAR_X], span[SHEAR_Y]), jitter, rate,
            blocks.run, recent[:, MEAN].min(axis=0), pressures.min(axis=0), pressures.max(axis=0),
        ))  # fmt: skip
        self._noise = _lowest(self._noise, ranked(jitter.copy(), jitter.size // 4))
        shear_noise = math.sqrt(float(total[SHEAR_SQUARES].min()) / (2 * images))
        self._shear_noise = _lowest(self._shear_noise, shear_noise)
        self._peak = max(self._peak * (1.0 - 1.0 / PEAK_TIMES), float(np.where(masked, 0.0, mean).max()))
        middle = median(mean.copy())
        self._spread = _lowest(self._spread, 1.4826 * median(np.abs(mean - middle)))
        active = max(threshold, JITTER * self._noise)
        pressed = max(active, LOADED * self._spread)
        rest = max(HOT_THRESHOLDS * threshold, HOT * self._noise, HOT * self._spread)
        self.away = np.abs(mean) > rest
        resting = rate[(np.abs(mean) <= pressed) & ~masked]
        if 2 * resting.size > rate.size:  # otherwise a lost row might be most of the resting taxels
            self._noisy_rest = median(resting) >= CHANGING
        limit = max(rest, AFTER_EFFECT * self._peak, self._light_touch) + max(middle, 0.0)
        if not blocks.free[blocks.last(FREE_BLOCKS)].all():
            limit = math.inf
        bad, well = np.zeros((2, len(Kind), masked.size), dtype=bool)
        sheared, rests, alone = np.zeros((3, masked.size), dtype=bool)
        _rate(
            self._around, masked, did, window, threshold, active, pressed, limit, self._shear_noise,
            bad, well, sheared, rests, alone,
        )  # fmt: skip
        for lines, beside in self._lines:
            _rate_lines(lines, beside, masked, did, window, threshold, active, bad, well, sheared, rests)
        if alone.any():
            bad[Kind.HOT] |= alone & self._jumps(total, jitter, masked, active, pressed)
        bad[Kind.FROZEN] &= self.away | self._noisy_rest
        well[Kind.HOT] = ~bad[Kind.HOT] & (well[Kind.HOT] | ~self.away)
        full = window[blocks.last(SATURATED_BLOCKS), LEAST].min(axis=0) >= self._full
        bad &= ~full
        bad[Kind.SATURATED], well[Kind.SATURATED] = full, ~full
        return bad, well

    def _jumps(self, total: Array, jitter: Array, masked: Mask, active: float, pressed: float) -> Mask:
        """Return the taxels whose jitter is neither a step, a knock, nor that of the force.

        Args:
            total: Sums of the statistics over the window.
            jitter: Jitter of each taxel.
            masked: Taxels that are not trusted.
            active: Reading from which a taxel is active.
            pressed: Reading from which it is pressed.
        """
        blocks, sum_of_squares = self._blocks, total[SQUARES]
        squares = blocks.window[:, SQUARES]
        loud = (squares > 2 * active**2 * np.maximum(blocks.new, 1)[:, None]).sum(axis=0) >= JUMPY_BLOCKS
        lasts = np.sort(squares, axis=0)[:-KNOCK_BLOCKS].sum(axis=0) > BESIDE_KNOCK * sum_of_squares
        own = np.square(total[SHARED]) < EXPLAINED * (sum_of_squares * total[REST])
        jumps: Mask = loud & lasts & (total[ROUGH] > ROUGHNESS * sum_of_squares) & own
        if blocks.free.all():
            return jumps
        load = total[MEAN] / WINDOW
        several = int(np.count_nonzero(~masked & (load > pressed))) >= 4
        jumps &= (jitter > SHAKEN * np.abs(load)) & (several or bool(blocks.steady.all()))
        return jumps


def _lowest(known: float, seen: float) -> float:
    """Return the updated resting level: a contact raises it for a while, so it rises slowly and falls at once."""
    return seen if seen < known else known + SLOWLY * (seen - known)


@compiled
def _rate(
    around: Indices, masked: Mask, did: Array, window: Array, threshold: float, active: float, pressed: float,
    limit: float, shear_noise: float, bad: Mask, well: Mask, sheared: Mask, rests: Mask, alone: Mask,
) -> None:  # fmt: skip
    """Rate each taxel by its neighbours.

    Args:
        around: Neighbours of each taxel, shape (taxels, 8).
        masked: Taxels that are no reference.
        did: What each taxel did.
        window: Statistics of the blocks.
        threshold: Reading from which a taxel may be active.
        active: Likewise, above the noise.
        pressed: Reading from which a taxel is pressed.
        limit: Mean above which a taxel is hot without a load.
        shear_noise: Noise of the shear.
        bad: Set where a taxel is still, frozen or hot, shape (4, taxels).
        well: Set where it moves, changes, or is among loaded neighbours.
        sheared: Set where its shear moves beyond the pad's noise, and not much less than its neighbours'.
        rests: Set where it rests by itself.
        alone: Set where it jitters more than its neighbours.
    """
    near, jitters = np.empty(8, np.int64), np.empty(8)
    widest = 0.0
    for k in range(len(masked)):
        widest = max(widest, did[_SPAN, k])
    for k in range(len(masked)):
        corner, narrowest, slid, loaded, highest = 0, math.inf, 0.0, 0, 0.0
        for j in around[k]:
            if j >= 0:
                corner += 1
                narrowest = min(narrowest, did[_SPAN, j])
        count = _trusted(around[k], masked, near)
        for n in range(count):
            j = near[n]
            slid += did[_SLID, j]
            loaded += int(did[_LOW, j] > pressed)
            highest = max(highest, did[_HIGH, j])
            jitters[n] = did[_JITTER, j]
        usual = ranked(jitters[:count], count // 2) if count > 0 else math.inf
        span, jitter = did[_SPAN, k], did[_JITTER, k]
        moves, judged = _movement(near[:count], did, window, threshold, active)
        sheared[k] = did[_SLID, k] > max(ABOVE_NOISE * shear_noise, STILL * slid / max(count, 1))
        rounded = corner == 3 and narrowest < PLATEAU * widest
        bad[_STILL, k] = judged and span <= STILL * moves and not rounded and not sheared[k]
        well[_STILL, k] = judged and (span >= MOVING * moves or sheared[k])
        rests[k] = span <= max(threshold, ABOVE_NOISE * jitter)
        bad[_FROZEN, k] = _is_frozen(k, near[:count], did, 3)
        well[_FROZEN, k] = did[_RATE, k] >= 0.5 * CHANGING
        spire = loaded >= 3 and loaded >= AROUND * count and did[_LOW, k] > SPIRE * highest
        bad[_HOT, k], well[_HOT, k] = did[_FLOOR, k] > limit or spire, loaded >= 3
        alone[k] = jitter > max(active, ALONE * usual)


@compiled
def _rate_lines(
    lines: Indices, beside: Indices, masked: Mask, did: Array, window: Array, threshold: float, active: float,
    bad: Mask, well: Mask, sheared: Mask, rests: Mask,
) -> None:  # fmt: skip
    """Rate rows or columns by those beside them: a lost one is still or frozen as a whole.

    Args:
        lines: Taxels of each line, shape (lines, k).
        beside: Neighbours of each taxel in other lines, shape (taxels, 6).
        masked: As for `_rate`, like the next four.
        did: Likewise.
        window: Likewise.
        threshold: Likewise.
        active: Likewise.
        bad: As `_rate` left it, updated.
        well: Likewise.
        sheared: As `_rate` left it.
        rests: Likewise.
    """
    near, lost = np.empty(8, np.int64), False
    for line in lines[1:-1]:
        resting = 0
        for k in line:
            resting += int(rests[k])
        lost = lost or resting == len(line)
    for at in range(len(lines)):
        line, still, idle, frozen, moving, trusted = lines[at], 0, 0, 0, 0, 0
        for k in line:
            count = _trusted(beside[k], masked, near)
            moves, judged = _movement(near[:count], did, window, threshold, active)
            is_still = judged and did[_SPAN, k] <= STILL * moves and not sheared[k]
            still += int(is_still)
            idle += int(is_still or rests[k])
            frozen += int(_is_frozen(k, near[:count], did, 2))
            moving += int(well[_STILL, k])
            trusted += int(not (well[_STILL, k] or masked[k]))
        dead = lost and 0 < at < len(lines) - 1 and idle == len(line) and still >= LINE_TAXELS
        for k in line:
            bad[_STILL, k] |= dead
            bad[_FROZEN, k] |= frozen == len(line)
            well[_STILL, k] |= trusted == 0 and moving >= LINE_TAXELS


@compiled
def _trusted(around: Indices, masked: Mask, near: Indices) -> int:
    """Fill in the neighbours of one taxel that are not masked; return their number."""
    count = 0
    for j in around:
        if j >= 0 and not masked[j]:
            near[count] = j
            count += 1
    return count


@compiled
def _movement(near: Indices, did: Array, window: Array, threshold: float, active: float) -> tuple[float, bool]:
    """Return how far the mean of some neighbours moves, and whether nearly all of them move with it."""
    count, jitter, along, lowest, highest = len(near), 0.0, 0, math.inf, -math.inf
    for block in range(WINDOW):
        total = 0.0
        for j in near:
            total += window[block, MEAN, j]
        lowest, highest = min(lowest, total), max(highest, total)
    moves = (highest - lowest) / max(count, 1)
    for j in near:
        jitter += did[_JITTER, j]
        along += int(did[_TOP, j] > active and did[_SPAN, j] >= MOVING * moves)
    beyond_noise = moves > max(threshold, ABOVE_NOISE * jitter / max(count, 1))
    return moves, beyond_noise and count >= 3 and along >= count - int(count >= 7)


@compiled
def _is_frozen(k: int, near: Indices, did: Array, least: int) -> bool:
    """Return whether the bits of a taxel rest for longer than chance allows beside some neighbours."""
    lowest, second = 1.0, 1.0  # a frozen neighbour does not hide it
    for j in near:
        if did[_RATE, j] < lowest:
            lowest, second = did[_RATE, j], lowest
        elif did[_RATE, j] < second:
            second = did[_RATE, j]
    unlikely = -did[_RUN, k] * math.log1p(-min(second, 0.95))
    return len(near) >= least and second >= CHANGING and unlikely >= CHANCE
