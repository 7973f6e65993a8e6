"""Contacts whose shape makes methods fail: the pole at a taxel, few taxels, taxels on a line."""

from __future__ import annotations

import math

import numpy as np
from chart.row import MM, Row, at_taxel, contact, phi
from chart.scenes import MU, PITCH_M, Array, grid, turning_about

FIVE = np.array((0.0, 6.0, -5.0, 1.0, -3.0)) * MM, np.array((0.0, 1.0, 4.0, -7.0, -2.0)) * MM
"""Five taxels with no symmetry, the first at the origin."""


def disc() -> tuple[Array, Array, Array]:
    """A round contact of 316 cells, radius 10 mm, 8 N in all: (x, y, loads)."""
    x, y = (a.ravel() for a in np.meshgrid(*2 * [(np.arange(20) - 9.5) * MM]))
    inside = x**2 + y**2 <= (10.0 * MM) ** 2
    return x[inside], y[inside], np.full(int(inside.sum()), 8.0 / inside.sum())


def nothing_special() -> list[Row]:
    """Where every method should be good, to read the others by."""
    x, y, loads = disc()
    a, b = grid()
    tilted = contact(a, b, 1.0 + 40.0 * (a - a.min()) + 25.0 * (b - b.min()), (30.0, 31.0))
    why = {
        0.2: ("Nothing is.", 0.025937097750372905),
        0.5: (
            "(6) as printed takes the two torques about different points: half too much already.",
            0.0216406505486245,
        ),
        0.9: ("Little is left for the torque: the error of a model is as large as that.", 0.009129452824028954),
    }
    rows = [
        Row(f"disc, ρ = {ratio:g}", text, contact(x, y, loads, (ratio * MU * 8.0, 0.0), (0.0, 0.0)), limit, "interior")
        for ratio, (text, limit) in why.items()
    ]
    text = "The load leans to a corner and the force is askew to it: no symmetry tells where the pole is."
    return [*rows, Row("tilted pad", text, tilted, 1.989182465557529, "interior")]


def pole_at_a_taxel() -> list[Row]:
    x, y = FIVE
    loads = np.array((5.0, 1.0, 1.5, 0.7, 1.2))
    # The others pull (−1, 0.5), the first all it can: 0.5 (0.6, 0.8).
    verge = contact(np.array((0, 4, 0)) * MM, np.array((0, 0, 3)) * MM, (1, 1, 2), (-0.7, 0.9))
    cross = contact(np.array((0, 1, -1, 0, 0)) * MM, np.array((0, 0, 0, 1, -1)) * MM, np.ones(5), (0.0, 0.0))
    obtuse = contact(np.array((0, 30, -30)) * MM, np.array((0, 4, 4)) * MM, np.ones(3), (0.0, 0.0))
    why = "Φ has a kink at its minimum: no gradient vanishes, and a Newton matrix blows up."
    rows = [
        at_taxel("hinge", why, contact(x, y, loads, (0.6, -0.9)), 0),
        Row(
            "verge of a hinge",
            "The hinge carries all it can: kink and smooth minimum meet.",
            verge,
            phi(verge, (0.0, 0.0)),
        ),
        at_taxel("hinge at the start", "The centroid, where searches start, is the taxel itself: 0/0.", cross, 0),
        at_taxel("obtuse triangle", "Without force the pole is the corner of an angle over 120°.", obtuse, 0),
    ]
    why = "The curvature grows as one over the distance, in a disc so small that a search steps over it."
    for exponent in (-3, -6, -9, -12):
        pole = np.array((0.6, 0.8)) * PITCH_M * 10.0**exponent
        scene = turning_about("failure", x, y, loads, pole)
        limit = phi(scene, pole.tolist())
        rows.append(Row(f"beside a taxel, 1e{exponent} pitch", why, scene, limit, "interior"))
    gap = PITCH_M * 1e-9
    pole = np.array((gap / 2.0, 0.0))
    scene = turning_about("failure", np.append(x, gap), np.append(y, 0.0), np.append(loads, 5.0), pole)
    why = "Two heavy taxels 1e-9 of a pitch apart: the pole lies between two kinks at once."
    return [*rows, Row("between twins", why, scene, phi(scene, pole.tolist()))]


