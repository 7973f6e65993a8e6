"""Rate the taxels of a pad by comparison with their neighbours: compiled.

`slipd.signals.taxel_faults` explains the tests, and prepares what each taxel did over the last blocks of images.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.ranked import ranked
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
SPIRE = 6.0
"""Among loaded neighbours a reading of this multiple is impossible: rubber spreads a point load."""
AROUND = 0.6
"""Fraction of the neighbours that must be loaded for that."""
ALONE = 5.0
"""A taxel jitters alone from this multiple of its neighbours' jitter, or of the pad's, relative to the load."""
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
"""Statistics of one taxel over the window, by their row.

- NOW: Mean reading of the newest block.
- SPAN, TOP: Range and maximum of the means.
- SLID: Range of the mean shear.
- JITTER: Standard deviation of the noise that explains the steps.
- RATE: Fraction of the new images in which the bits changed.
- RUN: Number of new images since they last changed.
- FLOOR, LOW, HIGH: Smallest mean, and smallest and largest pressure, of the last FREE_BLOCKS blocks.
"""


@compiled
def rate_taxels(
    around: Indices, masked: Mask, stats: Array, means: Array, threshold: float, active: float, pressed: float,
    limit: float, shear_noise: float, bad: Mask, good: Mask, sheared: Mask, rests: Mask, alone: Mask,
) -> None:  # fmt: skip
    """Rate each taxel by its neighbours.

    Args:
        around: Neighbours of each taxel, shape (taxels, 8).
        masked: Taxels that are no reference.
        stats: Statistics of each taxel over the window, shape (10, taxels).
        means: Mean reading of each taxel in each block, shape (blocks, taxels).
        threshold: Reading from which a taxel may be active.
        active: Likewise, above the noise.
        pressed: Reading from which a taxel is pressed.
        limit: Mean above which a taxel is hot without a load.
        shear_noise: Noise of the shear.
        bad: Set where a taxel is still, frozen or hot, shape (4, taxels).
        good: Set where it moves, changes, or is among loaded neighbours.
        sheared: Set where its shear moves beyond the pad's noise, and not much less than its neighbours'.
        rests: Set where it rests by itself.
        alone: Set where it jitters more than its neighbours.
    """
    near, jitters = np.empty(8, np.int64), np.empty(8)
    widest = 0.0
    for k in range(len(masked)):
        widest = max(widest, stats[_SPAN, k])
    for k in range(len(masked)):
        corner, narrowest, slid, loaded, highest = 0, math.inf, 0.0, 0, 0.0
        for j in around[k]:
            if j >= 0:
                corner += 1
                narrowest = min(narrowest, stats[_SPAN, j])
        count = _trusted(around[k], masked, near)
        for n in range(count):
            j = near[n]
            slid += stats[_SLID, j]
            loaded += int(stats[_LOW, j] > pressed)
            highest = max(highest, stats[_HIGH, j])
            jitters[n] = stats[_JITTER, j]
        usual = ranked(jitters[:count], count // 2) if count > 0 else math.inf
        span, jitter = stats[_SPAN, k], stats[_JITTER, k]
        moves, judged = _movement(near[:count], stats, means, threshold, active)
        sheared[k] = stats[_SLID, k] > max(ABOVE_NOISE * shear_noise, STILL * slid / max(count, 1))
        rounded = corner == 3 and narrowest < PLATEAU * widest
        bad[_STILL, k] = judged and span <= STILL * moves and not rounded and not sheared[k]
        good[_STILL, k] = judged and (span >= MOVING * moves or sheared[k])
        rests[k] = span <= max(threshold, ABOVE_NOISE * jitter)
        bad[_FROZEN, k] = _is_frozen(k, near[:count], stats, 3)
        good[_FROZEN, k] = stats[_RATE, k] >= 0.5 * CHANGING
        spire = loaded >= 3 and loaded >= AROUND * count and stats[_LOW, k] > SPIRE * highest
        bad[_HOT, k], good[_HOT, k] = stats[_FLOOR, k] > limit or spire, loaded >= 3
        alone[k] = jitter > max(active, ALONE * usual)


@compiled
def rate_lines(
    lines: Indices, beside: Indices, masked: Mask, stats: Array, means: Array, threshold: float, active: float,
    bad: Mask, good: Mask, sheared: Mask, rests: Mask,
) -> None:  # fmt: skip
    """Rate rows or columns by those beside them: a lost one is still or frozen as a whole.

    Args:
        lines: Taxels of each line, shape (lines, k).
        beside: Neighbours of each taxel in other lines, shape (taxels, 6).
        masked: As for `rate_taxels`, like the next four.
        stats: Likewise.
        means: Likewise.
        threshold: Likewise.
        active: Likewise.
        bad: As `rate_taxels` left it, updated.
        good: Likewise.
        sheared: As `rate_taxels` left it.
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
        inner = lost and 0 < at < len(lines) - 1
        for k in line:
            count = _trusted(beside[k], masked, near)
            if inner:
                moves, judged = _movement(near[:count], stats, means, threshold, active)
                is_still = judged and stats[_SPAN, k] <= STILL * moves and not sheared[k]
                still += int(is_still)
                idle += int(is_still or rests[k])
            frozen += int(_is_frozen(k, near[:count], stats, 2))
            moving += int(good[_STILL, k])
            trusted += int(not (good[_STILL, k] or masked[k]))
        dead = inner and idle == len(line) and still >= LINE_TAXELS
        for k in line:
            bad[_STILL, k] |= dead
            bad[_FROZEN, k] |= frozen == len(line)
            good[_STILL, k] |= trusted == 0 and moving >= LINE_TAXELS


@compiled_part
def _trusted(around: Indices, masked: Mask, near: Indices) -> int:
    """Fill in the neighbours of one taxel that are not masked; return their number."""
    count = 0
    for j in around:
        if j >= 0 and not masked[j]:
            near[count] = j
            count += 1
    return count


@compiled_part
def _movement(near: Indices, stats: Array, means: Array, threshold: float, active: float) -> tuple[float, bool]:
    """Return how far the mean of some neighbours moves, and whether nearly all of them move with it."""
    count, jitter, along, lowest, highest = len(near), 0.0, 0, math.inf, -math.inf
    for block in range(len(means)):
        total = 0.0
        for j in near:
            total += means[block, j]
        lowest, highest = min(lowest, total), max(highest, total)
    moves = (highest - lowest) / max(count, 1)
    for j in near:
        jitter += stats[_JITTER, j]
        along += int(stats[_TOP, j] > active and stats[_SPAN, j] >= MOVING * moves)
    beyond_noise = moves > max(threshold, ABOVE_NOISE * jitter / max(count, 1))
    return moves, beyond_noise and count >= 3 and along >= count - int(count >= 7)


@compiled_part
def _is_frozen(k: int, near: Indices, stats: Array, least: int) -> bool:
    """Return whether the bits of a taxel rest for longer than chance allows beside some neighbours."""
    lowest, second = 1.0, 1.0  # a frozen neighbour does not hide it
    for j in near:
        if stats[_RATE, j] < lowest:
            lowest, second = stats[_RATE, j], lowest
        elif stats[_RATE, j] < second:
            second = stats[_RATE, j]
    unlikely = -stats[_RUN, k] * math.log1p(-min(second, 0.95))
    return len(near) >= least and second >= CHANGING and unlikely >= CHANCE
