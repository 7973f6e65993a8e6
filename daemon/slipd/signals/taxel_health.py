"""Which taxels of a pad can be believed: dead, stuck, hot and saturated ones, lost rows and columns.

A taxel is judged by what its neighbours do, for nothing else says what it ought to read. Images are gathered into
blocks of about 0.1 s; at the end of every other block four tests look at the last ``WINDOW`` blocks, and each says bad,
well or nothing of each taxel:

* still: it rests while all the neighbours around it move together, as they do under a load that changes. The edge of a
  contact has neighbours that rest, a pivot line neighbours that move against each other: neither is judged.
* frozen: its bits stay the same for longer than chance allows while its neighbours' bits keep changing.
* hot: it is high while nothing touches the pad, or far above loaded neighbours, or it jitters by itself.
* saturated: it is at full scale.

What images cannot tell: a hole of one taxel in a contact looks like a dead taxel, and a straight groove over one row
like a lost row; both are filled from their surroundings, and given back when they are felt anew. A first or last row
that reads noise round zero looks like the far side of a contact's edge, and is not told; neither is a constant high
reading beside a contact, before the pad is free.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slipd.signals.pad import STEPS, neighbours

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK_NS = 90_000_000
"""A block ends with the first image this long after the last block's end: three images at 30 Hz."""
WINDOW = 8
"""Blocks that are judged together: what is lost shows within 0.9 s, and a slow press has time to move something."""
GAP_NS = 500_000_000
"""After a longer silence what was gathered is forgotten: nobody saw what happened."""
BLOCK_IMAGES = 64
"""Images a block keeps; at more than 700 Hz the rest of its time is not looked at."""
JUDGED_BLOCKS = 2
"""Blocks from one judgement to the next."""
RECOVERY = np.array(((25,), (25,), (25,), (2,)))
"""Times, about 4.5 s, that a masked taxel must have been judged well, never bad between, before it is believed again;
for one that was saturated, which a hard grip may do to a good one, about 0.4 s."""

STILL = 0.15
"""A taxel that moves less than this share of its neighbours' mean is still; gains differ by far less."""
MOVING = 0.3
"""A taxel that moves at least this share is well."""
ABOVE_NOISE = 4.0
"""Movement that counts, over the neighbours' jitter: four times what block means of three images do by chance."""
PLATEAU = 0.8
"""A corner is judged only where its three neighbours move at least this share of the pad's largest movement: a rounded
contact that leaves the corner out has lost more of its pressure there."""
CHANGING = 0.5
"""Share of images with new bits from which noise is wide enough that no taxel rests within one count."""
CHANCE = -math.log(1e-12)
"""A run of unchanged bits is told where chance makes it less often than once in 1e12: once a year on 128 taxels."""
SHORTEST_RUN = 9
"""No run of unchanged bits is told that is shorter."""
FREE_BLOCKS = 5
"""Blocks that a taxel must be high for: longer than a touch that is on its way to be felt by the force sensor."""
HOT = 12.0
"""Hot is this many times the noise, or the spread of the resting pad, above the pad's median."""
SLOWLY = 0.01
"""Share of a rise that is taken for a change of the pad at rest; a fall is taken at once."""
HOT_THRESHOLDS = 10.0
"""Hot is this many times the threshold from which a taxel counts as active."""
AFTER_EFFECT = 0.1
"""Share of the largest reading that rubber may go on pressing with after a release."""
PEAK_TIMES = 300.0
"""Judgements, about a minute, after which the largest reading is forgotten."""
SPIRE = 6.0
"""Loaded neighbours all round make a reading this many times theirs impossible: rubber spreads a point."""
LOADED = 4.0
"""A taxel is pressed from this many times the spread of the resting pad; where it counts, several are at once."""
AROUND = 0.6
"""Share of the neighbours that must be loaded for that."""
JITTER = 8.0
"""A jitter counts from this many times the pad's noise."""
ALONE = 5.0
"""A taxel jitters by itself from this many times its neighbours' jitter, or the pad's, relative to the load."""
ROUGH = 1.6
"""Mean square of second over first differences: 3 for white noise, 2 for jumps, below 1 for motion well sampled."""
SHAKEN = 0.3
"""Of the load, what a force that does not move can shake it by."""
EXPLAINED = 0.2
"""A jitter of which the pad's own explains more than this share is that of the force."""
JUMPY_BLOCKS = 3
"""Blocks of the window with such a jitter: one alone may be a step, such as a tare."""
SATURATED = 0.97
"""Share of full scale at which a taxel is saturated: taxels with offsets of their own stop a little apart."""
SATURATED_BLOCKS = 2

