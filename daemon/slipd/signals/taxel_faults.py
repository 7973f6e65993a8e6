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

import numpy as np

from slipd.fusion.ranked import ranked
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
from slipd.signals.taxel_neighbours import CHANGING, Kind, rate_lines, rate_taxels
from slipd.types.arrays import Array, Mask

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
LOADED = 4.0
"""A taxel is pressed from this multiple of the spread of the resting pad; the rules need several at once."""
JITTER = 8.0
"""A jitter counts from this multiple of the pad's noise."""
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
        span, recent = np.ptp(window[:, : SHEAR_Y + 1], axis=0), window[blocks.last(FREE_BLOCKS)]
        mean, jitter, rate = recent[0, MEAN], np.sqrt(total[SQUARES] / (2 * images)), total[CHANGES] / images
        means, pressures = np.ascontiguousarray(window[:, MEAN]), recent[:, PRESSURE]
        stats = np.array((
            mean, span[MEAN], means.max(axis=0), np.hypot(span[SHEAR_X], span[SHEAR_Y]), jitter, rate,
            blocks.run, recent[:, MEAN].min(axis=0), pressures.min(axis=0), pressures.max(axis=0),
        ))  # fmt: skip
        self._noise = _lowest(self._noise, ranked(jitter.copy(), jitter.size // 4))
        shear_noise = math.sqrt(float(total[SHEAR_SQUARES].min()) / (2 * images))
        self._shear_noise = _lowest(self._shear_noise, shear_noise)
        self._peak = max(self._peak * (1.0 - 1.0 / PEAK_TIMES), float(np.where(masked, 0.0, mean).max()))
        middle = float(np.median(mean))
        self._spread = _lowest(self._spread, 1.4826 * float(np.median(np.abs(mean - middle))))
        active = max(threshold, JITTER * self._noise)
        pressed = max(active, LOADED * self._spread)
        rest = max(HOT_THRESHOLDS * threshold, HOT * self._noise, HOT * self._spread)
        self.away = np.abs(mean) > rest
        resting = rate[(np.abs(mean) <= pressed) & ~masked]
        if 2 * resting.size > rate.size:  # otherwise a lost row might be most of the resting taxels
            self._noisy_rest = bool(np.median(resting) >= CHANGING)
        limit = max(rest, AFTER_EFFECT * self._peak, self._light_touch) + max(middle, 0.0)
        if not blocks.free[blocks.last(FREE_BLOCKS)].all():
            limit = math.inf
        bad, good = np.zeros((2, len(Kind), masked.size), dtype=bool)
        sheared, rests, alone = np.zeros((3, masked.size), dtype=bool)
        rate_taxels(
            self._around, masked, stats, means, threshold, active, pressed, limit, self._shear_noise,
            bad, good, sheared, rests, alone,
        )  # fmt: skip
        for lines, beside in self._lines:
            rate_lines(lines, beside, masked, stats, means, threshold, active, bad, good, sheared, rests)
        if alone.any():
            bad[Kind.HOT] |= alone & self._jumps(total, jitter, masked, active, pressed)
        bad[Kind.FROZEN] &= self.away | self._noisy_rest
        good[Kind.HOT] = ~bad[Kind.HOT] & (good[Kind.HOT] | ~self.away)
        full = window[blocks.last(SATURATED_BLOCKS), LEAST].min(axis=0) >= self._full
        bad &= ~full
        bad[Kind.SATURATED], good[Kind.SATURATED] = full, ~full
        return bad, good

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
