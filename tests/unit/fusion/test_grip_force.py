"""The least grip that holds a load, rigid and with a contact that grows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd.fusion import grip_needed_n, utilisation

X, Y = np.array((0.01, -0.01, 0.0, 0.0)), np.array((0.0, 0.0, 0.008, -0.008))
LOADS = np.array((2.0, 2.0, 1.0, 1.0))
MU = 0.5


def test_a_rigid_contact_needs_utilisation_times_the_force_it_has() -> None:
    used = utilisation(X, Y, LOADS, MU, (1.0, 0.3), 0.01, (0.001, 0.002)).value
    assert grip_needed_n(X, Y, LOADS, MU, (1.0, 0.3), 0.01, (0.001, 0.002)) == pytest.approx(6.0 * used)


def test_a_hertzian_contact_at_half_its_spin_needs_more_than_half_its_force() -> None:
    full = 0.01 * MU * 4.0 + 0.008 * MU * 2.0
    needed = grip_needed_n(X, Y, LOADS, MU, (0, 0), 0.5 * full, (0, 0), growth=1 / 3)
    assert needed / 6.0 == pytest.approx(0.5**0.75, rel=1e-5)  # limit torque ∝ f^(4/3)


@settings(max_examples=100, deadline=None)
@given(growth=st.floats(0.01, 1.0), spin=st.floats(-0.2, 0.2), fx=st.floats(-5, 5), safety=st.floats(1.0, 3.0))
def test_the_force_found_just_holds_the_load_with_the_contact_it_makes(growth, spin, fx, safety) -> None:
    needed = grip_needed_n(X, Y, LOADS, MU, (fx, 1.0), spin, (0.002, 0.0), growth=growth, safety=safety)
    factor = needed / 6.0
    size = factor**growth
    about_centre = spin + 0.002 * 1.0  # the contact grows about its load centroid, the origin: the spin is taken there
    there = utilisation(X * size, Y * size, LOADS * factor, MU, (safety * fx, safety), safety * about_centre, (0, 0))
    assert there.value == pytest.approx(1.0, rel=1e-4)


def test_a_load_that_no_force_holds_is_infinite_and_no_load_needs_nothing() -> None:
    assert grip_needed_n([0.0], [0.0], [1.0], MU, (0, 0), 0.1, (0, 0), growth=0.3) == math.inf
    assert grip_needed_n(X, Y, LOADS, MU, (0, 0), 0.0, (0, 0), growth=0.3) == 0.0
    assert math.isnan(grip_needed_n(X, Y, LOADS, MU, (math.nan, 0), 0.0, (0, 0)))


@settings(max_examples=200, deadline=None)
@given(
    x=st.floats(-0.01, 0.01),
    y=st.floats(-0.01, 0.01),
    force=st.floats(0.1, 10.0),
    growth=st.floats(0.01, 1.0),
    fx=st.floats(-5, 5),
)
def test_one_taxel_has_no_size_that_could_grow(x, y, force, growth, fx) -> None:
    """Its centre is not quite where the taxel is, but for rounding: that must not look like a torque on a point."""
    needed = grip_needed_n([x], [y], [force], MU, (fx, 1.0), 0.0, (x, y), growth=growth)
    assert needed == pytest.approx(math.hypot(fx, 1.0) / MU, rel=1e-6)
