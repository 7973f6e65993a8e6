"""Every row of the failure atlas: certified to 1e-9 of the contact's torque, with the true limit inside the bounds."""

from __future__ import annotations

import itertools
import math

import pytest
from chart.failures import ROWS
from chart.row import Row

from slipd.fusion import TorqueLimit, torque_limit, utilisation

GAP = 1e-9
"""Certified, of the contact's own torque."""

ROUNDED = 1e-15
"""Of that torque, and of what the lever of f_t adds to it: what the row's own number, a double, may lack."""

NUMBERS = [row for row in ROWS if math.isfinite(row.limit_nm)]
LIMITS = [row for row in NUMBERS if row.scene.torque_scale_nm > 0.0]


def ours(row: Row, sense: int = 1):
    s = row.scene
    return torque_limit(s.x, s.y, s.loads, s.mu, s.tangential, s.about, sense)


def rounding(row: Row) -> float:
    return ROUNDED * (row.scale_nm + abs(row.limit_nm))


def is_certified(row: Row, found: TorqueLimit) -> bool:
    gap_nm = found.upper_nm - found.lower_nm
    return gap_nm <= GAP * row.scale_nm and holds(row, found)


def holds(row: Row, found: TorqueLimit) -> bool:
    """Return whether the right limit lies within the bounds."""
    return found.lower_nm - rounding(row) <= row.limit_nm <= found.upper_nm + rounding(row)


def test_the_limit_is_certified_and_the_right_one_lies_within_the_bounds() -> None:
    for row in ROWS:
        found = ours(row)
        assert found.kind == (row.kind or found.kind), row.name
        if not math.isfinite(row.limit_nm):  # where no limit exists, the answer is NaN
            assert (found.pole_m, math.isnan(found.torque_nm)) == (None, True), row.name
            continue
        assert found.lower_nm <= found.torque_nm <= found.upper_nm, row.name
        assert is_certified(row, found), row.name
        assert (found.pole_m is None) == (found.kind == "translating"), row.name


def test_the_bounds_hold_after_any_number_of_passes() -> None:
    for row, passes in itertools.product(NUMBERS, (1, 2, 3, 6)):
        s = row.scene
        found = torque_limit(s.x, s.y, s.loads, s.mu, s.tangential, s.about, passes=passes)
        assert holds(row, found), (row.name, passes)


def test_the_mirrored_contact_has_the_same_limit_in_the_other_sense() -> None:
    for row in NUMBERS:
        s = row.scene
        found = torque_limit(s.x, -s.y, s.loads, s.mu, s.tangential * (1, -1), s.about * (1, -1), -1)
        assert is_certified(row, found), row.name


@pytest.mark.parametrize("start", [None, (1.0, 0.0, 0.0), (-3e8, 2e8, 1.0), (0.0, 0.0, -1e-6)])
def test_a_load_on_the_limit_has_utilisation_one_from_any_start(start: tuple[float, float, float] | None) -> None:
    for row in LIMITS:
        s = row.scene
        used = utilisation(s.x, s.y, s.loads, s.mu, s.tangential, row.limit_nm, s.about, start=start)
        assert used.upper - used.lower <= GAP, row.name
        assert used.lower - 1e-12 <= 1.0 <= used.upper + 1e-12, row.name


@pytest.mark.parametrize("share", [0.0, 0.5, 2.0])
def test_utilisation_is_certified_inside_and_outside_the_limit(share: float) -> None:
    for row in LIMITS:
        s = row.scene
        used = utilisation(s.x, s.y, s.loads, s.mu, s.tangential, share * row.limit_nm, s.about)
        assert used.lower <= used.value <= used.upper, row.name
        assert used.upper - used.lower <= GAP * max(used.value, 1.0), row.name
        inside = -torque_limit(s.x, s.y, s.loads, s.mu, s.tangential, s.about, -1).upper_nm
        if share * row.limit_nm > row.limit_nm + rounding(row):
            assert used.upper >= 1.0, row.name
        elif inside + rounding(row) < share * row.limit_nm < row.limit_nm - rounding(row):
            assert used.lower <= 1.0, row.name
