"""An object that turns in the grip while the load grows is reported; one whose load turns is not."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, STD_N, assess, line, readings, slips_at, watch

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.types.arrays import Array

LIFT, GOES_ON, STAYS = (0.5, 3.0, 400), (3.0, 4.0, 60), (4.0, 4.0, 240)
COUNT, STILL = 700, np.full(700, 9.81)
GROWS = line(LIFT, GOES_ON, STAYS)
HELD = line((1.0, 6.0, 400), (6.0, 6.0, 300))
"""Force that would ask for the measured q if there were no spin: it stays at the limit of friction, 6 N."""
FOLLOWS = 2.0 * GROWS


def reported(
    force: Array, held: Array, *, felt: Array = STILL, aside: Array | float = 0.0, mu: float = MU
) -> list[int]:
    """Return where slips begin, for a force and its part aside, N, and the apparent gravity that the arm reports."""
    rows, contact = readings(force, aside=aside, mu=mu), watch()
    rows["utilisation"] = readings(held, mu=mu)["utilisation"]
    for k, gravity in enumerate(felt):
        now = contact.row["conditions"]
        now["gravity_mps2"], now["gravity_s"], now["gravity_lasts_s"] = (gravity, 0.0), rows["t_s"][k], 0.002
        assess(contact, rows[k : k + 1], mu, WrenchUncertainty(STD_N))
    return slips_at(rows["assessment"])


@pytest.mark.parametrize("felt", [STILL, np.full(COUNT, np.nan), GROWS])
def test_friction_that_does_not_grow_with_the_force_is_a_slip(felt: Array) -> None:
    (at,) = reported(GROWS, HELD, felt=felt)
    assert 420 < at < 480


def test_friction_that_does_not_grow_with_what_the_arm_asks_for_is_a_slip() -> None:
    force = line(LIFT, (3.0, 3.0, 300))
    assert reported(force, HELD) == []
    (at,) = reported(force, HELD, felt=line((10.0, 10.0, 400), (10.0, 16.0, 40), (16.0, 16.0, 260)))
    assert 420 < at < 500


@pytest.mark.parametrize(
    ("held", "how"),
    [
        (FOLLOWS * 0.75, {}),  # it takes up the whole load
        (HELD, {"aside": line((0.0, 0.0, 400), (0.0, 4.0, 60), (4.0, 4.0, 240))}),  # the load turns
        (HELD, {"mu": 2.0 * MU}),  # far from the limit
        (HELD, {"mu": np.nan}),
    ],
)
def test_any_other_load_is_no_slip(held: Array, how: dict[str, float]) -> None:
    assert reported(GROWS, held, **how) == []
