"""Mask taxels that cannot be trusted: dead, stuck, hot and saturated ones, lost rows and columns.

A taxel that is rated bad (`slipd.signals.taxel_faults`) is masked, and filled from its neighbours, until it has been
rated good for some seconds. A hole in a contact looks like a dead taxel and is treated like one until it moves again.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.signals.pad import neighbours
from slipd.signals.taxel_blocks import WINDOW, Blocks
from slipd.signals.taxel_faults import TaxelFaults
from slipd.signals.taxel_neighbours import Kind
from slipd.types.arrays import Array, Mask

FROZEN_IMAGES = 3
"""Number of images in a row that equal the one before. XELA's server repeats 7 % of its images, never two in a row."""
FROZEN_NS = 85_000_000
"""Least time since the last new image: with three repeats, 100 ms at 30 Hz and more, jitter included."""
JUDGED_BLOCKS = 2
"""Blocks from one rating to the next."""
RECOVERY = np.array(((25,), (25,), (25,), (2,)))
"""Consecutive good ratings, by `Kind`, before a masked taxel is trusted again: about 4.5 s, and about 0.4 s after
saturation, which a hard grip may cause in a good taxel."""
USABLE_SHARE = 0.25
"""Fraction of masked taxels above which an image is not used."""


class FrozenImage:
    """Detects a tactile array that hangs: its image stays the same while the force on it changes.

    Args:
        force_step_n: Change of the normal force that the image must show, N: several times the noise of the force
            sensor, and enough to change a reading of the pad by several counts.

    Attributes:
        suspect: The newest image repeats the one before although the force changed. It may have been sent twice; no
            grip is raised on it.
    """

    def __init__(self, force_step_n: float) -> None:
        self._step_n = force_step_n
        self._bits = b""
        self._repeats = 0
        self._since_ns = 0
        self._low_n, self._high_n = math.inf, -math.inf
        self.suspect = False

    def update(self, values: Array, t_ns: int, normal_n: float | None) -> bool:
        """Update with an image; return whether the array hangs.

        Args:
            values: Readings as received, any shape.
            t_ns: Time of the image.
            normal_n: Normal force of the force sensor, N; None or NaN if not known. Without it no pad is reported:
                a pad without noise may rest as long as its load.
        """
        bits = values.tobytes()
        if bits != self._bits:
            self._bits, self._repeats, self._since_ns = bits, 0, t_ns
            self._low_n, self._high_n = math.inf, -math.inf
        else:
            self._repeats += 1
        if normal_n is not None:
            if normal_n < self._low_n:
                self._low_n = normal_n
            if normal_n > self._high_n:
                self._high_n = normal_n
        self.suspect = self._repeats > 0 and self._high_n - self._low_n >= self._step_n
        return self.suspect and self._repeats >= FROZEN_IMAGES and t_ns - self._since_ns >= FROZEN_NS


