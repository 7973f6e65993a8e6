"""Evidence "image_change" of a pad in front of a force sensor: the contact moves at unchanged load.

Images are averaged over short blocks. Each block is compared with an earlier one of the same load, which is kept for
some seconds: a shaken object comes back to a load, and a soft pad then to its place. The motion is fitted together with
what load, tilt and growth do to an image (`slipd.motion.image_fit`). Where the force sensor measures the contact
centroid, only the turn of that fit counts: `slipd.motion.centroid_shift` follows the shift.

The path of the motion is tested against a random walk, whose steps are as large as the path's own are irregular. White
noise strays less than that, and so does the noise of a drifting pad.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.motion.centroid_shift import CentroidShift
from slipd.motion.evidence import Evidence, f_surprise
from slipd.motion.image_blocks import BLOCK_S, Block, ImageBlocks, LoadNoise
from slipd.motion.image_fit import MOTIONS, ImageComparison, ImageFit
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
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Mask

REFERENCES = 8
"""Loads whose images are kept."""
AGAIN_PITCHES = 0.5
"""Beyond this shift the change of an image is not linear any more, and a new reference is taken."""
MOST_TILT = 0.3
"""A stronger tilt, relative at the radius of gyration, may lift one edge off the pad, which looks like a motion."""
SPIN_SHARE = 0.05
"""A spin torque below this share of the tangential force times the radius of gyration turns nothing."""


class ImageShift:
    """Finds motion of the contact in the images of one pad of n taxels.

    False alarms: under noise alone, white or a random walk or between them, a surprise above s comes in less than
    exp(−s) of the looks, of which there are ``looks_per_hour``. The noise of the taxels must be independent.

    Args:
        geometry: Layout of the taxels.
        noise: Of the force sensor.
    """

    looks_per_hour = 3600.0 / BLOCK_S

    def __init__(self, geometry: PadGeometry, noise: LoadNoise) -> None:
        self._blocks, self._images = ImageBlocks(geometry, noise), ImageComparison(geometry)
        self._centroids = CentroidShift(self._images, noise)
        self._far_m = AGAIN_PITCHES * geometry.pitch_m
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended, or the images did."""
        self._blocks.reset()
        self._centroids.reset()
        self._paths: list[ShiftPath] = []
        self._noise, self._motion = PathNoise(), KnownMotion()
        self._beyond_before = self._by_centroid = False

    def confirm(self) -> int:
        """Take the newest evidence as true; return until when, CLOCK_MONOTONIC in ns, the contact counts as moving.

        From then on only a further motion is evidence, until the contact has rested.

        Raises:
            ValueError: There was no evidence yet.
        """
        return (self._centroids.motion if self._by_centroid else self._motion).confirm()

    def update(
        self, t_ns: int, forces: Array, wrench: tuple[float, ...], usable: Mask | None = None
    ) -> Evidence | None:
        """Update with an image of a contact; return evidence where the contact moves.

        Args:
            t_ns: When the image was acquired, CLOCK_MONOTONIC.
            forces: Normal force on each taxel without a threshold, shape (n,), any unit.
            wrench: Force on the finger, N, and torque about the pad's origin, N·m, since the image before: six numbers.
            usable: Taxels that measure by themselves, shape (n,); None: all.
        """
        block = self._blocks.update(t_ns, forces, wrench, usable)
        if block is None:
            return None
        by_centroid = None if math.isnan(block.load[4]) else self._centroids.update(block)
        by_image = self._compare(block)
        self._by_centroid = by_centroid is not None
        return by_centroid or by_image

    def _compare(self, block: Block) -> Evidence | None:
        """Compare a block with the oldest reference of its load."""
        oldest_ns = block.t_ns - KEPT_NS
        if self._motion.rests(block.t_ns):
            self._paths = []
        self._paths = [path for path in self._paths if path.reference.t_ns >= oldest_ns]
        for path in self._paths:
            known_m = self._motion.shift_m(path)
            if path.reference.same_load(block, NOWHERE if known_m is None else known_m):
                fit = self._images.fit(path.reference, block)
                return None if fit is None else self._judge(fit, block, path)
        self._paths = [*self._paths[1 - REFERENCES :], ShiftPath(block, self._noise)]
        return None

    def _judge(self, fit: ImageFit, block: Block, path: ShiftPath) -> Evidence | None:
        """Return evidence where the path is one of motion along the load, or goes on with one that is known."""
        path.add(fit.shift_m)
        by_turn, known = not math.isnan(block.load[4]), self._motion.known
        most = fit.shift_m[2:] if by_turn else fit.shift_m
        if known is None and not float(most @ most) > LEAST_M**2:
            self._beyond_before = False
            return None
        shift = _slide(fit, self._images.growth_m(fit, path.reference, block), *block.tangential)
        if by_turn:
            shift[:2] = 0.0
        squares = float(shift @ shift)
        pattern = _pattern_surprise(fit, shift)
        if known is not None:
            known_m = self._motion.shift_m(path)
            further = shift if known_m is None else shift - known_m
            goes_on = float(further @ further) > AGAIN_M**2 and float(further @ shift) > 0.0
            if not goes_on or pattern < EACH_SURPRISE:
                return None
            if squares >= self._far_m**2:
                path, shift = ShiftPath(block, self._noise), NOWHERE
                self._paths = [path]
            return self._find(Motion(block.t_ns, shift, known.surprise, path))
        beyond = squares > LEAST_M**2 and fit.tilt < MOST_TILT
        lasts, self._beyond_before = beyond and self._beyond_before, beyond
        if not lasts:
            return None
        along = _direction(fit, *block.tangential, by_turn=by_turn)
        by_path = path.surprise(along, float(along @ shift))
        if min(pattern, by_path) < EACH_SURPRISE:
            return None
        return self._find(Motion(block.t_ns, shift, max(pattern, by_path) - math.log(2.0), path))

    def _find(self, motion: Motion) -> Evidence:
        self._motion.found = motion
        return Evidence("image_change", motion.t_ns, motion.surprise)


