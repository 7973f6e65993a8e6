"""Contacts whose loads, force or units make methods fail: unequal loads, R near μ, C beside the centroid, bad data."""

from __future__ import annotations

import math

import numpy as np
from chart.failing_shapes import FIVE, disc
from chart.row import MM, Row, at_taxel, contact
from chart.scenes import MU, Scene, grid
from numpy.typing import ArrayLike


def pad(force: ArrayLike, length: float = 1.0, newton: float = 1.0) -> Scene:
    """The whole 8 × 16 pad under equal loads, the force in shares of μ f_n."""
    x, y = grid()
    return contact(x * length, y * length, np.full(128, newton), np.asarray(force) * MU * newton * 128.0)


def unequal_loads() -> list[Row]:
    x, y = FIVE
    one = np.array((10.0, 1e-9, 2e-9, 1.5e-9, 1e-9))
    near = contact(x, y, one, (0.6 * MU * 10.0, 0.8 * MU * 10.0 * (1.0 + 2e-10)))
    decades = contact(x, y, (1e-12, 1.0, 1e-9, 1e-3, 1e-6), (0.2, -0.1))
    again = np.array((0, 1, 2, 3, 4, 1, 2, 1))
    doubled = contact(x[again], y[again], (1.0, 0.5, 2.0, 0.1, 0.3, 0.25, 1e-3, 3.0), (0.9, 0.4))
    a, b = grid()
    dead = (abs(a) < 13.0 * MM) & (abs(b) < 8.0 * MM)
    hole = contact(a[~dead], b[~dead], np.ones(int((~dead).sum())), (6.0, 8.0))
    clipped = np.clip(1.5 - (a / 20e-3) ** 2 - (b / 10e-3) ** 2, 0.0, 0.7)
    on = clipped > 0.0
    saturated = contact(a[on], b[on], clipped[on], (0.25 * math.fsum(clipped[on]), 0.0))
    nil = contact((-10.0 * MM, 0.0, 10.0 * MM), np.zeros(3), (1.0, 0.0, 1.0), (0.0, 0.0))
    why = {
        "heavy": "The limit is 1e-10 of μ f_n times a length: lost unless arms are taken from the heavy taxel.",
        "near": "The tiny loads decide whether the pole is at the heavy taxel or far from it.",
        "decades": "Each load moves the pole only where the next heavier leaves it free.",
        "doubled": "Positions that occur twice and thrice meet in one kink.",
    }
    return [
        at_taxel("one dominant", why["heavy"], contact(x, y, one, (0.0, 0.0)), 0),
        Row("one dominant, near R = μ", why["near"], near, 1.5314606496485943e-11),
        Row("twelve decades", why["decades"], decades, 2.6223406861378735e-06),
        Row("doubled taxels", why["doubled"], doubled, 0.017459733181667762),
        Row(
            "saturated taxels", "Equal readings, symmetric to the last bit.", saturated, 0.23429788997424844, "interior"
        ),
        Row("dead taxels", "The pole lies in a hole of the image.", hole, 0.8129863424790877, "interior"),
        Row("zero load at the pole", "A taxel at the pole that carries nothing: 0/0.", nil, 20.0 * MM * MU),
    ]


