"""The friction limit against closed forms, and the ways methods fail."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from limit_contacts import MU, disc

from slipd.fusion import torque_limit, utilisation
from slipd.types.arrays import Array


@pytest.mark.parametrize(
    ("rho", "expected"), [(0.0, 2 / 3), (0.2, 0.647), (0.5, 0.539), (0.8, 0.329), (0.9, 0.228), (0.99, 0.071)]
)
def test_a_uniform_disc_resists_two_thirds_mu_fn_a_and_less_beside_a_force(rho: float, expected: float) -> None:
    x, y, loads = disc(0.01, 120)
    limit = torque_limit(x, y, 8.0 * loads, MU, (rho * MU * 8.0, 0.0), (0.0, 0.0))
    assert limit.torque_nm / (MU * 8.0 * 0.01) == pytest.approx(expected, abs=2e-3)
    assert limit.kind == "interior"


def circle(count: int, radius: float, first: float = 0.0) -> tuple[Array, Array]:
    angle = first + np.arange(count) * 2.0 * np.pi / count
    return radius * np.cos(angle), radius * np.sin(angle)


GRID = [each.ravel() for each in np.meshgrid(np.arange(5) * 3.2e-3, np.arange(5) * 3.2e-3)]
HEAVY = np.where(np.arange(25) == 7, 5.0, 0.01)
SEVENTH = (GRID[0][7], GRID[1][7])
CORNER = ([0.0, 0.03, -0.03], [0.0, 0.004, 0.004])
LEVERS = np.hypot(GRID[0] - SEVENTH[0], GRID[1] - SEVENTH[1])


@pytest.mark.parametrize(
    ("x", "y", "loads", "force", "about", "torque_nm", "kind", "pole_m"),
    [
        # a ring; three equal points turn about their Fermat point, an obtuse triangle about its obtuse corner
        (*circle(64, 0.01), np.full(64, 1 / 64), (0, 0), (0, 0), MU * 0.01, "interior", (0.0, 0.0)),
        (*circle(3, 0.02, 0.3), np.ones(3), (0, 0), (0, 0), 3 * MU * 0.02, "interior", (0.0, 0.0)),
        (*CORNER, np.ones(3), (0, 0), (0, 0), 2 * MU * math.hypot(0.03, 0.004), "hinge", (0.0, 0.0)),
        # two points; pulled across with half of what both can carry, one slides and the other is the hinge
        ([-0.01, 0.01], [0, 0], [1, 1], (0, 0), (0, 0), 2 * MU * 0.01, None, None),
        ([-0.01, 0.01], [0, 0], [1, 1], (0.0, MU), (0, 0), MU * 0.01, None, None),
        # one taxel carries most of the load, or all
        (*GRID, HEAVY, (0.3, 0.1), SEVENTH, MU * HEAVY @ LEVERS, "hinge", SEVENTH),
        ([0.01], [0.02], [3.0], (0.2, 0.0), (0.01, 0.02), 0.0, "hinge", (0.01, 0.02)),
        # equal collinear taxels have a segment of poles and one limit
        ([0.0, 0.01, 0.02, 0.03], np.zeros(4), np.ones(4), (0, 0), (0.015, 0), MU * 0.04, None, (0.015, 0.0)),
    ],
)  # fmt: skip
def test_a_contact_has_its_closed_form(
    x: Array, y: Array, loads: Array, force: Any, about: Any, torque_nm: float, kind: str | None, pole_m: Any
) -> None:
    limit = torque_limit(x, y, loads, MU, force, about)
    assert limit.torque_nm == pytest.approx(torque_nm, rel=1e-9)
    assert limit.kind == (kind or limit.kind)
    within_m = 0.005 if kind is None else 1e-8
    assert pole_m is None or limit.pole_m == pytest.approx(pole_m, abs=within_m)


def test_duplicate_taxels_count_like_one_with_their_sum_and_one_alone_resists_no_torque_about_itself() -> None:
    x, y = np.array((0.0, 0.0, 0.01, 0.003)), np.array((0.0, 0.0, 0.002, 0.01))
    twice = torque_limit(x, y, [2.0, 3.0, 0.5, 0.4], MU, (0.1, 0.2), (0, 0))
    once = torque_limit(x[1:], y[1:], [5.0, 0.5, 0.4], MU, (0.1, 0.2), (0, 0))
    assert (twice.torque_nm, twice.kind, once.kind) == (pytest.approx(once.torque_nm, rel=1e-12), "hinge", "hinge")
    assert utilisation([0.01], [0.02], [3.0], MU, (0, 0), 1e-9, (0.01, 0.02)).value == math.inf
    assert utilisation([0.01], [0.02], [3.0], MU, (0.75, 0), 0.0, (0.01, 0.02)).value == pytest.approx(0.5)


def test_the_limit_of_translation_has_no_pole() -> None:
    x, y, loads = disc(0.01, 20)
    beyond = torque_limit(x, y, loads, MU, (MU * 1.001, 0.0), (0, 0))
    assert (beyond.kind, math.isnan(beyond.torque_nm), beyond.pole_m) == ("translating", True, None)
    assert utilisation(x, y, loads, MU, (0.3, 0.0), 0.0, (0, 0)).value == pytest.approx(0.6)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_bad_data_is_a_status_and_not_a_number(bad: float) -> None:
    limit = torque_limit([0, 0.01, 0.02], [0, 0, 0.01], [1.0, bad, 1.0], MU, (0, 0), (0, 0))
    used = utilisation([0, 0.01, 0.02], [0, 0, 0.01], [1.0, bad, 1.0], MU, (0.1, 0), 0.0, (0, 0))
    assert (limit.kind, limit.pole_m, *np.isnan((limit.torque_nm, used.value))) == ("none", None, True, True)
    if bad != -1.0:
        assert math.isnan(utilisation([0, 1], [0, 0], [1, 1], MU, (bad, 0), 0.0, (0, 0)).value)
        assert torque_limit([0, 1], [0, 0], [1, 1], MU, (bad, 0), (0, 0)).kind == "none"


def test_no_load_carries_nothing() -> None:
    for pad in (([], [], []), ([0, 1], [0, 0], [0, 0])):
        assert torque_limit(*pad, MU, (0, 0), (0, 0)).kind == "none"
        assert utilisation(*pad, MU, (0.1, 0), 0.0, (0, 0)).value == math.inf
    assert utilisation([0, 1], [0, 0], [1, 1], MU, (0, 0), 0.0, (0, 0)).value == 0.0


@pytest.mark.parametrize(
    ("function", "arguments", "said"),
    [
        (torque_limit, ([0, 1], [0], [1, 1], MU, (0, 0), (0, 0)), r"share one shape \(n,\)"),
        (torque_limit, ([0], [0], [1], MU, (0, 0), (0, 0), 2), "sense must be"),
        (utilisation, ([0], [0], [1], 0.0, (0, 0), 0.0, (0, 0)), "mu must be positive"),
        (utilisation, ([0], [0], [1], MU, (0, 0, 0), 0.0, (0, 0)), "tangential must have shape"),
    ],
)
def test_invalid_arguments_raise_with_the_rule_in_the_message(function: Any, arguments: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        function(*arguments)
