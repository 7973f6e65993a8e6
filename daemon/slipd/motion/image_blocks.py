"""Images of a contact, averaged over short blocks in which the load rests, with their load and noise."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.fusion.contact_state import WrenchUncertainty
from slipd.fusion.level_hysteresis import CERTAIN_STDS
from slipd.motion.evidence import BLOCK_S, LASTS_NS, SAME_SHARE
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Mask

SLIGHT_SHARE = 0.03
"""Below this share, these count as none: tangential forces, of the normal force; spin torques, of the tangential force
times the radius; loads of taxels, of their mean, unless one beside them has more. A later tangential force is no larger
by more than this share: near its limit, a contact slips in part under a growing load."""
SAME_CENTROID_M = 1e-3
"""The contact centroid is the same within this, m: a tilt moves it further before it opens a gap."""
KEPT = 1.0 - 1.0 / 400
"""The noise of the taxels is averaged over 400 images."""
_LAST, _JUMPS, _TOTAL = range(3)  # newest image, averaged squares of the changes, sum of the images of the block


class Block(NamedTuple):
    """A block of images.

    Attributes:
        t_ns: When the last image was acquired, CLOCK_MONOTONIC.
        image: Mean normal force on each taxel, shape (n,).
        variance: Its variance by noise that changes from image to image, shape (n,).
        load: Fx, Fy, normal force, N; spin torque, N·m; contact centroid X, Y, m; NaN where not measured. Shape (6,).
        tolerance: How far loads may differ and still be the same, shape (6,).
        rise_n: How much larger the tangential force of a later block may be, N.
        wrenches: Wrench of each image, shape (k, 6), N and N·m.
        usable: Taxels that measure by themselves, shape (n,); None: all.
    """

    t_ns: int
    image: Array
    variance: Array
    load: Array
    tolerance: Array
    rise_n: float
    wrenches: Array
    usable: Mask | None = None

    def same_load(self, other: Block, moved_m: Array) -> bool:
        """Return whether another block has the same load.

        Args:
            other: The later block.
            moved_m: How far the contact is known to have moved along X and Y until then, and its centroid with it, m.
        """
        return is_same_load(self.load, other.load, moved_m, other.tolerance, self.rise_n)

    @property
    def tangential(self) -> tuple[float, float, float]:
        """Tangential force, N, and spin torque, N·m, 0 where it is not measured."""
        fx, fy, _, spin, _, _ = self.load.tolist()
        return fx, fy, 0.0 if math.isnan(spin) else spin


class ImageBlocks:
    """Averages the images of one contact on a pad of n taxels.

    Args:
        geometry: Layout of the taxels.
        noise: Of the force sensor.
    """

    def __init__(self, geometry: PadGeometry, noise: WrenchUncertainty) -> None:
        self._noise_n, self._noise_nm = CERTAIN_STDS * noise.force_std_n, CERTAIN_STDS * noise.torque_std_nm
        self._reach_m = 0.25 * math.hypot(geometry.rows, geometry.cols) * geometry.pitch_m
        self._sums = np.zeros((3, geometry.taxels))
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended, or the images did."""
        self._since_ns: int | None = None
        self._begun_ns, self._jump_count = 0, 0.0
        self._wrenches: list[tuple[float, ...]] = []

    def update(self, t_ns: int, forces: Array, wrench: tuple[float, ...], usable: Mask | None = None) -> Block | None:
        """Add an image, see `slipd.motion.image_shift.ImageShift.update`; return the block that it completes.

        There is none where the load changed in it, or something is not known.
        """
        if self._since_ns is None:
            self._since_ns = self._begun_ns = t_ns
            self._sums[:] = 0.0
            self._sums[_LAST] = forces
        else:
            self._jump_count = self._jump_count * KEPT + 1.0
        _add_image(self._sums, forces)
        self._wrenches.append(wrench)
        if t_ns - self._begun_ns < BLOCK_S * 1e9:
            return None
        settled = t_ns - self._since_ns >= LASTS_NS
        wrenches, self._wrenches, self._begun_ns = np.array(self._wrenches), [], t_ns
        image, variance, load = np.empty_like(forces), np.empty_like(forces), np.empty(6)
        spread, spread_normal = _end_block(self._sums, wrenches, max(self._jump_count, 1.0), image, variance, load)
        if not settled or math.isnan(spread):
            return None
        fx, fy, normal = load[:3].tolist()
        load_n = math.hypot(fx, fy)
        tangential, squeeze = max(SAME_SHARE * load_n, SLIGHT_SHARE * normal), SAME_SHARE * normal + self._noise_n
        along, centroid = tangential + self._noise_n, SAME_CENTROID_M + self._noise_nm / normal
        if spread > 2.0 * along or spread_normal > 2.0 * squeeze:
            return None
        spin = self._reach_m * tangential + self._noise_nm
        tolerance = np.array((along, along, squeeze, spin, centroid, centroid))
        rise_n = SLIGHT_SHARE * load_n + self._noise_n / math.sqrt(len(wrenches))
        return Block(t_ns, image, variance, load, tolerance, rise_n, wrenches, usable)