def near_translation() -> list[Row]:
    x, y = FIVE
    loads = np.array((4.0, 1.0, 2.0, 0.5, 0.5))  # μ f_n = 4 N
    why = "The pole is σ/√(2(1 − ρ)) away: differences of Φ drown in rounding, and ρ's own rounding counts."
    limits = {
        -2: 0.0010536077336909134,
        -4: 0.00012098535621291121,
        -6: 1.2258254613432736e-05,
        -9: 3.881832234435221e-07,
        -12: 1.2275839311296434e-08,
        -14: 1.2257441996252593e-09,
    }
    rows = []
    for exponent, limit in limits.items():
        size = 1.0 - float(f"1e{exponent}")
        rows.append(
            Row(f"1 − ρ = 1e{exponent}", why, contact(x, y, loads, (2.4 * size, 3.2 * size)), limit, "interior")
        )
    h = 2.0**-40
    pair = contact((-10.0 * MM, 10.0 * MM), (0.0, 0.0), (1.0, 1.0), (1.0 - h, 0.0))
    beside = contact(x, y, loads, (0.0, 4.0))
    beside = contact(x, y, loads, (0.0, 4.0), np.add(beside.about, (MM, 0.0)))
    over = contact(x, y, loads, (0.0, 4.0 * (1.0 + 1e-12)))
    slides = "It slides whatever the torque: Φ falls without end, and a search runs on."
    known = 20.0 * MM * MU * math.sqrt(h * (2.0 - h))
    return [
        *rows,
        Row(
            "two taxels, 1 − ρ = 2^-40",
            "As before, where a triangle of forces tells the limit.",
            pair,
            known,
            "interior",
        ),
        Row("R = μ", "Φ has an infimum and no minimum.", contact(x, y, loads, (0.0, 4.0)), 0.0, "translating"),
        Row("R = μ, C beside", "As before, and the lever of f_t is all there is.", beside, -4.0 * MM, "translating"),
        Row("R > μ by 1e-12", slides, over, math.nan, "translating"),
        Row("R = 1.5 μ", slides, contact(x, y, loads, (0.0, 6.0)), math.nan, "translating"),
    ]


def beside_the_centroid() -> list[Row]:
    x, y, loads = disc()
    force = (0.0, 0.999 * MU * 8.0)
    below = contact(x, y, loads, force, (4.0 * MM, 0.0))
    other = contact(x, y, loads, force, (-4.0 * MM, 0.0))
    metre = contact(x, y, loads, (0.0, 2.0), (1.0, 0.0))
    why = "Friction turns the other way even at its limit: clipped to zero, a sliding contact looks safe."
    return [
        Row("limit below zero", why, below, -0.01508699205950697, "interior"),
        Row("the other side", "The same force, and its lever helps.", other, 0.01688100794049303, "interior"),
        Row(
            "C a metre away",
            "The lever of f_t is a hundred times the contact's torque.",
            metre,
            -1.9783593494513756,
            "interior",
        ),
    ]


def units_and_places() -> list[Row]:
    force, one = (0.3, 0.5), 0.7002632848452864
    rows = [Row("pad", "The contact that the next four scale.", pad(force), one, "interior")]
    why = "Tolerances in metres and newtons do not scale."
    for name, length, newton in (("mm", 1e3, 1.0), ("km", 1e-3, 1.0), ("µN", 1.0, 1e6), ("MN", 1.0, 1e-6)):
        rows.append(Row(f"pad in {name}", why, pad(force, length, newton), one * length * newton, "interior"))
    x, y = grid()
    far = contact(x + 1e4, y - 1e4, np.ones(128), np.asarray(force) * 64.0, (1e4, -1e4))
    apart = contact((0.0, 3 * MM, MM, 1e3, 1e3 + 2 * MM), (0.0, MM, 2 * MM, 0.0, 3 * MM), np.ones(5), (0.4, 1.1))
    return [
        *rows,
        Row(
            "10 km from the origin", "Positions differ in their last digits only.", far, 0.7002632848482216, "interior"
        ),
        Row("two contacts 1 km apart", "The pole has two lengths to live on.", apart, 560.0016960692275),
    ]


def no_answer() -> list[Row]:
    """Data that have no limit: what counts is that nothing comes out that looks like one."""
    x, y = FIVE
    loads, force, nan = (1.0, 2.0, 1.5, 0.7, 1.2), (0.6, -0.9), math.nan
    bad = {
        "no load": ("All loads are zero: shares are 0/0.", (0.0,) * 5, force),
        "empty image": ("No taxel is active.", (), force),
        "negative load": ("A baseline that drifted: Φ is not convex any more.", (1.0, 2.0, -1.5, 0.7, 1.2), force),
        "NaN load": ("One lost reading.", (1.0, 2.0, nan, 0.7, 1.2), force),
        "infinite load": ("One overflow.", (1.0, 2.0, math.inf, 0.7, 1.2), force),
        "NaN force": ("The wrench is missing.", loads, (nan, 0.0)),
    }
    return [
        Row(name, why, contact(x[: len(given)], y[: len(given)], given, pull, (0.0, 0.0)), nan, "none")
        for name, (why, given, pull) in bad.items()
    ]
