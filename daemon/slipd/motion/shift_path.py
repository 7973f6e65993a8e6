"""The path of a contact from block to block: how far noise alone would stray, and which motion is known.

Noise is white, or drifts. Second differences of the path do not see a steady motion. Over one step, their variance is
6 w + 2 d for white noise of variance w and a random walk of variance d per step; over h steps it is 6 w + 2 h d. Both
follow from the two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.motion.evidence import LASTS_NS, LEAST_STD_M, LONG_STEP, REPORTED_NS, f_surprise, walk_variance
from slipd.motion.image_blocks import Block
from slipd.motion.image_fit import MOTIONS
from slipd.types.arrays import Array

KNOWN_COUNT = 20
"""Second differences that a noise known before is worth."""
FREEDOM_SHARE = 0.5
"""Independent values in one second difference: those beside it share two of its three places."""
LEAST_M = 2e-4
"""A smaller motion may be that of a pad that gives way, m."""
AGAIN_M = 1e-4
"""A contact that is known to move is reported again after a further motion by this much, m."""
ALONG = 0.5
"""Cosine of the largest angle between a shift and the tangential force: a turn beside it may bend its way so far."""
EACH_SURPRISE = 3.0
"""The path must look like a motion by this much."""
KEPT_NS = 10_000_000_000
"""A path begins anew after this time: charge and rubber creep for longer."""
LONGEST_NS = 800_000_000
"""It counts as moving for twice the time that this took, and at most for so long; then it rests."""


class PathNoise:
    """Noise of the places of one contact.

    Args:
        known_m: Standard deviations of the places that are known before, shape (3,), m; they count as `KNOWN_COUNT`
            second differences. None: nothing is known.
    """

    def __init__(self, known_m: Array | None = None) -> None:
        self._squares = {1: np.zeros(MOTIONS), LONG_STEP: np.zeros(MOTIONS)}
        self._counts = {1: 0, LONG_STEP: 0}
        if known_m is not None:
            self._squares[1], self._counts[1] = 6.0 * KNOWN_COUNT * known_m * known_m, KNOWN_COUNT

    def add(self, places_m: list[Array], step: int) -> None:
        """Add the newest second difference of a path over ``step`` steps, if the path is so long."""
        if len(places_m) > 2 * step:
            _add_second_difference(self._squares[step], places_m[-1], places_m[-1 - step], places_m[-1 - 2 * step])
            self._counts[step] += 1

    def surprise(self, along: Array, length_m: float, steps: int) -> float:
        """Return as `ShiftPath.surprise`; 0 while nothing is known of the noise."""
        count, long_count = self._counts.values()
        if not count:
            return 0.0
        short = np.maximum(self._squares[1] / count, LEAST_STD_M**2)
        walk = 0.5 * walk_variance(short, self._squares[LONG_STEP] / max(long_count, 1), long_count)
        deviation_m2 = float(along * along @ (short / 3.0 + steps * walk))
        return f_surprise(length_m * length_m / deviation_m2, 1, FREEDOM_SHARE * count)


@compiled
def _add_second_difference(squares: Array, newest: Array, middle: Array, oldest: Array) -> None:
    """Add the square of the second difference of three places to the sums of squares, each of shape (3,)."""
    for i in range(MOTIONS):
        difference = newest[i] - 2.0 * middle[i] + oldest[i]
        squares[i] += difference * difference


class ShiftPath:
    """Places of a contact after one reference.

    Args:
        reference: The block from which the places are measured.
        noise: Of all paths of the contact.
    """

    def __init__(self, reference: Block, noise: PathNoise) -> None:
        self.reference = reference
        self._noise, self._places = noise, list[Array]()

    def add(self, place_m: Array) -> None:
        """Add a place, as `slipd.motion.image_fit.ImageFit.shift_m`."""
        self._places.append(place_m)
        self._noise.add(self._places, 1)
        self._noise.add(self._places[: -2 * LONG_STEP], LONG_STEP)

    def surprise(self, along: Array, length_m: float) -> float:
        """Return −ln of the probability that noise takes the path as far in its number of steps.

        Args:
            along: A direction, shape (3,), of length 1.
            length_m: How far along it, m.
        """
        return self._noise.surprise(along, length_m, len(self._places))


class Motion(NamedTuple):
    """A motion when it was found: by ``shift_m`` since the path began; what the shift means is up to who finds it."""

    t_ns: int
    shift_m: Array
    surprise: float
    path: ShiftPath


class KnownMotion:
    """The newest motion that was found, and the last one that was confirmed.

    Attributes:
        found: The newest.
        known: The last confirmed one, until the contact has rested.
    """

    def __init__(self) -> None:
        self.found: Motion | None = None
        self.known: Motion | None = None

    def confirm(self) -> int:
        """Take the newest motion as true; return until when the contact counts as moving, CLOCK_MONOTONIC in ns.

        Raises:
            ValueError: There was none yet.
        """
        found, known = self.found, self.known
        if found is None:
            raise ValueError("evidence must come before it is confirmed")
        self.known = found
        taken_ns = LASTS_NS if known is None else found.t_ns - known.t_ns
        return found.t_ns + min(max(2 * taken_ns, REPORTED_NS), LONGEST_NS)

    def rests(self, t_ns: int) -> bool:
        """Forget a confirmed motion that has ended by ``t_ns``; return whether one did."""
        if self.known is None or t_ns - self.known.t_ns <= LONGEST_NS:
            return False
        self.known = None
        return True

    def shift_m(self, path: ShiftPath) -> Array | None:
        """Return how far the contact is known to have moved on a path; None where it is not."""
        return self.known.shift_m if self.known is not None and self.known.path is path else None
