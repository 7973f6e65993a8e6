"""Evidence "image_change" of a pad in front of a force sensor: the contact moves at unchanged load.

Images are averaged over short blocks. Each block is compared with the first of the same load. The motion is fitted
together with what load, tilt and growth do to an image (`slipd.motion.image_fit`). Where the force sensor measures the
contact centroid, only the turn of that fit counts: `CentroidShift` follows the shift.

The force sensor measures the centroid to micrometres, also where the edges of a contact lie between electrodes. What
else may move it is listed in `slipd.motion.image_fit`, and needs the image to be told from a motion. Under a load that
grows, and after one that was larger, a contact has moved by partial slip: the load rests from first to last.

The path of the motion is tested against a random walk, whose steps are as large as the path's own are irregular. White
noise strays less than that, and so does the noise of a drifting pad.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.motion.evidence import BLOCK_S, LEAST_READINGS, Evidence, f_surprise
from slipd.motion.image_blocks import SLIGHT_SHARE, Block, ImageBlocks
from slipd.motion.image_fit import MOST_TILT, MOTIONS, ImageComparison, ImageFit
from slipd.motion.shift_path import (
    AGAIN_M,
    ALONG,
    EACH_SURPRISE,
    KEPT_NS,
    LEAST_M,
    KnownMotion,
    Motion,
    PathNoise,
    ShiftPath,
)
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Mask

AGAIN_PITCHES = 0.5
"""Beyond this shift the change of an image is not linear any more, and a new reference is taken."""

_NOWHERE = np.zeros(MOTIONS)


class ImageShift:
    """Finds motion of the contact in the images of one pad of n taxels.

    False alarms: under noise alone, white or a random walk or between them, a surprise above s comes in less than
    exp(−s) of the looks, of which there are ``looks_per_hour``. The noise of the taxels must be independent.

    Args:
        geometry: Layout of the taxels.
        noise: Of the force sensor.
    """

    looks_per_hour = 3600.0 / BLOCK_S

    def __init__(self, geometry: PadGeometry, noise: WrenchUncertainty) -> None:
        self._blocks, self._images = ImageBlocks(geometry, noise), ImageComparison(geometry)
        self._centroids = CentroidShift(self._images, noise)
        self._far_m = AGAIN_PITCHES * geometry.pitch_m
        self._begin()

    def _begin(self) -> None:
        """Begin with the next image."""
        self._looked = False
        self._blocks.reset()
        self._centroids.reset()
        self._path: ShiftPath | None = None
        self._noise, self._motion = PathNoise(), KnownMotion()
        self._beyond_before = self._by_centroid = False

    def reset(self) -> None:
        """Forget everything: the contact ended, or the images did."""
        if self._looked:
            self._begin()

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
        self._looked = True
        block = self._blocks.update(t_ns, forces, wrench, usable)
        if block is None:
            return None
        by_centroid = None if math.isnan(block.load[4]) else self._centroids.update(block)
        by_image = self._compare(block)
        self._by_centroid = by_centroid is not None
        return by_centroid or by_image

    def _compare(self, block: Block) -> Evidence | None:
        """Compare a block with the first of its load."""
        path = None if self._motion.rests(block.t_ns) else self._path
        known_m = None if path is None else self._motion.shift_m(path)
        if (
            path is None
            or block.t_ns - path.reference.t_ns > KEPT_NS
            or not path.reference.same_load(block, _NOWHERE if known_m is None else known_m)
        ):
            self._path = ShiftPath(block, self._noise)
            return None
        fit = self._images.fit(path.reference, block)
        return None if fit is None else self._judge(fit, block, path)

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
                path, shift = ShiftPath(block, self._noise), _NOWHERE
                self._path = path
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
    if spin_nm * turn <= SLIGHT_SHARE * fit.radius_m * load_n * abs(turn):
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


GAP_NS = round(2.5e9 * BLOCK_S)
"""Blocks further apart have another load between them."""


class CentroidShift:
    """Follows the contact centroid over the blocks of one contact.

    False alarms: as those of `ImageShift`.

    Args:
        images: Comparison of the images of the pad.
        noise: Of the force sensor.

    Attributes:
        motion: What was found, as ``shift_m`` along the load, shape (1,). Once it is confirmed, only a further motion
            is evidence, until the contact has rested.
    """

    def __init__(self, images: ImageComparison, noise: WrenchUncertainty) -> None:
        self._images, self._torque_nm = images, noise.torque_std_nm
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
        if path is None or not lasts or not path.reference.same_load(block, _NOWHERE):
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
        if len(wrenches) < LEAST_READINGS:
            return np.full(2, self._torque_nm / (float(block.load[2]) * math.sqrt(len(wrenches))))
        centroids = wrenches[:, (4, 3)] / wrenches[:, 2:3]
        return np.asarray(centroids.std(axis=0) / math.sqrt(len(wrenches) - 1))