@compiled
def _add_image(sums: Array, forces: Array) -> None:
    """Add an image to that of the block and to the noise, and keep it."""
    for k in range(len(forces)):
        jump = forces[k] - sums[_LAST, k]
        sums[_JUMPS, k] = sums[_JUMPS, k] * KEPT + jump * jump
        sums[_TOTAL, k] += forces[k]
        sums[_LAST, k] = forces[k]


@compiled
def _end_block(
    sums: Array, wrenches: Array, jump_count: float, image: Array, variance: Array, load: Array
) -> tuple[float, float]:
    """Fill in what was averaged over a block, and begin the next one.

    Args:
        sums: Of the images; that of the block is cleared.
        wrenches: Wrench of each image, shape (k, 6); its torque may be NaN.
        jump_count: Number of the averaged squares in ``sums``.
        image: Filled as ``image`` of `Block`.
        variance: Likewise.
        load: Likewise.

    Returns:
        Range of the tangential force in the block, along X or Y, and that of the normal force; NaN: the force or the
        image is not known, or nothing presses.
    """
    count, mean, spread = len(wrenches), np.zeros(6), np.zeros(6)
    for i in range(6):
        lowest = highest = wrenches[0, i]
        for k in range(count):
            mean[i] += wrenches[k, i]
            lowest, highest = min(lowest, wrenches[k, i]), max(highest, wrenches[k, i])
        mean[i] /= count
        spread[i] = highest - lowest
    fx, fy, fz = mean[0], mean[1], mean[2]
    known = math.isfinite(fx) and math.isfinite(fy) and fz < 0.0
    for i in range(len(image)):
        image[i], variance[i] = sums[_TOTAL, i] / count, sums[_JUMPS, i] / (2.0 * jump_count * count)
        sums[_TOTAL, i] = 0.0
        known = known and math.isfinite(image[i])
    cx, cy = -mean[4] / fz, mean[3] / fz
    load[0], load[1], load[2], load[3], load[4], load[5] = fx, fy, -fz, mean[5] - (cx * fy - cy * fx), cx, cy
    return (max(spread[0], spread[1]), spread[2]) if known else (math.nan, math.nan)


@compiled
def is_same_load(load: Array, later: Array, moved_m: Array, tolerance: Array, rise_n: float) -> bool:
    """Return whether a later load is the same, see `Block.same_load`; what is NaN, not measured, does not differ."""
    along = 0.0
    for i in range(6):
        change = later[i] - load[i]
        if i < 2:
            along += load[i] * change
        if i >= 4:
            change -= moved_m[i - 4]
        if abs(change) > tolerance[i]:
            return False
    return not along > rise_n * math.hypot(load[0], load[1])
