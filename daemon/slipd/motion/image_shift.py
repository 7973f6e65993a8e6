"""Evidence "image_change" of a pad that measures normal force: the contact moves in the image at unchanged load.

Images are averaged over short blocks. Each block is compared with an earlier one of the same load, which is kept for
some seconds: a shaken object comes back to a load, and a soft pad then to its place. A shift is measured by the
contact centroid of the force sensor, and counts where the image shows it too (`slipd.motion.centroid_shift`). A turn,
and a shift where no torque is measured, are fitted to the image together with what load, tilt and growth do to it
(`slipd.motion.image_fit`).

The path of the motion is tested against a random walk, whose steps are as large as the path's own are irregular. White
noise strays less than that, and so does the noise of a drifting pad.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipd.arrays import Array
from slipd.motion.centroid_shift import ALONG, CentroidShift, Travel
from slipd.motion.evidence import Evidence
from slipd.motion.image_blocks import Block, ImageBlocks, LoadNoise
from slipd.motion.image_fit import MOTIONS, ImageFit, ImageFitter
from slipd.motion.risk import combined_surprise
from slipd.motion.shift_path import PathNoise, ShiftPath
from slipd.motion.surprises import f_surprise
from slipd.signals.pad import PadGeometry

Flags = NDArray[np.bool_]

KEPT_S = 10.0
"""A reference is replaced after this time, s: charge and rubber creep for longer."""
REFERENCES = 8
"""Loads whose images are kept."""
LEAST_M = 2e-4
"""A smaller motion may be that of a pad that gives way, m."""
AGAIN_M = 1e-4
"""A contact that is known to move is reported again after a further motion by this much, m."""
FIRST_NS, SHORTEST_NS, LONGEST_NS = 200_000_000, 300_000_000, 800_000_000
"""It counts as moving for twice the time that this took, at least and at most for so long; then it rests."""
AGAIN_PITCHES = 0.5
"""Beyond this shift the change of an image is not linear any more, and a new reference is taken."""
MOST_TILT = 0.3
"""A stronger tilt, relative at the radius of gyration, may lift one edge off the pad, which looks like a motion."""
SPIN_SHARE = 0.05
"""A spin torque below this share of the tangential force times the radius of gyration turns nothing."""
OPENS = 0.25
"""A gap may open where the pressure falls across the contact by this share of its mean on either side."""
EACH_SURPRISE = 3.0
"""Both the pattern of the change and the path of the contact must look like a motion by this much."""
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
        self._fitter, self._centroids = ImageFitter(geometry), CentroidShift(geometry)
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

    def confirm(self) -> int:
        """Take the newest evidence as true; return until when, CLOCK_MONOTONIC in ns, the contact counts as moving.

        From then on only a further motion is evidence, until the contact has rested.

        Raises:
            ValueError: There was no evidence yet.
        """
        found, known = self._newest, self._known
        if found is None:
            raise ValueError("evidence must come before it is confirmed")
        taken_ns = FIRST_NS if known is None else found.t_ns - known.t_ns
        self._known = found
        return found.t_ns + min(max(2 * taken_ns, SHORTEST_NS), LONGEST_NS)

    def update(
        self, t_ns: int, forces: Array, wrench: tuple[float, ...], usable: Flags | None = None
    ) -> Evidence | None:
        """Update with an image of a contact; return evidence where the contact moves.

        Args:
            t_ns: When the image was acquired, CLOCK_MONOTONIC.
            forces: Normal force on each taxel without a threshold, shape (n,), any unit.
            wrench: Force on the finger, N, and torque about the pad's origin, N·m, at that time: six numbers.
            usable: Taxels that measure by themselves, shape (n,); None: all.
        """
        block = self._blocks.update(t_ns, forces, wrench)
        return None if block is None else self._compare(block, usable)

    def _compare(self, block: Block, usable: Flags | None) -> Evidence | None:
        """Compare a block with the oldest reference of its load."""
        oldest_ns, known = block.t_ns - round(KEPT_S * 1e9), self._known
        if known is not None and block.t_ns - known.t_ns > LONGEST_NS:
            self._known, self._references = None, []
        self._references = [kept for kept in self._references if kept.block.t_ns >= oldest_ns]
        reference = next((kept for kept in self._references if kept.block.same_load(block, self._moved(kept))), None)
        if reference is None:
            self._references = [*self._references[1 - REFERENCES :], self._begin(block)]
            return None
        variance = self._variance(reference.block, block, usable)
        fit = self._fitter.fit(reference.block.image, block.image, variance)
        if fit is None:
            return None
        travel = self._centroids.update(reference.block, block, reference.centroids, variance, fit.radius_m)
        return self._judge(fit, travel, block, reference)

    def _begin(self, block: Block) -> _Reference:
        return _Reference(block, ShiftPath(self._noise), self._centroids.begin(block))

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

    def _judge(self, fit: ImageFit, travel: Travel | None, block: Block, reference: _Reference) -> Evidence | None:
        """Return evidence where the path is one of motion along the load."""
        reference.path.add(fit.shift_m)
        shift = _slide(fit, self._growth(fit, block, reference.block), *block.tangential)
        if travel is not None:
            shift[:2] = travel.shift_m
        travels = travel is not None and float(travel.shift_m @ travel.shift_m) > LEAST_M**2
        if self._known is not None:
            return self._follow(self._known, fit, shift, block, reference, travels=travels)
        beyond = travels or (float(shift @ shift) > LEAST_M**2 and fit.tilt < MOST_TILT)
        lasts, self._beyond_before = beyond and self._beyond_before, beyond
        if not lasts:
            return None
        along = _direction(fit, *block.tangential, turns=travel is not None and not travels)
        if travel is not None and travels:
            path = reference.path.surprise(along, float(along @ fit.shift_m))
            least, both = travel.surprise, combined_surprise([travel.surprise, path])
            most = max(travel.surprise, both)
        else:
            pattern, path = _pattern_surprise(fit, shift), reference.path.surprise(along, float(along @ shift))
            least, most = min(pattern, path), max(pattern, path)
        if least < EACH_SURPRISE:
            return None
        return self._find(_Motion(block.t_ns, shift, most - math.log(2.0), reference))

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
        self, known: _Motion, fit: ImageFit, shift: Array, block: Block, reference: _Reference, *, travels: bool
    ) -> Evidence | None:
        """Return evidence as strong as that of a known motion where it goes on."""
        before = known.shift_m if known.reference is reference else np.zeros(MOTIONS)
        further = shift - before
        goes_on = float(further @ further) > AGAIN_M**2 and float(further @ shift) > 0.0
        if not goes_on or not (travels or _pattern_surprise(fit, shift) >= EACH_SURPRISE):
            return None
        if float(shift @ shift) < (AGAIN_PITCHES * self._pitch_m) ** 2:
            return self._find(_Motion(block.t_ns, shift, known.surprise, reference))
        begun = self._begin(block)
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
    """A block, and the paths since then: of the contact in the image, and of the contact centroid."""

    block: Block
    path: ShiftPath
    centroids: ShiftPath


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
