"""Cost against taxels: the same contact seen by 4 to 4,096 taxels, by the solvers that claim its exact limit."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from chart.methods import METHODS, Method, ask
from chart.scenes import MU, Scene
from chart.scores import timed
from numpy.typing import NDArray

from slipd.types.arrays import Array

ASKED = ("slipd", "batch", "hybr", "Clarabel", "Weiszfeld")
MOST, QUICK_MOST = 4096, 256
ROUNDS, QUICK_ROUNDS = 9, 2
"""Contacts of each size, each drawn anew; the median of them is shown."""

LARGE = 256
"""From here on, the calls' own cost is small beside the taxels'."""


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Median time of a decision.

    Attributes:
        taxels: Shape (sizes,).
        seconds: By short name, shape (sizes,); NaN where it fails.
    """

    taxels: NDArray[np.int64]
    seconds: dict[str, Array]

    def slope(self, short: str) -> float:
        """Exponent of the cost in the taxels, fitted over the large contacts: 1 is linear."""
        large = (self.taxels >= LARGE) & np.isfinite(self.seconds[short])
        if large.sum() < 2:
            return math.nan
        return float(np.polyfit(np.log(self.taxels[large]), np.log(self.seconds[short][large]), 1)[0])


def run(quick: bool) -> Scaling:
    """Sizes in the inner loop, contacts in the outer one: noise meets all sizes and methods alike."""
    methods = [method for method in METHODS if method.short in ASKED]
    taxels = 2 ** np.arange(2, round(math.log2(QUICK_MOST if quick else MOST)) + 1)
    rounds = QUICK_ROUNDS if quick else ROUNDS
    seconds = np.full((len(methods), taxels.size, rounds), math.nan)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # methods divide by zero on the way
        for method in methods:
            ask(method, contact(4, np.random.default_rng(0)))
        for number in range(rounds):
            rng = np.random.default_rng(number)
            for size, count in enumerate(taxels):
                scene = contact(int(count), rng)
                for row, method in enumerate(methods):
                    seconds[row, size, number] = _seconds(method, scene)
    return Scaling(taxels, {method.short: _median(seconds[row]) for row, method in enumerate(methods)})


def contact(count: int, rng: np.random.Generator) -> Scene:
    """A round contact of Hertz pressure, 10 N, seen by so many taxels at random places, at ρ = 0.7."""
    radius, angle = np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * math.pi, count)
    x, y, loads = 0.01 * radius * np.cos(angle), 0.01 * radius * np.sin(angle), np.sqrt(1.0 - radius**2)
    loads *= 10.0 / loads.sum()
    way = rng.uniform(0.0, 2.0 * math.pi)
    force = 0.7 * MU * 10.0 * np.array((math.cos(way), math.sin(way)))
    return Scene("round", x, y, loads, MU, force, np.array((loads @ x, loads @ y)) / loads.sum())


def _seconds(method: Method, scene: Scene) -> float:
    _, seconds, failure = timed(method, scene)
    return math.nan if failure else seconds


def _median(seconds: Array) -> Array:
    """Over the contacts that it answered."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a row of NaN stays NaN
        return np.nanmedian(seconds, axis=1)
