"""Units of length and force change no digit of the friction limit; numbers beyond a double give no answer."""

from __future__ import annotations

import numpy as np
import pytest
from limit_contacts import MU, random_contact

from slipd.fusion import torque_limit, utilisation


def test_units_change_no_digit_but_for_their_rounding_which_powers_of_two_do_not_need() -> None:
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
    assert np.isnan((*limit[:3], *used[:3])).all()
