"""Evidence "image_change" of a pad that measures normal force: the contact moves in the image at unchanged load.

Images are averaged over short blocks. Each block is compared with an earlier one of the same load, which is kept for
some seconds: a shaken object comes back to a load, and a soft pad then to its place. The motion is fitted together with
what load, tilt and growth do to an image (`slipd.motion.image_fit`). Where the force sensor measures the contact
centroid, only the turn of that fit counts: `slipd.motion.centroid_shift` follows the shift.

The path of the motion is tested against a random walk, whose steps are as large as the path's own are irregular. White
noise strays less than that, and so does the noise of a drifting pad.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipd.motion.centroid_shift import (
    AGAIN_M,
    ALONG,
    EACH_SURPRISE,
    KEPT_NS,
    LEAST_M,
    LONGEST_NS,
    CentroidShift,
    moving_until,
)
from slipd.motion.evidence import Evidence
from slipd.motion.image_blocks import Block, ImageBlocks, LoadNoise
from slipd.motion.image_fit import MOTIONS, ImageFit, ImageFitter
from slipd.motion.shift_path import PathNoise, ShiftPath
from slipd.motion.surprises import f_surprise
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

Flags = NDArray[np.bool_]

REFERENCES = 8
"""Loads whose images are kept."""
AGAIN_PITCHES = 0.5
"""Beyond this shift the change of an image is not linear any more, and a new reference is taken."""
MOST_TILT = 0.3
"""A stronger tilt, relative at the radius of gyration, may lift one edge off the pad, which looks like a motion."""
SPIN_SHARE = 0.05
"""A spin torque below this share of the tangential force times the radius of gyration turns nothing."""
OPENS = 0.25
"""A gap may open where the pressure falls across the contact by this share of its mean on either side."""
MODEL_SHARE = 0.005
"""What a taxel reads may differ from the model by this share of its load."""
ACTIVE_SHARE = 0.05
"""A taxel belongs to the contact, with those beside it, above this share of the mean of the loaded taxels."""


class ImageShift:
    """Finds motion of the contact in the images of one pad of n taxels.

    False alarms: under noise alone, white or a random walk or between them, a surprise above s comes in less than
    exp(−s) of the looks, of which there are ``looks_per_hour``. The noise of the taxels must be independent.

    Args:
        geometry: Layout of the taxels.
        noise: Of the force sensor.
    """

    def __init__(self, geometry: PadGeometry, noise: LoadNoise) -> None:
        self._fitter, self._centroids = ImageFitter(geometry), CentroidShift(geometry, noise)
        self._x, self._y = geometry.positions()
        self._blocks = ImageBlocks(geometry, noise)
        self._grid, self._pitch_m = (geometry.rows, geometry.cols), geometry.pitch_m
        self._references: list[_Reference] = []
        self.reset()

    @property
    def looks_per_hour(self) -> float:
        """Most blocks that are compared in an hour."""
        return self._blocks.most_per_hour

    def reset(self) -> None:
        """Forget everything: the contact ended, or the images did."""
        self._blocks.reset()
        self._centroids.reset()
        self._references.clear()
        self._noise = PathNoise()
        self._beyond_before = False
        self._newest: _Motion | None = None
        self._known: _Motion | None = None
        self._by_centroid = False

    def confirm(self) -> int:
        """Take the newest evidence as true; return until when, CLOCK_MONOTONIC in ns, the contact counts as moving.

        From then on only a further motion is evidence, until the contact has rested.

        Raises:
            ValueError: There was no evidence yet.
        """
        if self._by_centroid:
            return self._centroids.confirm()
        found, known = self._newest, self._known
        if found is None:
            raise ValueError("evidence must come before it is confirmed")
        self._known = found
        return moving_until(found.t_ns, None if known is None else known.t_ns)

    def update(
        self, t_ns: int, forces: Array, wrench: tuple[float, ...], usable: Flags | None = None
    ) -> Evidence | None:
        """Update with an image of a contact; return evidence where the contact moves.

        Args:
            t_ns: When the image was acquired, CLOCK_MONOTONIC.
            forces: Normal force on each taxel without a threshold, shape (n,), any unit.
            wrench: Force on the finger, N, and torque about the pad's origin, N·m, since the image before: six numbers.
            usable: Taxels that measure by themselves, shape (n,); None: all.
        """
        block = self._blocks.update(t_ns, forces, wrench)
        if block is None:
            return None
        evidence: Evidence | None = None
        if not math.isnan(block.load[4]):
            evidence = self._centroids.update(block, lambda before, after: self._variance(before, after, usable))
        by_image = self._compare(block, usable)
        self._by_centroid = evidence is not None
        return by_image if evidence is None else evidence

    def _compare(self, block: Block, usable: Flags | None) -> Evidence | None:
        """Compare a block with the oldest reference of its load."""
        oldest_ns, known = block.t_ns - KEPT_NS, self._known
        if known is not None and block.t_ns - known.t_ns > LONGEST_NS:
            self._known, self._references = None, []
        self._references = [kept for kept in self._references if kept.block.t_ns >= oldest_ns]
        reference = next((kept for kept in self._references if kept.block.same_load(block, self._moved(kept))), None)
        if reference is None:
            self._references = [*self._references[1 - REFERENCES :], _Reference(block, ShiftPath(self._noise))]
            return None
        fit = self._fitter.fit(reference.block.image, block.image, self._variance(reference.block, block, usable))
        return None if fit is None else self._judge(fit, block, reference)

    def _moved(self, reference: _Reference) -> Array:
        """Return how far the contact is known to have moved since a reference, shape (2,), m."""
        known = self._known
        return known.shift_m[:2] if known is not None and known.reference is reference else np.zeros(2)

    def _variance(self, before: Block, after: Block, usable: Flags | None) -> Array:
        """Return the variance of the difference of two blocks by noise and errors of the model; infinity outside."""
        mean = 0.5 * (before.image + after.image)
        most = float(mean.max())
        on = mean > ACTIVE_SHARE * mean[mean > 0.1 * most].mean() if most > 0.0 else np.zeros(mean.shape, np.bool_)
        near = _grown(on.reshape(self._grid)).ravel()
        if not near.any():
            return np.full(mean.shape, math.inf)
        noise = np.maximum(after.variance, after.variance[near].mean())
        variance: Array = 2.0 * noise + (MODEL_SHARE * mean) ** 2 + (1e-6 * most) ** 2
        variance[~near if usable is None else ~(near & usable)] = math.inf
        return variance

    def _judge(self, fit: ImageFit, block: Block, reference: _Reference) -> Evidence | None:
        """Return evidence where the path is one of motion along the load."""
        reference.path.add(fit.shift_m)
        shift = _slide(fit, self._growth(fit, block, reference.block), *block.tangential)
        if not math.isnan(block.load[4]):
            shift[:2] = 0.0
        if self._known is not None:
            return self._follow(self._known, fit, shift, block, reference)
        beyond = float(shift @ shift) > LEAST_M**2 and fit.tilt < MOST_TILT
        lasts, self._beyond_before = beyond and self._beyond_before, beyond
        if not lasts:
            return None
        along = _direction(fit, *block.tangential, turns=not math.isnan(block.load[4]))
        pattern, path = _pattern_surprise(fit, shift), reference.path.surprise(along, float(along @ shift))
        if min(pattern, path) < EACH_SURPRISE:
            return None
        return self._find(_Motion(block.t_ns, shift, max(pattern, path) - math.log(2.0), reference))

    def _growth(self, fit: ImageFit, block: Block, before: Block) -> tuple[float, float]:
        """Return how far growth, or a gap that opens or closes, may have moved one edge along X and Y, m.

        No contact grows faster with its normal force than that of a sphere (Hertz: with the cube root). A gap opens
        only where an edge is hardly pressed.
        """
        share = abs(block.load[2] - before.load[2]) / (3.0 * block.load[2])
        most = [share * fit.radius_m] * 2
        for image in (before.image, block.image):
            on = image > ACTIVE_SHARE * float(image.max())
            loads = image[on]
            for axis, at in enumerate((self._x[on], self._y[on])):
                away = at - at.mean()
                squares = float(away @ away)
                fall = abs(float(away @ loads)) * math.sqrt(3.0 / (squares * len(at))) if squares > 0.0 else 0.0
                if fall > OPENS * float(loads.mean()):
                    most[axis] = math.inf
        return min(fit.growth_m[0], most[0]), min(fit.growth_m[1], most[1])

    def _follow(
        self, known: _Motion, fit: ImageFit, shift: Array, block: Block, reference: _Reference
    ) -> Evidence | None:
        """Return evidence as strong as that of a known motion where it goes on."""
        before = known.shift_m if known.reference is reference else np.zeros(MOTIONS)
        further = shift - before
        goes_on = float(further @ further) > AGAIN_M**2 and float(further @ shift) > 0.0
        if not goes_on or _pattern_surprise(fit, shift) < EACH_SURPRISE:
            return None
        if float(shift @ shift) < (AGAIN_PITCHES * self._pitch_m) ** 2:
            return self._find(_Motion(block.t_ns, shift, known.surprise, reference))
        begun = _Reference(block, ShiftPath(self._noise))
        self._references = [begun]
        return self._find(_Motion(block.t_ns, np.zeros(MOTIONS), known.surprise, begun))

    def _find(self, motion: _Motion) -> Evidence:
        self._newest = motion
        return Evidence("image_change", motion.t_ns, motion.surprise)


class _Motion(NamedTuple):
    """A motion when it was found: the contact had moved by ``shift_m`` from a reference."""

    t_ns: int
    shift_m: Array
    surprise: float
    reference: _Reference


class _Reference(NamedTuple):
    """A block, and the path of the contact since then."""

    block: Block
    path: ShiftPath


def _slide(fit: ImageFit, growth_m: tuple[float, float], fx_n: float, fy_n: float, spin_nm: float) -> Array:
    """Return the part of a fitted motion that growth does not explain and friction allows, as `ImageFit.shift_m`.

    What slides moves along its load: friction takes power from the shift and from the turn. Growth and the opening of
    a gap may move one edge alone, which looks like growth and shift in equal parts.
    """
    shift_x, shift_y, turn = fit.shift_m.tolist()
    shift_x, shift_y = _shrunk(shift_x, growth_m[0]), _shrunk(shift_y, growth_m[1])
    load_n = math.hypot(fx_n, fy_n)
    if fx_n * shift_x + fy_n * shift_y <= ALONG * load_n * math.hypot(shift_x, shift_y):
        shift_x = shift_y = 0.0
    if spin_nm * turn <= SPIN_SHARE * fit.radius_m * load_n * abs(turn):
        turn = 0.0
    return np.array((shift_x, shift_y, turn))


def _shrunk(value: float, by: float) -> float:
    """Return a value nearer to zero by ``by``, at most zero."""
    return math.copysign(max(abs(value) - by, 0.0), value)


def _grown(on: Flags) -> Flags:
    """Return a mask with the four neighbours of its taxels."""
    grown = on.copy()
    grown[1:] |= on[:-1]
    grown[:-1] |= on[1:]
    grown[:, 1:] |= on[:, :-1]
    grown[:, :-1] |= on[:, 1:]
    return grown


def _direction(fit: ImageFit, fx_n: float, fy_n: float, spin_nm: float, *, turns: bool) -> Array:
    """Return the direction in which a load moves the contact, as `ImageFit.shift_m`, of length 1; the load is not 0.

    Where only turns count it is that of the turn.
    """
    if turns:
        return np.array((0.0, 0.0, math.copysign(1.0, spin_nm)))
    load = np.array((fx_n, fy_n, spin_nm / fit.radius_m))
    direction: Array = load / math.sqrt(float(load @ load))
    return direction


def _pattern_surprise(fit: ImageFit, shift_m: Array) -> float:
    """Return −ln of the probability that taxels change like a motion by chance, by what the fit leaves over."""
    squares = min(float(fit.shift_m @ fit.precision @ fit.shift_m), float(shift_m @ fit.precision @ shift_m))
    return f_surprise(squares / MOTIONS / max(fit.scale, 1.0), MOTIONS, fit.freedom)
