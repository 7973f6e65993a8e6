"""Motion of the contact centroid of the force sensor at unchanged load, where the image shows the same shift.

The force sensor measures the centroid to micrometres, also where the edges of a contact lie between electrodes. What
else may move it is listed in `slipd.motion.image_agreement`, and needs the image to be told from a motion. Under a load
that grows, and after one that was larger, a contact has moved by partial slip: the load rests from first to last.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slipd.motion.evidence import Evidence
from slipd.motion.image_agreement import ImageAgreement
from slipd.motion.image_blocks import BLOCK_S, Block, LoadNoise
from slipd.motion.shift_path import PathNoise, ShiftPath
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

KEPT_NS = 10_000_000_000
"""A path begins anew after this time: charge and rubber creep for longer."""
GAP_NS = round(2.5e9 * BLOCK_S)
"""Blocks further apart have another load between them."""
LEAST_M = 2e-4
"""A smaller motion may be that of a pad that gives way, m."""
AGAIN_M = 1e-4
"""A contact that is known to move is reported again after a further motion by this much, m."""
ALONG = 0.5
"""Cosine of the largest angle between a shift and the tangential force: a turn beside it may bend its way so far."""
LEAST_SCATTER = 4
"""From as many images on, their scatter shows the noise of the contact centroid."""
EACH_SURPRISE = 3.0
"""The path must look like a motion by this much."""
FIRST_NS, SHORTEST_NS, LONGEST_NS = 200_000_000, 300_000_000, 800_000_000
"""It counts as moving for twice the time that this took, at least and at most for so long; then it rests."""

_HERE = np.zeros(2)


def moving_until(found_ns: int, before_ns: int | None) -> int:
    """Return until when a contact counts as moving, CLOCK_MONOTONIC in ns.

    Args:
        found_ns: When it was found to move.
        before_ns: When it was found so before; None: it was at rest.
    """
    taken_ns = FIRST_NS if before_ns is None else found_ns - before_ns
    return found_ns + min(max(2 * taken_ns, SHORTEST_NS), LONGEST_NS)


class CentroidShift:
    """Follows the contact centroid over the blocks of one contact.

    False alarms: as those of `slipd.motion.image_shift.ImageShift`.

    Args:
        geometry: Layout of the taxels.
        noise: Of the force sensor.
    """

    def __init__(self, geometry: PadGeometry, noise: LoadNoise) -> None:
        self._agreement, self._torque_nm = ImageAgreement(geometry), noise.torque_nm
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended, or the images did."""
        self._noise: PathNoise | None = None
        self._begun: _Begun | None = None
        self._last_ns, self._told_m, self._beyond_before = 0, 0.0, False
        self._newest: _Found | None = None
        self._known: _Found | None = None

    def confirm(self) -> int:
        """Take the newest evidence as true; return until when the contact counts as moving.

        From then on only a further motion is evidence, until the contact has rested.

        Raises:
            ValueError: There was no evidence yet.
        """
        found, known = self._newest, self._known
        if found is None:
            raise ValueError("evidence must come before it is confirmed")
        self._known, self._told_m = found, found.along_m
        return moving_until(found.t_ns, None if known is None else known.t_ns)

    def update(self, block: Block, variance: Callable[[Block, Block], Array]) -> Evidence | None:
        """Update with a block whose centroid is measured; return evidence where the contact moves.

        Args:
            block: The newest block.
            variance: Returns the variance of the difference of the images of two blocks, infinity outside of the
                contact, shape (n,).
        """
        if self._known is not None and block.t_ns - self._known.t_ns > LONGEST_NS:
            self._known = self._begun = None
        begun, rested = self._begun, block.t_ns - self._last_ns <= GAP_NS
        self._last_ns = block.t_ns
        if begun is None or not rested or not begun.lasts(block):
            self._begin(block)
            return None
        shift = block.load[4:] - begun.block.load[4:]
        begun.path.add(np.append(shift, 0.0))
        direction = block.load[:2] / max(math.hypot(*block.load[:2].tolist()), 1e-300)
        along_m, length_m = float(direction @ shift), math.hypot(*shift.tolist())
        least_m = LEAST_M if self._known is None else self._told_m + AGAIN_M
        beyond = along_m > max(least_m, ALONG * length_m)
        lasts, self._beyond_before = beyond and (self._beyond_before or self._known is not None), beyond
        goes_on = self._known is not None and length_m < LEAST_M  # too little for the image since the path began anew
        if not lasts or not (goes_on or self._shows(begun.block, block, variance, shift)):
            return None
        surprise = begun.path.surprise(np.append(direction, 0.0), along_m)
        if self._known is not None:
            surprise = max(surprise, self._known.surprise)
        if surprise < EACH_SURPRISE:
            return None
        self._newest = _Found(block.t_ns, along_m, surprise)
        return Evidence("image_change", block.t_ns, surprise)

    def _begin(self, block: Block) -> None:
        if self._noise is None:
            self._noise = PathNoise(np.append(self._centroid_std_m(block), 0.0))
        self._begun, self._told_m, self._beyond_before = _Begun(block, ShiftPath(self._noise)), 0.0, False

    def _shows(self, begun: Block, block: Block, variance: Callable[[Block, Block], Array], shift_m: Array) -> bool:
        return self._agreement.shows(begun.image, block.image, variance(begun, block), shift_m)

    def _centroid_std_m(self, block: Block) -> Array:
        """Return the noise of the mean centroid of a block, shape (2,): by its scatter, or as stated by few images."""
        wrenches = block.wrenches
        if len(wrenches) < LEAST_SCATTER:
            return np.full(2, self._torque_nm / (float(block.load[2]) * math.sqrt(len(wrenches))))
        centroids = wrenches[:, (4, 3)] / wrenches[:, 2:3]
        return np.asarray(centroids.std(axis=0) / math.sqrt(len(wrenches) - 1))


class _Begun(NamedTuple):
    """A path, and the block where it began."""

    block: Block
    path: ShiftPath

    def lasts(self, block: Block) -> bool:
        """Return whether a block belongs to the path."""
        return block.t_ns - self.block.t_ns <= KEPT_NS and self.block.same_load(block, _HERE)


class _Found(NamedTuple):
    """A motion when it was found: by ``along_m`` along the load since the path began."""

    t_ns: int
    along_m: float
    surprise: float
