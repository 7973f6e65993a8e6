"""Tables of forces: no setting exceeds the requested force."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.robotiq_2f.robotiq_units import ForceMap, interpolate

TABLE = [(0.0, 3.0), (60.0, 7.5), (120.0, 13.0), (255.0, 30.0)]


@st.composite
def tables(draw: st.DrawFn) -> list[tuple[float, float]]:
    """Rising integer settings within a byte, and forces that rise by at least 0.1 N."""
    units = draw(st.lists(st.integers(0, 255), min_size=2, max_size=6, unique=True))
    steps = draw(st.lists(st.floats(0.1, 50.0), min_size=len(units), max_size=len(units)))
    return list(zip(map(float, sorted(units)), itertools.accumulate(steps), strict=True))


@pytest.mark.parametrize(
    ("force_n", "units"),
    [*((force_n, units) for units, force_n in TABLE), (5.25, 30), (5.26, 30), (5.24, 29), (1, 0), (1e6, 255)],
)
def test_a_force_is_rounded_down_to_an_integer_setting_within_the_table(force_n: float, units: int) -> None:
    assert ForceMap(TABLE).units(force_n) == units


@pytest.mark.parametrize(("units", "force_n"), [*TABLE, (30, 5.25), (-10, 3.0), (300, 30.0)])
def test_a_setting_has_the_force_on_the_line_between_two_points(units: float, force_n: float) -> None:
    assert ForceMap(TABLE).newtons(units) == pytest.approx(force_n)


@given(table=tables(), share=st.floats(0.0, 1.0))
def test_the_applied_force_never_exceeds_the_requested_one(table: list[tuple[float, float]], share: float) -> None:
    least, most = table[0][1], table[-1][1]
    asked = least + share * (most - least)
    forces = ForceMap(table)
    setting = forces.units(asked)
    assert table[0][0] <= setting <= table[-1][0]
    assert forces.newtons(setting) <= asked * (1.0 + 1e-6)
    if setting < table[-1][0]:
        assert forces.newtons(setting + 1) > asked * (1.0 - 1e-6), "the next setting would still have been allowed"


@given(table=tables(), a=st.floats(0.0, 300.0), b=st.floats(0.0, 300.0))
def test_a_larger_request_never_applies_less_force(table: list[tuple[float, float]], a: float, b: float) -> None:
    forces = ForceMap(table)
    assert forces.units(min(a, b)) <= forces.units(max(a, b))


def test_interpolate_holds_the_ends_of_a_falling_table() -> None:
    widths = [(0.0, 0.085), (1.0, 0.0)]
    found = [interpolate(widths, closure) for closure in (-1.0, 0.0, 0.5, 1.0, 2.0)]
    assert found == pytest.approx([0.085, 0.085, 0.0425, 0.0, 0.0])
