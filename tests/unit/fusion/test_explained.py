"""A fall of the load that follows the motion of the arm is no slip; one that does not is reported as without an arm."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, STD_N, line, readings, slips_at, watch

from slipd.fusion.levels import Uncertainty
from slipd.types.arrays import Array

RISE, HOLD = (2.0, 6.0, 800), 300
FALLEN = line(RISE, (6.0, 4.5, 12), (4.5, 4.5, HOLD))
SLOWLY = np.concatenate((line(RISE), 6.0 - 1.5 * (1.0 - np.exp(-np.arange(HOLD) / 30.0))))
GOES_ON = line(RISE, (6.0, 6.0, 12 + HOLD))
STAYS = np.full(800 + 12 + HOLD, 6.0)
LATE = np.concatenate((FALLEN[:1], np.repeat(FALLEN[:1], 49), FALLEN[:-50]))
LAG = 8
"""By so many ms the stream of the arm's motion lags."""
AFTER_A_GAP = np.where(np.arange(FALLEN.size) < 795, np.nan, FALLEN)


def slips(load: Array, felt: Array, turns_rad: Array | float = 0.0, mu: float = MU) -> list[int]:
    """Return where a slip begins, for a load and a gravity that is known for 2 ms; NaN: it is not sent."""
    rows, contact = readings(load, mu=mu), watch()
    along = np.column_stack((np.cos(turns_rad) * felt, np.sin(turns_rad) * felt))
    for k, gravity in enumerate(along):
        if not np.isnan(gravity).any():
            now = contact.state["conditions"]
            now["felt_mps2"], now["felt_s"], now["felt_lasts_s"] = gravity, rows["t_s"][k], 0.002
        contact.assess(rows[k : k + 1], mu, Uncertainty(STD_N))
    return slips_at(rows["assessment"])


@pytest.mark.parametrize("mu", [MU, np.nan])
@pytest.mark.parametrize(
    ("load", "felt", "turns_rad"),
    [
        (FALLEN, 2.0 * FALLEN, 0.0),
        (FALLEN, -2.0 * FALLEN, 0.0),  # neither its sign
        (FALLEN, 0.2 * FALLEN, 1.0),  # nor its unit and its axes matter
        (FALLEN, np.concatenate((np.repeat(FALLEN[:1], LAG), FALLEN[:-LAG])), 1.0),
        (SLOWLY, 2.0 * SLOWLY, 0.0),
    ],
)
def test_a_fall_that_follows_the_arm_is_no_slip(load: Array, felt: Array, turns_rad: float, mu: float) -> None:
    assert slips(load, felt, turns_rad, mu) == []


@pytest.mark.parametrize("load", [FALLEN, SLOWLY])
@pytest.mark.parametrize(
    ("felt", "turns_rad"),
    [
        (GOES_ON, 0.0),
        (STAYS, 0.0),
        (LATE, 0.0),
        (0.3 * FALLEN + 4.2, 0.0),  # it explains less than half
        (2.0 * FALLEN, np.linspace(0.0, 40.0, FALLEN.size)),  # it turns, and the load does not
        (0.0 * FALLEN, 0.0),
        (AFTER_A_GAP, 0.0),
        (np.full(FALLEN.size, np.nan), 0.0),
    ],
)
def test_any_other_fall_is_reported_as_without_an_arm(load: Array, felt: Array, turns_rad: Array | float) -> None:
    felt = felt[: load.size]
    turns_rad = turns_rad if isinstance(turns_rad, float) else turns_rad[: load.size]
    (at,) = slips(load, np.full(load.size, np.nan))
    assert slips(load, felt, turns_rad) == [at]
    assert 800 < at < 900
