"""A required friction that falls slowly is a slip where it slows down early or the load goes on, and else none."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, contact_rows

from slipd.config import Levels, Slip
from slipd.fusion.levels import ContactWatch, Uncertainty
from slipd.types.arrays import Array

RISE_N, FALL_N, PLATEAU_N = 1000, 90, 200
COUNT = RISE_N + FALL_N + PLATEAU_N
STD = 0.002


def fall(share: float) -> Array:
    """Return q that rises to μ within a second, falls by a share of it within 90 ms, and stays."""
    part = np.linspace(0.0, 1.0, FALL_N)
    down = 1.0 - share * (1.0 - (1.0 - part) ** 2)
    return np.asarray(MU * np.concatenate([np.linspace(0.4, 1.0, RISE_N), down, np.full(PLATEAU_N, 1.0 - share)]))


def slips_at(
    q: Array,
    shear_n: Array,
    normal_n: Array,
    *,
    aside_n: Array | None = None,
    mu: float = MU,
    hz: float = 1000.0,
    seed: int = 0,
) -> list[int]:
    """Return the readings at which a slip begins, for a course of q, tangential force and normal force with noise."""
    rng, n = np.random.default_rng(seed), len(q)
    used = (q + rng.normal(0.0, STD, n)) / (1.0 if np.isnan(mu) else mu)
    force_n = STD * 10.0
    pulled, pressed = shear_n + rng.normal(0.0, force_n, n), normal_n + rng.normal(0.0, force_n, n)
    rows = contact_rows(
        n, pulled, pressed, used, 100.0 + np.arange(n) / hz, aside_n=np.zeros(n) if aside_n is None else aside_n
    )
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    watch.assess(rows, mu, Uncertainty(force_n), 0.0)
    slips = rows["assessment"]["slips"]
    return (np.flatnonzero(slips & ~np.concatenate(([False], slips[:-1])))).tolist()


CONSTANT = np.full(COUNT, 10.0)
GROWING = np.linspace(1.0, 4.0, COUNT)


@pytest.mark.parametrize("share", [0.06, 0.12, 0.3])
@pytest.mark.parametrize("mu", [MU, 0.8 * MU, 1.2 * MU, float("nan")])
def test_a_rotation_that_breaks_away_while_the_shear_grows_is_a_slip(share: float, mu: float) -> None:
    found = slips_at(fall(share), GROWING, CONSTANT, mu=mu)
    assert found
    assert RISE_N < found[0] <= RISE_N + FALL_N + 60


def test_a_grip_that_loosens_on_is_a_slip() -> None:
    found = slips_at(fall(0.1), np.full(COUNT, 2.0), np.linspace(10.0, 6.0, COUNT))
    assert found
    assert found[0] > RISE_N


@pytest.mark.parametrize("mu", [MU, 0.8 * MU, 1.2 * MU])
@pytest.mark.parametrize("let_go_n", [50, 90, 150])
def test_a_load_that_is_let_go_falls_ever_faster_and_is_none(let_go_n: int, mu: float) -> None:
    part = np.linspace(0.0, 1.0, let_go_n)
    down = 0.95 - 0.45 * part * part * (3.0 - 2.0 * part)
    q = MU * np.concatenate([np.linspace(0.4, 0.95, RISE_N), down, np.full(PLATEAU_N, 0.5)])
    assert slips_at(q, 10.0 * q, np.full(len(q), 10.0), mu=mu) == []


def test_a_fall_that_began_long_after_the_rise_is_none() -> None:
    """Somebody holds a pull for a moment and then supports the object a little."""
    q = np.concatenate([np.linspace(0.4, 1.0, RISE_N) * MU, np.full(150, MU), fall(0.12)[RISE_N:]])
    assert slips_at(q, 10.0 * q, np.full(len(q), 10.0), mu=MU) == []


@pytest.mark.parametrize("mu", [0.9 * MU, MU])
@pytest.mark.parametrize(("held_ms", "let_go_ms"), [(60, 60), (50, 50), (60, 50)])
def test_a_push_that_is_held_and_let_go_within_a_tenth_of_a_second_is_none(
    held_ms: int, let_go_ms: int, mu: float
) -> None:
    up, down = np.linspace(0.0, np.pi, 120), np.linspace(0.0, np.pi, let_go_ms)
    push = [0.5 - 0.5 * np.cos(up), np.full(held_ms, 1.0), 0.5 + 0.5 * np.cos(down), np.zeros(200)]
    q = MU * (0.69 + 0.41 * np.concatenate([np.zeros(500), *push]))
    assert [slips_at(q, 10.0 * q, np.full(len(q), 10.0), mu=mu, seed=seed) for seed in range(3)] == [[]] * 3


def test_a_fall_of_a_load_along_another_direction_is_none() -> None:
    q, n = fall(0.12), len(fall(0.12))
    aside = np.concatenate([np.full(RISE_N, 0.0), np.linspace(0.0, 3.0, FALL_N), np.full(PLATEAU_N, 3.0)])
    assert slips_at(q, np.full(n, 4.0), CONSTANT, aside_n=aside) == []


def test_the_same_fall_by_a_tightened_grip_is_none() -> None:
    normal = np.concatenate([np.full(RISE_N, 10.0), np.linspace(10.0, 11.4, FALL_N), np.full(PLATEAU_N, 11.4)])
    assert slips_at(fall(0.12), GROWING, normal) == []


def test_a_fall_far_below_what_the_grasp_carried_is_none() -> None:
    q = np.concatenate([np.full(800, 0.9 * MU), np.linspace(0.9, 0.5, 300) * MU, 0.7 * fall(0.12)])
    more = np.linspace(1.0, 4.0, len(q))
    assert slips_at(q, more, np.full(len(q), 10.0)) == []


@pytest.mark.parametrize("mu", [0.8 * MU, 0.9 * MU, MU])
def test_a_weight_that_comes_on_and_swings_on_the_springs_of_the_pads_is_none(mu: float) -> None:
    """Its crest is beyond a coefficient of friction that is stated too low."""
    t = np.arange(1000) * 1e-3
    on = 0.75 * np.clip(t / 0.15, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(t / 0.15, 0.0, 1.0))
    ring = -0.08 * np.exp(-6.0 * (t - 0.15)) * np.sin(2.0 * np.pi * 11.0 * (t - 0.15)) * (t > 0.15)
    q = MU * np.concatenate([np.full(300, 0.02), 0.02 + on - ring])
    assert slips_at(q, 10.0 * q, np.full(len(q), 10.0), mu=mu) == []


def test_a_swing_near_the_limit_is_none() -> None:
    t = np.arange(3000) * 1e-3
    for hz in (1.5, 4.0, 9.0):
        q = MU * (0.8 + 0.1 * np.sin(2.0 * np.pi * hz * t))
        shear = 3.0 + 0.5 * np.sin(2.0 * np.pi * 0.37 * hz * t)
        assert slips_at(q, shear, np.full(len(t), 10.0)) == []


def test_noise_alone_in_ten_minutes_of_a_hold_is_none() -> None:
    """One false alarm an hour is the risk: two in ten minutes have a chance of 1 in 80."""
    n = 600_000
    assert len(slips_at(np.full(n, 0.9 * MU), np.full(n, 3.0), np.full(n, 10.0))) <= 1
