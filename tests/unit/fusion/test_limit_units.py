"""Units of length and force change no digit of the friction limit; numbers beyond a double give no answer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from limit_contacts import MU, gyration, random_contact

from slipd.fusion import torque_limit, utilisation


@pytest.mark.parametrize(
    ("length", "force"), [(1e-3, 1.0), (1e3, 1.0), (1.0, 1e-6), (1.0, 1e6), (1e-3, 1e6), (1e3, 1e-6)]
)
def test_units_change_no_digit_beyond_rounding(length: float, force: float) -> None:
    for seed in range(300):
        x, y, loads, f, spin = random_contact(seed)
        centre = np.array((loads @ x / loads.sum(), loads @ y / loads.sum()))
        scale = MU * loads.sum() * gyration(x, y, loads)
        plain = torque_limit(x, y, loads, MU, f, centre)
        other = torque_limit(length * x, length * y, force * loads, MU, force * f, length * centre)
        # What rounding the scaled inputs changes: 1 − ρ by some 1e-16, which a far pole magnifies.
        missing = max(1.0 - np.hypot(*f) / (MU * loads.sum()), 1e-16)
        allowed = scale * (1e-12 + 1e-15 / math.sqrt(missing)) + 1e-15 * np.hypot(*centre) * np.hypot(*f)
        assert other.torque_nm / (length * force) == pytest.approx(plain.torque_nm, abs=allowed), seed
        m = spin * scale
        used = utilisation(x, y, loads, MU, f, m, centre)
        there = utilisation(length * x, length * y, force * loads, MU, force * f, force * length * m, length * centre)
        assert there.value == pytest.approx(used.value, rel=1e-10), seed
        assert (there.value >= 1.0) == (used.value >= 1.0)


def test_powers_of_two_change_no_digit_at_all() -> None:
    for seed in range(200):
        x, y, loads, f, spin = random_contact(seed)
        plain = utilisation(x, y, loads, MU, f, spin, (0.01, 0.0))
        other = utilisation(x * 1024.0, y * 1024.0, loads / 64.0, MU, f / 64.0, spin * 16.0, (10.24, 0.0))
        assert (other.value, other.lower, other.upper) == (plain.value, plain.lower, plain.upper)


def test_the_twist_turns_about_the_pole_and_gives_the_power() -> None:
    for seed in range(100):
        x, y, loads, f, spin = random_contact(seed)
        about = (0.02, -0.01)
        used = utilisation(x, y, loads, MU, f, spin * 0.01, about)
        if used.pole_m is None:
            continue
        vx, vy, turn = used.twist
        pole = np.array(about) + np.array((-vy, vx)) / turn
        assert pole == pytest.approx(used.pole_m, abs=1e-9)
        slides = np.hypot(vx - turn * (y - about[1]), vy + turn * (x - about[0]))
        power = f[0] * vx + f[1] * vy + spin * 0.01 * turn
        assert power / (MU * loads @ slides) == pytest.approx(used.value, rel=1e-9)


@pytest.mark.parametrize(("length", "force"), [(1e-160, 1.0), (1e160, 1.0), (1.0, 1e-300), (1.0, 1e300), (1.0, 5e-324)])
def test_numbers_whose_squares_a_double_cannot_hold_are_no_answer_rather_than_a_wrong_one(length, force) -> None:
    x, y, loads = np.array((0.0, 1.0, 0.3)), np.array((0.0, 0.2, 0.7)), np.array((1.0, 2.0, 3.0))
    limit = torque_limit(length * x, length * y, force * loads, MU, (0.0, force), (0.0, 0.0))
    used = utilisation(length * x, length * y, force * loads, MU, (0.0, force), length * force, (0.0, 0.0))
    assert (limit.kind, used.kind) == ("none", "none")
    assert math.isnan(limit.torque_nm)
    assert math.isnan(limit.upper_nm)
    assert math.isnan(used.upper)
