"""A fall of the load that follows the motion of the arm is no slip; one that does not is reported as without an arm."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, STD_N, assess, line, readings, slips_at, watch

from slipd.fusion.contact_state import WrenchUncertainty
from slipd.types.arrays import Array

RISE, HOLD = (2.0, 6.0, 800), 300
FALLEN = line(RISE, (6.0, 4.5, 12), (4.5, 4.5, HOLD))
SLOWLY = np.concatenate((line(RISE), 6.0 - 1.5 * (1.0 - np.exp(-np.arange(HOLD) / 30.0))))
GOES_ON = line(RISE, (6.0, 6.0, 12 + HOLD))
STAYS = np.full(800 + 12 + HOLD, 6.0)
LATE = np.concatenate((FALLEN[:1], np.repeat(FALLEN[:1], 49), FALLEN[:-50]))
LAG = 7
"""By so many ms the stream of the arm's motion lags."""
AFTER_A_GAP = np.where(np.arange(FALLEN.size) < 799, np.nan, FALLEN)


def slips(
    load: Array,
    felt: Array,
    turns_rad: Array | float = 0.0,
    mu: float = MU,
    *,
    spun: Array | None = None,
    turn_radps: Array | None = None,
) -> list[int]:
    """Return where a slip begins, for a load and a gravity that is known for 2 ms; NaN: it is not sent.

    With spin, q is that of ``spun`` N; the arm turns about the normal of the pad at ``turn_radps``.
    """
    rows, contact = readings(load, mu=mu), watch()
    if spun is not None:
        rows["utilisation"] = readings(spun, mu=mu)["utilisation"]
    along = np.column_stack((np.cos(turns_rad) * felt, np.sin(turns_rad) * felt))
    for k, gravity in enumerate(along):
        now = contact.row["conditions"]
        if not np.isnan(gravity).any():
            now["gravity_mps2"], now["gravity_s"], now["gravity_lasts_s"] = gravity, rows["t_s"][k], 0.002
        if turn_radps is not None:
            now["turn_radps"] = turn_radps[k]
        assess(contact, rows[k : k + 1], mu, WrenchUncertainty(STD_N))
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


def stepped(before: float, after: float, at: int, count: int, within: int = 10) -> Array:
    """Return a course that changes once, at a reading."""
    return line((before, before, at), (before, after, within), (after, after, count - at - within))


PUSHED = stepped(5.5, 6.0, 740, FALLEN.size)


@pytest.mark.parametrize("spun", [FALLEN, SLOWLY])
@pytest.mark.parametrize(
    ("load", "felt", "turn_radps", "swings"),
    [
        (PUSHED, 2.0 * PUSHED, 0.0, True),
        (STAYS, STAYS, stepped(1.0, 0.8, 760, FALLEN.size), True),
        (STAYS, STAYS, stepped(1.0, 0.95, 760, FALLEN.size), False),  # not enough
        (STAYS, STAYS, stepped(1.0, 0.8, 650, FALLEN.size), False),  # long ago
        (STAYS, STAYS, 1.0, False),
        (FALLEN, STAYS, stepped(1.0, 0.8, 760, FALLEN.size), False),  # the force gives way, too
    ],
)
def test_a_fall_of_the_spin_alone_is_a_swing_if_the_arm_just_moved(
    load: Array, felt: Array, turn_radps: Array | float, swings: bool, spun: Array
) -> None:
    load, felt, turns = load[: spun.size], felt[: spun.size], (turn_radps * np.ones(FALLEN.size))[: spun.size]
    (at,) = slips(load, np.full(load.size, np.nan), spun=spun)
    assert slips(load, felt, spun=spun, turn_radps=turns) == ([] if swings else [at])


JUMP = line((2.0, 2.0, 500), (2.0, 5.5, 5), (5.5, 5.5, 300))
OVERSHOT = line((2.5, 2.5, 500), (2.5, 5.0, 6), (5.0, 4.5, 4), (4.5, 4.5, 300))
LIFTED = line((0.1, 0.1, 500), (0.1, 5.5, 20), (5.5, 5.5, 300))
STILL = np.full(OVERSHOT.size, 9.81)


@pytest.mark.parametrize(
    ("load", "felt", "explained"),
    [
        (JUMP, 2.0 * JUMP, True),
        (JUMP, 2.0 * JUMP**1.3, False),  # friction does not carry what the arm asks for
        (JUMP, STILL, False),
        (OVERSHOT, stepped(10.0, 18.0, 500, OVERSHOT.size, 6), True),
        (OVERSHOT, stepped(10.0, 18.0, 504, OVERSHOT.size, 6), True),  # its stream lags
        (OVERSHOT, stepped(10.0, 25.0, 500, OVERSHOT.size, 6), False),
        (OVERSHOT, STILL, False),
        (OVERSHOT, np.where(np.arange(OVERSHOT.size) < 450, np.nan, 5.0 * OVERSHOT), False),
        (LIFTED, stepped(10.0, 15.0, 505, LIFTED.size, 15), True),
        (LIFTED, np.full(LIFTED.size, 9.81), False),
    ],
)
def test_a_jump_that_the_arm_makes_is_no_slip(load: Array, felt: Array, explained: bool) -> None:
    felt = felt[: load.size]
    (at,) = slips(load, np.full(load.size, np.nan))
    assert slips(load, felt) == ([] if explained else [at])


@pytest.mark.parametrize(("turn_radps", "made"), [(0.5, True), (0.05, False)])
def test_a_jump_while_the_turn_of_the_arm_changes_is_no_slip(turn_radps: float, made: bool) -> None:
    found = slips(JUMP, STILL[: JUMP.size], turn_radps=stepped(0.0, turn_radps, 500, JUMP.size))
    assert bool(found) is not made
