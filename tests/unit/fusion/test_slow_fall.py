"""A required friction that falls slowly is a slip where it slows down early or the load goes on, and else none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from load_course import MU, assessed, contact_rows
from load_course import slips_at as begins

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
    return begins(assessed(rows, mu, std_n=force_n))


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


def let_go(count: int) -> Array:
    """Return q of a load that is let go: it falls ever faster."""
    part = np.linspace(0.0, 1.0, count)
    down = 0.95 - 0.45 * part * part * (3.0 - 2.0 * part)
    return np.asarray(MU * np.concatenate([np.linspace(0.4, 0.95, RISE_N), down, np.full(PLATEAU_N, 0.5)]))


def push(held_ms: int, let_go_ms: int) -> Array:
    """Return q of a push that is held and let go within a tenth of a second."""
    up, down = np.linspace(0.0, np.pi, 120), np.linspace(0.0, np.pi, let_go_ms)
    parts = [0.5 - 0.5 * np.cos(up), np.full(held_ms, 1.0), 0.5 + 0.5 * np.cos(down), np.zeros(200)]
    return np.asarray(MU * (0.69 + 0.41 * np.concatenate([np.zeros(500), *parts])))


def swung_on() -> Array:
    """Return q of a weight that comes on and swings on the springs of the pads, beyond a mu stated too low."""
    t = np.arange(1000) * 1e-3
    on = 0.75 * np.clip(t / 0.15, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(t / 0.15, 0.0, 1.0))
    ring = -0.08 * np.exp(-6.0 * (t - 0.15)) * np.sin(2.0 * np.pi * 11.0 * (t - 0.15)) * (t > 0.15)
    return np.asarray(MU * np.concatenate([np.full(300, 0.02), 0.02 + on - ring]))


def aside() -> Array:
    return np.concatenate([np.full(RISE_N, 0.0), np.linspace(0.0, 3.0, FALL_N), np.full(PLATEAU_N, 3.0)])


T = np.arange(3000) * 1e-3
SUPPORTED = np.concatenate([np.linspace(0.4, 1.0, RISE_N) * MU, np.full(150, MU), fall(0.12)[RISE_N:]])
"""Somebody holds a pull for a moment and then supports the object a little."""
FAR_BELOW = np.concatenate([np.full(800, 0.9 * MU), np.linspace(0.9, 0.5, 300) * MU, 0.7 * fall(0.12)])
TIGHTENED = np.concatenate([np.full(RISE_N, 10.0), np.linspace(10.0, 11.4, FALL_N), np.full(PLATEAU_N, 11.4)])


@pytest.mark.parametrize(
    ("q", "more"),
    [
        *[(let_go(count), {"mu": part * MU}) for count in (50, 90, 150) for part in (1.0, 0.8, 1.2)],
        (SUPPORTED, {}),
        *[
            (push(*ms), {"mu": part * MU, "seed": seed})
            for ms in ((60, 60), (50, 50), (60, 50)) for part in (0.9, 1.0) for seed in range(3)
        ],
        *[(swung_on(), {"mu": part * MU}) for part in (0.8, 0.9, 1.0)],
        # a load along another direction, a tightened grip, and what is far below what the grasp carried
        (fall(0.12), {"shear_n": np.full(COUNT, 4.0), "aside_n": aside()}),
        (fall(0.12), {"shear_n": GROWING, "normal_n": TIGHTENED}),
        (FAR_BELOW, {"shear_n": np.linspace(1.0, 4.0, len(FAR_BELOW))}),
        # a swing near the limit
        *[
            (
                MU * (0.8 + 0.1 * np.sin(2.0 * np.pi * hz * T)),
                {"shear_n": 3.0 + 0.5 * np.sin(2.0 * np.pi * 0.37 * hz * T)},
            )
            for hz in (1.5, 4.0, 9.0)
        ],
    ],
)  # fmt: skip
def test_a_fall_for_another_reason_is_none(q: Array, more: dict[str, Any]) -> None:
    assert slips_at(q, **{"shear_n": 10.0 * q, "normal_n": np.full(len(q), 10.0)} | more) == []


def test_noise_alone_in_ten_minutes_of_a_hold_is_none() -> None:
    """One false alarm an hour is the risk: two in ten minutes have a chance of 1 in 80."""
    n = 600_000
    assert len(slips_at(np.full(n, 0.9 * MU), np.full(n, 3.0), np.full(n, 10.0))) <= 1
