"""Friction that does not grow with what the arm asks for shows that the object turns; other loads do not."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, STD_N, assess, line, readings, slips_at, watch

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.types.arrays import Array

COUNT = 700
LIMITED = line((1.0, 5.5, 400), (5.5, 5.5, 300))
"""Force that would ask for the measured q if there were no spin: it stays at the limit of friction."""
STANDS = np.full(COUNT, 9.81)
LIFTS = line((9.81, 9.81, 400), (9.81, 15.0, 40), (15.0, 15.0, 260))
"""Apparent gravity of an arm that accelerates."""
TURNS = line((0.0, 0.0, 400), (0.0, 20.0, 10), (20.0, 20.0, 290))


def reported(
    used: Array, felt: Array = LIFTS, force: Array = LIFTS, aside: Array | float = 0.0, mu: float = MU
) -> list[int]:
    """Return where slips begin.

    Args:
        used: Force that would ask for the measured q without spin, N.
        felt: Apparent gravity that the arm reports, m/s².
        force: Apparent gravity of which the measured force is 0.2 times as much.
        aside: Part of ``felt`` across its direction.
        mu: Coefficient of friction that is known.
    """
    rows, contact = readings(0.2 * force, mu=mu), watch()
    rows["utilisation"] = readings(used, mu=mu)["utilisation"]
    for k, gravity in enumerate(np.column_stack((felt, aside * np.ones(COUNT)))):
        now = contact.row["conditions"]
        now["gravity_mps2"], now["gravity_s"], now["gravity_lasts_s"] = gravity, rows["t_s"][k], 0.002
        assess(contact, rows[k : k + 1], mu, WrenchUncertainty(STD_N))
    return slips_at(rows["assessment"])


@pytest.mark.parametrize("force", [LIFTS, STANDS])
def test_friction_that_does_not_grow_with_what_the_arm_asks_for_is_a_slip(force: Array) -> None:
    (at,) = reported(LIMITED, force=force)
    assert 420 < at < 520


@pytest.mark.parametrize(
    ("used", "how"),
    [
        (LIMITED, {"felt": STANDS}),  # something else pulls
        (LIMITED, {"felt": np.full(COUNT, np.nan)}),
        (np.minimum(LIMITED, 3.6) / 9.81 * LIFTS, {}),  # it takes up the whole load
        (LIMITED, {"aside": TURNS}),
        (LIMITED, {"mu": 2.0 * MU}),  # far from the limit
        (LIMITED, {"mu": np.nan}),
        (line((1.0, 6.5, 300), (6.5, 5.5, 100), (5.5, 5.5, 300)), {"mu": 1.2 * MU}),  # more was carried
    ],
)
def test_any_other_load_is_no_slip(used: Array, how: dict[str, Array]) -> None:
    assert reported(used, **how) == []