def few_taxels() -> list[Row]:
    a = 10.0 * MM
    x, y = (-a, a), (0.0, 0.0)
    half = contact(x, y, (1, 1), (0.6, 0.0))
    across = contact(x, y, (1, 1), (0.0, 0.4))
    beside = contact([a], [a], [3.0], (0.2, 0.5), (a - 2.0 * MM, a))
    angle = 0.3 + np.arange(3) * (2.0 * math.pi / 3.0)
    fermat = contact(2.0 * a * np.cos(angle), 2.0 * a * np.sin(angle), np.ones(3), (0.0, 0.0), (0.0, 0.0))
    why = "Every point between them is a pole: (5) has a segment of solutions."
    return [
        Row("one", "The limit is 0, and so is every length.", contact([a], [a], [3.0], (0.2, 0.0)), 0.0, "hinge"),
        Row("one, C beside it", "All the torque is the lever of f_t.", beside, 2.0 * MM * 0.5, "hinge"),
        Row("two, no force", why, contact(x, y, (1, 1), (0.0, 0.0)), 2.0 * MU * a),
        Row("two, pulled along", "Both frictions meet at one point off the line.", half, 2.0 * a * 0.4, "interior"),
        at_taxel(
            "two, pulled across", "One is the hinge, and beyond it (5) is wrong by the same all along.", across, 0
        ),
        Row("three, 120° apart", "Symmetric about the pole, their Fermat point.", fermat, 6.0 * MU * a, "interior"),
    ]


def on_a_line() -> list[Row]:
    along, none = (np.arange(8) - 3.5) * PITCH_M, np.zeros(8)
    uneven = np.array((0.3, 1.1, 0.7, 2.0, 0.4, 0.9, 1.6, 0.5))
    eight = contact(along, none, np.ones(8), (0.0, 0.0))
    seven = contact(along[:7], none[:7], np.ones(7), (0.0, 0.0))
    turned = contact(along * math.cos(0.7), along * math.sin(0.7), np.ones(8), (0.0, 0.0))
    across = contact(along, none, uneven, (0.0, 1.3))
    hinge = min(range(8), key=lambda n: phi(across, (float(along[n]), 0.0)))
    equal = MU * 16.0 * PITCH_M
    askew = contact(along, none, uneven, (1e-6, 0.4))
    rows = [
        Row("eight, no force", "A segment of poles between the middle two, and no curvature on it.", eight, equal),
        at_taxel("seven, no force", "The middle one is the hinge, and nothing curves along the line.", seven, 3),
        Row("turned by 0.7 rad", "A line but for the last bit of each position.", turned, equal),
        at_taxel("pulled across", "Φ is piecewise linear along the line, a corner at each taxel.", across, hinge),
        Row(
            "pulled along",
            "The pole leaves the line.",
            contact(along, none, uneven, (2.0, 0.0)),
            0.018774530319924727,
            "interior",
        ),
        Row(
            "pulled all but across",
            "Whether the pole leaves the line hangs on a millionth.",
            askew,
            0.019592533333333335,
        ),
    ]
    why = "A line but for its width: two curvatures as far apart as its square."
    loads, force = (1.0, 1.1, 0.9, 1.2, 0.8), (0.7, 0.9)
    limits = {-4: 0.006736289611189826, -8: 0.0067362718121446825, -12: 0.00673627181037001}
    for exponent, limit in limits.items():
        scene = contact(FIVE[0], FIVE[1] * float(f"1e{exponent}"), loads, force)
        rows.append(Row(f"width 1e{exponent}", why, scene, limit))
    return rows