def _slide(fit: ImageFit, growth_m: tuple[float, float], fx_n: float, fy_n: float, spin_nm: float) -> Array:
    """Return the part of a fitted motion that growth does not explain and friction allows, as `ImageFit.shift_m`.

    What slides moves along its load: friction takes power from the shift and from the turn. Growth and the opening of
    a gap may move one edge alone, which looks like growth and shift in equal parts.
    """
    shift_x, shift_y, turn = fit.shift_m.tolist()
    shift_x, shift_y = (
        math.copysign(max(abs(shift) - growth, 0.0), shift)
        for shift, growth in zip((shift_x, shift_y), growth_m, strict=True)
    )
    load_n = math.hypot(fx_n, fy_n)
    if fx_n * shift_x + fy_n * shift_y <= ALONG * load_n * math.hypot(shift_x, shift_y):
        shift_x = shift_y = 0.0
    if spin_nm * turn <= SPIN_SHARE * fit.radius_m * load_n * abs(turn):
        turn = 0.0
    return np.array((shift_x, shift_y, turn))


def _direction(fit: ImageFit, fx_n: float, fy_n: float, spin_nm: float, *, by_turn: bool) -> Array:
    """Return the direction in which a load moves the contact, as `ImageFit.shift_m`, of length 1; the load is not 0.

    Where only turns count it is that of the turn.
    """
    load = np.array((0.0, 0.0, spin_nm) if by_turn else (fx_n, fy_n, spin_nm / fit.radius_m))
    direction: Array = load / math.sqrt(float(load @ load))
    return direction


def _pattern_surprise(fit: ImageFit, shift_m: Array) -> float:
    """Return −ln of the probability that taxels change like a motion by chance, by what the fit leaves over."""
    squares = min(float(fit.shift_m @ fit.precision @ fit.shift_m), float(shift_m @ fit.precision @ shift_m))
    return f_surprise(squares / MOTIONS / max(fit.scale, 1.0), MOTIONS, fit.freedom)