class TaxelHealth:
    """Watches the taxels of one pad.

    Args:
        rows: Rows of the scan.
        cols: Columns of the scan.
        full_scale: Largest reading of the pad, in the unit of the readings; None if not known: a taxel at full scale is
            then reported as stuck or hot.
        threshold: Reading from which a taxel counts as active.
        light_touch: Largest normal force that may press while ``known_free`` is True, in the unit of the readings.

    Attributes:
        masked: Taxels that are not trusted, shape (taxels,); a new array whenever it changes.
        masks: At least one taxel is masked.
        measured: Taxels that are not, shape (taxels,); None: all.
    """

    def __init__(
        self, rows: int, cols: int, *, full_scale: float | None = None, threshold: float = 0.0, light_touch: float = 0.0
    ) -> None:
        self._grid = rows, cols
        taxels = rows * cols
        self._around = neighbours(rows, cols)
        self._blocks = Blocks(taxels)
        full = math.inf if full_scale is None else full_scale
        self._faults = TaxelFaults(self._blocks, rows, cols, full, threshold, light_touch)
        self.masked: Mask = np.zeros(taxels, dtype=bool)
        self.masks = False
        self.measured: Mask | None = None
        self._bad = np.zeros((len(Kind), taxels), dtype=bool)
        self._good = np.zeros((len(Kind), taxels), dtype=np.int64)

    @property
    def usable(self) -> bool:
        """Few enough taxels are masked for the image to show the contact."""
        return int(np.count_nonzero(self.masked)) <= USABLE_SHARE * self.masked.size

    @property
    def saturates(self) -> bool:
        """A taxel is masked because it was saturated."""
        return self.masks and bool(self._bad[Kind.SATURATED].any())

    def update(
        self,
        values: Array,
        t_ns: int,
        known_free: bool | None,
        force_moving: bool | None,
        pressure: Array | None = None,
        shear: Array | None = None,
    ) -> None:
        """Update with an image; ignore it if a reading is not finite.

        Args:
            values: Normal readings after tare and scale, shape (taxels,); before the charge reconstruction, if any.
            t_ns: Time of the image.
            known_free: The force sensor measures no contact; None without a force sensor.
            force_moving: The normal force of the force sensor moves beyond its noise; None without a force sensor.
            pressure: Result of the charge reconstruction, shape (taxels,), NaN if not known; None if the readings are
                the pressure.
            shear: Shear of three-axis taxels after tare and scale, shape (taxels, 2); None where they measure none.
        """
        if not math.isfinite(float(values.dot(values)) + (0.0 if shear is None else float(np.vdot(shear, shear)))):
            return
        free, steady = known_free is True, force_moving is False
        ended = self._blocks.update(values, t_ns, free=free, steady=steady, pressure=pressure, shear=shear)
        if ended and self._blocks.count >= WINDOW and self._blocks.count % JUDGED_BLOCKS == 0:
            bad, good = self._faults.judge(self.masked)
            self._good = np.where(bad, 0, self._good + good)
            self._bad = (self._bad | bad) & (self._good < RECOVERY)
            self.masked = np.logical_or.reduce(self._bad, axis=0)
            self.masks = bool(self.masked.any())
            self.measured = ~self.masked if self.masks else None

    def report(self) -> dict[str, list[int]]:
        """Return what is masked: indices of taxels by kind, and of rows and columns that are lost entirely."""
        rows, cols = self._grid
        lost = self.masked.reshape(rows, cols)
        lost_rows: Mask = np.asarray(lost.all(axis=1) & (rows > 1))
        lost_cols: Mask = np.asarray(lost.all(axis=0) & (cols > 1))
        single = self.masked & ~np.logical_or(lost_rows[:, None], lost_cols).ravel()
        still = (self._bad[Kind.STILL] | self._bad[Kind.FROZEN]) & ~(self._bad[Kind.HOT] | self._bad[Kind.SATURATED])
        found = {
            "dead": single & still & ~self._faults.away,
            "stuck": single & still & self._faults.away,
            "hot": single & self._bad[Kind.HOT] & ~self._bad[Kind.SATURATED],
            "saturated": single & self._bad[Kind.SATURATED],
            "row": lost_rows,
            "column": lost_cols,
        }
        return {kind: np.flatnonzero(which).tolist() for kind, which in found.items()}

    def repair(self, pressure: Array) -> Array:
        """Replace each masked taxel by the median of its trusted neighbours.

        On simulated contacts with one masked taxel, the median error of the utilisation is 0.06 %, against 0.16 % with
        the mean and 0.6 % without the taxel. With a quarter of the pad masked it is 0.9 %, and below 8 % for 19 of 20
        contacts.

        Args:
            pressure: Pressure, shape (taxels,), or force of three-axis taxels, shape (taxels, 3).

        Returns:
            The same array if nothing is masked, else a new one; 0 for a masked taxel without a trusted neighbour.
        """
        if pressure.ndim == 2:
            return np.column_stack([self.repair(component) for component in pressure.T])
        gone = np.flatnonzero(self.masked)
        if gone.size == 0:
            return pressure
        around = self._around[gone]
        believed = (around >= 0) & ~self.masked[around]
        near = np.sort(np.where(believed, pressure[around], math.inf), axis=1)
        count = believed.sum(axis=1, keepdims=True)
        middles = np.take_along_axis(
            near, np.hstack((np.maximum(count - 1, 0) // 2, np.minimum(count // 2, 7))), axis=1
        )
        mended = pressure.copy()
        mended[gone] = np.where(count[:, 0] > 0, middles.mean(axis=1), 0.0)
        return mended