USABLE_SHARE = 0.25
"""With a larger share of its taxels masked, an image is no longer used."""

_STILL, _FROZEN, _HOT, _SATURATED = range(4)
_OTHER_ROWS = [k for k, (down, _) in enumerate(STEPS) if down]
_OTHER_COLS = [k for k, (_, right) in enumerate(STEPS) if right]


class TaxelHealth:
    """Watches the taxels of one pad.

    Args:
        rows: Rows of the scan.
        cols: Columns of the scan.
        full_scale: Largest reading the pad can give, in the unit of the readings; None where it is not known: a taxel
            at full scale is then told as stuck or hot.
        threshold: Reading from which a taxel counts as active.
        light_touch: Largest normal force that may press while ``known_free`` is told, in the unit of the readings.

    Attributes:
        masked: Taxels that are not to be believed, shape (taxels,); a new array whenever it changes.

    Raises:
        ValueError: A pad without taxels, or a full scale that is not positive.
    """

    def __init__(
        self, rows: int, cols: int, *, full_scale: float | None = None, threshold: float = 0.0, light_touch: float = 0.0
    ) -> None:
        if rows < 1 or cols < 1:
            raise ValueError(f"a pad of {rows} x {cols} taxels: each side must be at least 1")
        if full_scale is not None and not full_scale > 0.0:
            raise ValueError(f"full_scale must be positive, or None where it is not known, not {full_scale}")
        self._grid = rows, cols
        self._full = math.inf if full_scale is None else SATURATED * full_scale
        self._threshold, self._light_touch = threshold, light_touch
        taxels = rows * cols
        self._around = neighbours(rows, cols)
        self._within = self._around >= 0
        self._corner = self._within.sum(axis=1) == 3
        row, col = np.divmod(np.arange(taxels), cols)
        self._inner_rows = (row > 0) & (row < rows - 1)
        self._inner_cols = (col > 0) & (col < cols - 1)
        self.masked: Mask = np.zeros(taxels, dtype=bool)
        self._bad = np.zeros((4, taxels), dtype=bool)
        self._well = np.zeros((4, taxels), dtype=np.int64)
        self._images = np.empty((BLOCK_IMAGES + 2, taxels))  # the first two are the last of the block before
        self._means, self._least, self._pressures = np.zeros((3, WINDOW, taxels))
        self._squares, self._rough, self._shared, self._rest = np.zeros((4, WINDOW, taxels))
        self._changes = np.zeros((WINDOW, taxels), dtype=np.int64)
        self._new = np.zeros(WINDOW, dtype=np.int64)
        self._free = np.zeros(WINDOW, dtype=bool)
        self._steady = np.zeros(WINDOW, dtype=bool)
        self._run = np.zeros(taxels, dtype=np.int64)
        self._noise = self._spread = math.inf
        self._peak = 0.0
        self._active = self._pressed = threshold
        self._noisy_rest = False
        self._away = np.zeros(taxels, dtype=bool)  # far from where the pad rests
        self._last_ns: int | None = None

    @property
    def usable(self) -> bool:
        """Few enough taxels are masked for the image to tell the contact."""
        return int(np.count_nonzero(self.masked)) <= USABLE_SHARE * self.masked.size

    def update(
        self,
        values: Array,
        t_ns: int,
        known_free: bool | None,
        force_moving: bool | None,
        pressure: Array | None = None,
    ) -> None:
        """Takes an image; one that holds a reading which is no number is left out.

        Args:
            values: Normal readings after tare and scale, shape (taxels,); of a charge pad before the reconstruction.
            t_ns: Time of the image.
            known_free: The force sensor reads no contact; None where there is none.
            force_moving: The force sensor's normal force moves beyond its noise; None where there is none.
            pressure: What a charge pad's reconstruction makes of the image, shape (taxels,), NaN where it does not
                know; None where the readings are the pressure.

        Raises:
            ValueError: A wrong shape.
        """
        if values.shape != self.masked.shape:
            raise ValueError(f"an image of shape {values.shape}: this pad has {self.masked.shape}")
        if not math.isfinite(float(np.dot(values, values))):
            return
        if self._last_ns is None or not 0 <= t_ns - self._last_ns <= GAP_NS:
            self._begin(values, t_ns)
        self._last_ns = t_ns
        if self._count < len(self._images):
            self._images[self._count] = values
            self._count += 1
        self._all_free &= known_free is True
        self._all_steady &= force_moving is False
        if t_ns - self._block_ns >= BLOCK_NS:
            self._end_block(t_ns, pressure)

    def report(self) -> dict[str, list[int]]:
        """Tells what is masked: indices of taxels by kind, and of rows and columns that are lost as a whole."""
        rows, cols = self._grid
        lost = self.masked.reshape(rows, cols)
        lost_rows: Mask = np.asarray(lost.all(axis=1) & (rows > 1))
        lost_cols: Mask = np.asarray(lost.all(axis=0) & (cols > 1))
        single = self.masked & ~np.logical_or(lost_rows[:, None], lost_cols).ravel()
        still = (self._bad[_STILL] | self._bad[_FROZEN]) & ~(self._bad[_HOT] | self._bad[_SATURATED])
        told = {
            "dead": single & still & ~self._away,
            "stuck": single & still & self._away,
            "hot": single & self._bad[_HOT] & ~self._bad[_SATURATED],
            "saturated": single & self._bad[_SATURATED],
            "row": lost_rows,
            "column": lost_cols,
        }
        return {kind: np.flatnonzero(which).tolist() for kind, which in told.items()}

    def repair(self, pressure: Array) -> Array:
        """Puts the median of its believed neighbours in place of each masked taxel.

        On simulated contacts with one of their taxels masked this leaves half the error in λ and in the limit torque
        that the mean leaves, and a tenth of what leaving the taxel out does (medians 0.06, 0.16 and 0.6 % of λ); with a
        quarter of the pad masked it is 0.9 %, and under 8 % for 19 contacts of 20.

        Args:
            pressure: Shape (taxels,).

        Returns:
            The same array where nothing is masked, else a new one; 0 where a masked taxel has no believed neighbour.
        """
        gone = np.flatnonzero(self.masked)
        if gone.size == 0:
            return pressure
        around = self._around[gone]
        believed = np.append(~self.masked, False)[around]
        near = np.sort(np.where(believed, np.append(pressure, 0.0)[around], math.inf), axis=1)
        count = believed.sum(axis=1, keepdims=True)
        middles = np.take_along_axis(
            near, np.hstack((np.maximum(count - 1, 0) // 2, np.minimum(count // 2, 7))), axis=1
        )
        mended = pressure.copy()
        mended[gone] = np.where(count[:, 0] > 0, middles.mean(axis=1), 0.0)
        return mended

    def _begin(self, values: Array, t_ns: int) -> None:
        self._images[:2] = values
        self._count = 2
        self._all_free = self._all_steady = True
        self._block_ns = t_ns
        self._blocks = 0
        self._run[:] = 0

    def _end_block(self, t_ns: int, pressure: Array | None) -> None:
        """Puts what the block's images tell in place of the oldest block, and judges."""
        images = self._images[: self._count]
        steps = np.diff(images, axis=0)
        slot = self._blocks % WINDOW
        self._means[slot] = images[2:].mean(axis=0)
        self._pressures[slot] = self._means[slot] if pressure is None else np.nan_to_num(pressure)
        self._least[slot] = np.abs(images[2:]).min(axis=0)
        self._squares[slot] = np.square(steps[1:]).sum(axis=0)
        self._rough[slot] = np.square(np.diff(steps, axis=0)).sum(axis=0)
        rest = steps[1:].sum(axis=1, keepdims=True) - steps[1:]
        self._shared[slot] = (steps[1:] * rest).sum(axis=0)
        self._rest[slot] = np.square(rest).sum(axis=0)
        changed = steps[1:] != 0.0
        changed = changed[changed.any(axis=1)]  # an image that repeats the one before says nothing of a taxel
        self._new[slot] = len(changed)
        self._changes[slot] = changed.sum(axis=0)
        if len(changed):
            since = np.argmax(changed[::-1], axis=0)
            self._run = np.where(self._changes[slot] > 0, since, self._run + len(changed))
        self._free[slot], self._steady[slot] = self._all_free, self._all_steady
        self._blocks += 1
        self._images[:2] = images[-2:]
        self._count, self._block_ns = 2, t_ns
        self._all_free = self._all_steady = True
        if self._blocks >= WINDOW and self._blocks % JUDGED_BLOCKS == 0:
            self._judge(slot)

    def _judge(self, slot: int) -> None:
        new = max(int(self._new.sum()), 1)
        jitter = np.sqrt(self._squares.sum(axis=0) / (2 * new))
        floor = float(np.partition(jitter, jitter.size // 4)[jitter.size // 4])
        self._noise = _lowest(self._noise, floor)
        self._peak *= 1.0 - 1.0 / PEAK_TIMES
        self._peak = max(self._peak, float(np.where(self.masked, 0.0, self._means[slot]).max()))
        mean = self._means[slot]
        middle = float(np.median(mean))
        self._spread = _lowest(self._spread, 1.4826 * float(np.median(np.abs(mean - middle))))
        self._active = max(self._threshold, JITTER * self._noise)
        self._pressed = max(self._active, LOADED * self._spread)
        rest = max(HOT_THRESHOLDS * self._threshold, HOT * self._noise, HOT * self._spread)
        self._away = np.abs(mean) > rest
        believed = np.append(~self.masked, False)[self._around]
        full, _ = saturated = self._saturated(slot)
        tests = (
            self._still(jitter, believed),
            self._frozen(new, np.abs(mean) <= self._pressed, believed),
            self._hot(slot, jitter, rest, max(middle, 0.0), believed),
        )
        for kind, (bad, well) in enumerate((*((bad & ~full, well) for bad, well in tests), saturated)):
            self._well[kind] = np.where(bad, 0, self._well[kind] + well)
            self._bad[kind] |= bad
        self._bad &= self._well < RECOVERY
        self.masked = np.logical_or.reduce(self._bad, axis=0)

    def _still(self, jitter: Array, believed: Mask) -> tuple[Mask, Mask]:
        """Tells what rests while its surroundings move: one taxel by all its neighbours, a line by those beside it."""
        span = np.ptp(self._means, axis=0)
        near = np.append(self._means, np.zeros((WINDOW, 1)), axis=1)[:, self._around]
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
        bad = judged & (span <= STILL * moves) & (plateau | ~self._corner)
        well = judged & (span >= MOVING * moves)
        rests = span <= np.maximum(self._threshold, ABOVE_NOISE * jitter)
        for inner, beside, axis in ((self._inner_rows, _OTHER_ROWS, 1), (self._inner_cols, _OTHER_COLS, 0)):
            if self._lines(rests & inner, axis).any():
                use = np.zeros_like(believed)
                use[:, beside] = believed[:, beside]
                moves, judged = surroundings(use)
                still = judged & inner & (span <= STILL * moves)
                bad |= self._lines(still | rests, axis) & self._several(still, axis)
            if self.masked.any():
                well |= self._lines(well | self.masked, axis) & self._several(well, axis)
        return bad, well

    def _lines(self, which: Mask, axis: int) -> Mask:
        """Leaves of the taxels those in lines where all are so."""
        every = which.reshape(self._grid).all(axis=axis, keepdims=True)
        return np.broadcast_to(every, self._grid).ravel()

    def _several(self, which: Mask, axis: int) -> Mask:
        """Tells the taxels in lines where at least three are so."""
        several = which.reshape(self._grid).sum(axis=axis, keepdims=True) >= 3
        return np.broadcast_to(several, self._grid).ravel()

    def _frozen(self, new: int, resting: Mask, believed: Mask) -> tuple[Mask, Mask]:
        """Tells whose bits rest for longer than chance allows; at rest only on a pad whose rest is noisy."""
        rate = self._changes.sum(axis=0) / new
        resting = resting & ~self.masked
        if 2 * np.count_nonzero(resting) > resting.size:  # else a lost row might be most of what rests
            self._noisy_rest = float(np.median(rate[resting])) >= CHANGING
        near = np.append(rate, 1.0)[self._around]

        def frozen(use: Mask, least: int) -> Mask:
            lowest = np.partition(np.where(use, near, 1.0), 1, axis=1)[:, 1]  # a frozen neighbour does not hide it
            unlikely = -self._run * np.log1p(-np.minimum(lowest, 0.95))
            told: Mask = (use.sum(axis=1) >= least) & (lowest >= CHANGING) & (unlikely >= CHANCE)
            return told

        bad = frozen(believed, 3)
        for beside, axis in ((_OTHER_ROWS, 1), (_OTHER_COLS, 0)):
            if not self._lines(self._run >= SHORTEST_RUN, axis).any():
                continue
            use = np.zeros_like(believed)
            use[:, beside] = believed[:, beside]
            bad |= self._lines(frozen(use, 2), axis)
        return bad & (self._away | self._noisy_rest), rate >= 0.5 * CHANGING

    def _hot(self, slot: int, jitter: Array, rest: float, middle: float, believed: Mask) -> tuple[Mask, Mask]:
        """Tells what is high for no reason, or jitters by itself."""
        recent = (slot - np.arange(FREE_BLOCKS)) % WINDOW
        limit = max(rest, AFTER_EFFECT * self._peak, self._light_touch) + middle
        bad = self._means[recent].min(axis=0) > (limit if self._free[recent].all() else math.inf)
        low, top = self._pressures[recent].min(axis=0), self._pressures[recent].max(axis=0)
        near_low, near_top = np.append(low, 0.0)[self._around], np.append(top, 0.0)[self._around]
        loaded = (believed & (near_low > self._pressed)).sum(axis=1)
        highest = near_top.max(axis=1, where=believed, initial=0.0)
        bad |= (loaded >= 3) & (loaded >= AROUND * believed.sum(axis=1)) & (low > SPIRE * highest)
        bad |= self._jitters_alone(jitter, believed)
        return bad, ~bad & ((loaded >= 3) | ~self._away)

    def _jitters_alone(self, jitter: Array, believed: Mask) -> Mask:
        count = believed.sum(axis=1, keepdims=True)
        near = np.sort(np.where(believed, np.append(jitter, 0.0)[self._around], math.inf), axis=1)
        usual = np.take_along_axis(near, np.minimum(count // 2, near.shape[1] - 1), axis=1)[:, 0]
        blocks = self._squares > 2 * self._active**2 * np.maximum(self._new, 1)[:, None]
        alone: Mask = (jitter > np.maximum(self._active, ALONE * usual)) & (blocks.sum(axis=0) >= JUMPY_BLOCKS)
        alone &= self._rough.sum(axis=0) > ROUGH * self._squares.sum(axis=0)
        power = self._squares.sum(axis=0) * self._rest.sum(axis=0)
        alone &= np.square(self._shared.sum(axis=0)) < EXPLAINED * power
        if self._free.all():
            return alone
        load = self._means.mean(axis=0)
        alone &= jitter > SHAKEN * np.abs(load)
        pressed = int(np.count_nonzero(~self.masked & (load > self._pressed)))
        return alone if self._steady.all() or pressed >= 4 else np.zeros_like(alone)

    def _saturated(self, slot: int) -> tuple[Mask, Mask]:
        recent = (slot - np.arange(SATURATED_BLOCKS)) % WINDOW
        bad = self._least[recent].min(axis=0) >= self._full
        return bad, ~bad


def _lowest(known: float, seen: float) -> float:
    """What the pad does at rest: a contact raises it for a while, and that is forgotten slowly."""
    return seen if seen < known else known + SLOWLY * (seen - known)
