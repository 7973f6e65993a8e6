"""The path of a contact in the image, and how far noise alone would stray: white noise, and noise that drifts.

Second differences of the path do not see a steady motion. Over one step, their variance is 6 w + 2 d for white noise of
variance w and a random walk of variance d per step; over h steps it is 6 w + 2 h d. Both follow from the two.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.motion.image_fit import MOTIONS
from slipd.motion.surprises import f_surprise
from slipd.types.arrays import Array

LONG_STEP = 4
"""Steps of the longer second difference."""
LEAST_STD_M = 2e-6
"""The noise is taken as no smaller, m: images without noise, or in coarse counts, hide it."""
KNOWN_COUNT = 20
"""Second differences that a noise known before is worth."""
FREEDOM_SHARE = 0.5
"""Independent values in one second difference: those beside it share two of its three places."""


class ShiftPath:
    """Places of a contact after one reference image.

    Args:
        noise: Of all paths of the contact.
    """

    def __init__(self, noise: PathNoise) -> None:
        self._noise, self._places = noise, [np.zeros(MOTIONS)][:0]

    def add(self, place_m: Array) -> None:
        """Add a place, as `slipd.motion.image_fit.ImageFit.shift_m`."""
        places = self._places
        places.append(place_m)
        if len(places) > 2:
            self._noise.add(places[-1] - 2.0 * places[-2] + places[-3])
        known = places[: -2 * LONG_STEP]
        if len(known) > 2 * LONG_STEP:
            self._noise.add_long(known[-1] - 2.0 * known[-1 - LONG_STEP] + known[-1 - 2 * LONG_STEP])

    def surprise(self, along: Array, length_m: float) -> float:
        """Return −ln of the probability that noise takes the path as far in its number of steps.

        Args:
            along: A direction, shape (3,), of length 1.
            length_m: How far along it, m.
        """
        return self._noise.surprise(along, length_m, len(self._places))


class PathNoise:
    """Noise of the places of one contact.

    Args:
        known_m: Standard deviations of the places that are known before, shape (3,), m; they count as `KNOWN_COUNT`
            second differences. None: nothing is known.
    """

    def __init__(self, known_m: Array | None = None) -> None:
        self._squares, self._count = np.zeros(MOTIONS), 0
        if known_m is not None:
            self._squares, self._count = 6.0 * KNOWN_COUNT * known_m * known_m, KNOWN_COUNT
        self._long_squares, self._long_count = np.zeros(MOTIONS), 0

    def add(self, difference_m: Array) -> None:
        """Add a second difference over one step."""
        self._squares += difference_m * difference_m
        self._count += 1

    def add_long(self, difference_m: Array) -> None:
        """Add a second difference over ``LONG_STEP`` steps."""
        self._long_squares += difference_m * difference_m
        self._long_count += 1

    def surprise(self, along: Array, length_m: float, steps: int) -> float:
        """Return as `ShiftPath.surprise`; 0 while nothing is known of the noise.

        Until the longer differences are many enough, all noise counts as a random walk.
        """
        if not self._count:
            return 0.0
        short = np.maximum(self._squares / self._count, LEAST_STD_M**2)
        walk = 0.5 * short
        if self._long_count > LONG_STEP:
            doubt = 1.0 + 1.5 * math.sqrt(LONG_STEP / self._long_count)
            longer = doubt * self._long_squares / self._long_count
            walk = np.minimum(walk, np.maximum(longer - short, 0.0) / (2.0 * (LONG_STEP - 1)))
        variance = short / 3.0 + steps * walk
        deviation_m2 = float(along * along @ variance)
        return f_surprise(length_m * length_m / deviation_m2, 1, FREEDOM_SHARE * self._count)
