"""How far the contact centroid of the force sensor moves at unchanged load, where the image shows the same shift.

The force sensor measures the centroid to micrometres, also where the edges of a contact lie between electrodes. What
else may move it is listed in `slipd.motion.image_agreement`, and needs the image to be told from a motion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.arrays import Array
from slipd.motion.image_agreement import ImageAgreement
from slipd.motion.image_blocks import Block
from slipd.motion.shift_path import PathNoise, ShiftPath
from slipd.signals.pad import PadGeometry

LEAST_TRAVEL_M = 1e-4
"""A smaller shift of the centroid is not compared with the image, m."""
ALONG = 0.5
"""Cosine of the largest angle between a shift and the tangential force: a turn beside it may bend its way so far."""
MOST_SHARE = 0.3
"""A longer shift, relative to the radius of gyration, may lift one edge off the pad if it is a tilt after all."""


class Travel(NamedTuple):
    """A shift of the contact that both sensors show.

    Attributes:
        shift_m: Along X and Y of the pad frame, shape (2,), m.
        surprise: −ln of the probability that noise of the force sensor takes the centroid as far along the load.
    """

    shift_m: Array
    surprise: float


NO_TRAVEL = Travel(np.zeros(2), 0.0)


class CentroidShift:
    """Compares the contact centroids of blocks of one contact.

    Args:
        geometry: Layout of the taxels.
    """

    def __init__(self, geometry: PadGeometry) -> None:
        self._agreement = ImageAgreement(geometry)
        self.reset()

    def reset(self) -> None:
        """Forget the noise of the centroid: the contact ended."""
        self._path_noise: PathNoise | None = None

    def begin(self, block: Block) -> ShiftPath:
        """Return an empty path of the centroid that begins with a block."""
        if self._path_noise is None:
            self._path_noise = PathNoise(np.append(block.centroid_std_m, 0.0))
        return ShiftPath(self._path_noise)

    def update(self, before: Block, after: Block, path: ShiftPath, variance: Array, radius_m: float) -> Travel | None:
        """Add a block to a path, and compare it with the block where that began.

        Args:
            before: The block where the path began.
            after: The later one, of the same load.
            path: Of `begin`.
            variance: Variance of the difference of their images, shape (n,); infinity outside of the contact.
            radius_m: Radius of gyration of the contact, m.

        Returns:
            None where the centroid is not measured.
        """
        shift = after.load[4:] - before.load[4:]
        fx, fy, _ = after.tangential
        load_n, length_m = math.hypot(fx, fy), math.hypot(*shift.tolist())
        if math.isnan(length_m):
            return None
        path.add(np.append(shift, 0.0))
        if not LEAST_TRAVEL_M < length_m < MOST_SHARE * radius_m or not load_n > 0.0:
            return NO_TRAVEL
        along = np.array((fx / load_n, fy / load_n, 0.0))
        along_m = float(along[:2] @ shift)
        if along_m <= ALONG * length_m or not self._agreement.shows(before.image, after.image, variance, shift):
            return NO_TRAVEL
        return Travel(shift, path.surprise(along, along_m))
