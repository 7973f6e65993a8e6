"""Friction that does not grow with what the arm asks for shows that the object turns; other loads do not."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, STD_N, assess, line, readings, slips_at, watch

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.types.arrays import Array

COUNT = 700
CARRIED = line((1.0, 5.5, 400), (5.5, 5.5, 300))
"""Force that would ask for the measured q if there were no spin: it stays at the limit of friction."""
LIFTS = line((9.81, 9.81, 400), (9.81, 15.0, 40), (15.0, 15.0, 260))
"""Apparent gravity of an arm that accelerates."""


def reported(load: Array, felt: Array, aside: Array | float = 0.0, mu: float = MU) -> list[int]:
    """Return where slips begin, for a load, N, and the apparent gravity that the arm reports, with its part aside."""
    rows, contact = readings(load, mu=mu), watch()
    for k, gravity in enumerate(np.column_stack((felt, aside * np.ones(COUNT)))):
        now = contact.row["conditions"]
        now["gravity_mps2"], now["gravity_s"], now["gravity_lasts_s"] = gravity, rows["t_s"][k], 0.002
        assess(contact, rows[k : k + 1], mu, WrenchUncertainty(STD_N))
    return slips_at(rows["assessment"])


def test_friction_that_does_not_grow_with_what_the_arm_asks_for_is_a_slip() -> None:
    (at,) = reported(CARRIED, LIFTS)
    assert 420 < at < 480


@pytest.mark.parametrize(
    ("load", "felt", "aside", "mu"),
    [
        (CARRIED, np.full(COUNT, 9.81), 0.0, MU),
        (CARRIED, np.full(COUNT, np.nan), 0.0, MU),
        (np.minimum(CARRIED, 3.5) / 9.81 * LIFTS, LIFTS, 0.0, MU),  # it takes up the whole load
        (CARRIED, LIFTS, line((0.0, 0.0, 400), (0.0, 20.0, 10), (20.0, 20.0, 290)), MU),  # the load turns
        (CARRIED, LIFTS, 0.0, 2.0 * MU),  # far from the limit
        (CARRIED, LIFTS, 0.0, np.nan),
        (line((1.0, 6.5, 300), (6.5, 5.5, 100), (5.5, 5.5, 300)), LIFTS, 0.0, 1.2 * MU),  # more was carried
    ],
)
def test_any_other_load_is_no_slip(load: Array, felt: Array, aside: Array | float, mu: float) -> None:
    assert reported(load, felt, aside, mu) == []
