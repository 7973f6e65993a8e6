"""Images of a contact, averaged over short blocks in which the load rests, with their load and noise."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Mask

BLOCK_S = 0.05
"""Duration of a block, s: a contact that creeps with 3 mm/s moves 0.15 mm in it."""
SETTLED_S = 0.2
"""A contact that is younger still settles, and gives no blocks, s."""
SAME_SHARE, SAME_NORMAL_SHARE = 0.15, 0.02
"""Tangential forces are the same within this share of themselves, or this share of the normal force."""
RISE_SHARE = 0.03
"""The later one is no larger by more than this share: near its limit, a contact slips in part under a growing load."""
GRIP_SHARE = 0.07
"""Normal forces are the same within this share."""
SAME_CENTROID_M = 1e-3
"""The contact centroid is the same within this, m: a tilt moves it further before it opens a gap."""
NOISE_STDS = 4.0
"""All of them also within this many standard deviations of the noise."""
KEPT = 1.0 - 1.0 / 400
"""The noise of the taxels is averaged over 400 images."""
_LAST, _JUMPS, _TOTAL = range(3)  # newest image, averaged squares of the changes, sum of the images of the block


class LoadNoise(NamedTuple):
    """Standard deviations of a force sensor: of a force component, N, and of a torque component, N·m."""

    force_n: float
    torque_nm: float


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
            moved_m: How far the contact is known to have moved until then, and its centroid with it, shape (2,), m.
        """
        change = other.load - self.load
        change[4:] -= moved_m
        fx, fy = self.load.item(0), self.load.item(1)
        if fx * change.item(0) + fy * change.item(1) > self.rise_n * math.hypot(fx, fy):
            return False
        return not (np.abs(change) > other.tolerance).any()  # NaN, not measured, does not differ

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

    def __init__(self, geometry: PadGeometry, noise: LoadNoise) -> None:
        self._noise_n, self._noise_nm = NOISE_STDS * noise.force_n, NOISE_STDS * noise.torque_nm
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
        wrenches = np.array(self._wrenches)
        image = self._sums[_TOTAL] / len(wrenches)
        self._sums[_TOTAL] = 0.0
        self._begun_ns, self._wrenches = t_ns, []
        load = _load(wrenches.mean(axis=0))
        if t_ns - self._since_ns < SETTLED_S * 1e9 or not (load[2] > 0.0 and np.isfinite(image).all()):
            return None
        tolerance = self._tolerance(load)
        if not (np.ptp(wrenches[:, :3], axis=0) <= 2.0 * tolerance[:3]).all():
            return None
        count = len(wrenches)
        variance = self._sums[_JUMPS] / (2.0 * max(self._jump_count, 1.0) * count)
        rise_n = RISE_SHARE * math.hypot(load[0], load[1]) + self._noise_n / math.sqrt(count)
        return Block(t_ns, image, variance, load, tolerance, rise_n, wrenches, usable)

    def _tolerance(self, load: Array) -> Array:
        """Return how far another load may differ from this one and still be the same, shape (6,)."""
        fx, fy, normal, _, _, _ = load.tolist()
        tangential = max(SAME_SHARE * math.hypot(fx, fy), SAME_NORMAL_SHARE * normal)
        along, centroid = tangential + self._noise_n, SAME_CENTROID_M + self._noise_nm / normal
        spin = self._reach_m * tangential + self._noise_nm
        return np.array((along, along, GRIP_SHARE * normal + self._noise_n, spin, centroid, centroid))


@compiled
def _add_image(sums: Array, forces: Array) -> None:
    """Add an image to that of the block and to the noise, and keep it."""
    for k in range(len(forces)):
        jump = forces[k] - sums[_LAST, k]
        sums[_JUMPS, k] = sums[_JUMPS, k] * KEPT + jump * jump
        sums[_TOTAL, k] += forces[k]
        sums[_LAST, k] = forces[k]


def _load(wrench: Array) -> Array:
    """Return the load of a wrench, as in `Block`; its torque may be NaN."""
    fx, fy, fz, mx, my, mz = wrench.tolist()
    if fz == 0.0:
        return np.full(6, math.nan)
    cx, cy = -my / fz, mx / fz
    return np.array((fx, fy, -fz, mz - (cx * fy - cy * fx), cx, cy))
