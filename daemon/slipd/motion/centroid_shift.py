"""Evidence "image_change" by the contact centroid: it moves along the load, and the image shows a shift.

The force sensor measures the centroid to micrometres, also where the edges of a contact lie between electrodes. What
else may move it is listed in `slipd.motion.image_fit`, and needs the image to be told from a motion. Under a load that
grows, and after one that was larger, a contact has moved by partial slip: the load rests from first to last.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.motion.evidence import Evidence
from slipd.motion.image_blocks import BLOCK_S, Block, LoadNoise
from slipd.motion.image_fit import ImageComparison
from slipd.motion.shift_path import (
    AGAIN_M,
    ALONG,
    EACH_SURPRISE,
    KEPT_NS,
    LEAST_M,
    NOWHERE,
    KnownMotion,
    Motion,
    PathNoise,
    ShiftPath,
)
from slipd.types.arrays import Array

GAP_NS = round(2.5e9 * BLOCK_S)
"""Blocks further apart have another load between them."""
LEAST_SCATTER = 4
"""From as many images on, their scatter shows the noise of the contact centroid."""


class CentroidShift:
    """Follows the contact centroid over the blocks of one contact.

    False alarms: as those of `slipd.motion.image_shift.ImageShift`.

    Args:
        images: Comparison of the images of the pad.
        noise: Of the force sensor.

    Attributes:
        motion: What was found, as ``shift_m`` along the load, shape (1,). Once it is confirmed, only a further motion
            is evidence, until the contact has rested.
    """

    def __init__(self, images: ImageComparison, noise: LoadNoise) -> None:
        self._images, self._torque_nm = images, noise.torque_nm
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended, or the images did."""
        self._noise: PathNoise | None = None
        self._path: ShiftPath | None = None
        self._last_ns, self._beyond_before = 0, False
        self.motion = KnownMotion()

    def update(self, block: Block) -> Evidence | None:
        """Update with a block whose centroid is measured; return evidence where the contact moves."""
        if self.motion.rests(block.t_ns):
            self._path = None
        path, rested = self._path, block.t_ns - self._last_ns <= GAP_NS
        self._last_ns = block.t_ns
        lasts = path is not None and rested and block.t_ns - path.reference.t_ns <= KEPT_NS
        if path is None or not lasts or not path.reference.same_load(block, NOWHERE):
            self._begin(block)
            return None
        fx, fy, _, _, cx_m, cy_m = block.load.tolist()
        x_m, y_m = cx_m - path.reference.load.item(4), cy_m - path.reference.load.item(5)
        shift_m, load_n = np.array((x_m, y_m, 0.0)), max(math.hypot(fx, fy), 1e-300)
        path.add(shift_m)
        along_m, length_m = (fx * x_m + fy * y_m) / load_n, math.hypot(x_m, y_m)
        known, known_m = self.motion.known, self.motion.shift_m(path)
        least_m = LEAST_M if known is None else AGAIN_M + (0.0 if known_m is None else known_m.item())
        beyond = along_m > max(least_m, ALONG * length_m)
        lasts, self._beyond_before = beyond and (self._beyond_before or known is not None), beyond
        goes_on = known is not None and length_m < LEAST_M  # the path is too short for the image to show
        if not lasts or not (goes_on or self._images.shows_shift(path.reference, block, shift_m)):
            return None
        surprise = path.surprise(np.array((fx / load_n, fy / load_n, 0.0)), along_m)
        surprise = surprise if known is None else max(surprise, known.surprise)
        if surprise < EACH_SURPRISE:
            return None
        self.motion.found = Motion(block.t_ns, np.array((along_m,)), surprise, path)
        return Evidence("image_change", block.t_ns, surprise)

    def _begin(self, block: Block) -> None:
        """Begin a path at a block."""
        if self._noise is None:
            self._noise = PathNoise(np.append(self._centroid_std_m(block), 0.0))
        self._path, self._beyond_before = ShiftPath(block, self._noise), False

    def _centroid_std_m(self, block: Block) -> Array:
        """Return the noise of the mean centroid of a block, shape (2,): by its scatter, or as stated by few images."""
        wrenches = block.wrenches
        if len(wrenches) < LEAST_SCATTER:
            return np.full(2, self._torque_nm / (float(block.load[2]) * math.sqrt(len(wrenches))))
        centroids = wrenches[:, (4, 3)] / wrenches[:, 2:3]
        return np.asarray(centroids.std(axis=0) / math.sqrt(len(wrenches) - 1))
