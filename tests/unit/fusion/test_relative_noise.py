"""The noise of a utilisation is that of solving it for noisy loads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.fusion import utilisation
from slipd.fusion.verdict_numbers import relative_noise

X, Y = (a.ravel() for a in np.meshgrid(np.arange(4) * 0.004 - 0.006, np.arange(3) * 0.004 - 0.004))
FORCE_STD, TORQUE_STD, MU = 0.02, 2e-4, 0.5


@pytest.mark.parametrize(("fx", "fy", "spin"), [(2.0, 0.0, 0.0), (0.5, -1.0, 0.008), (0.1, 0.0, 0.015)])
@pytest.mark.parametrize("about", [(0.0, 0.0), (0.003, -0.002)])
def test_noise_is_that_of_many_noisy_loads(fx: float, fy: float, spin: float, about: tuple[float, float]) -> None:
    loads = np.full(X.size, 10.0 / X.size)
    found = utilisation(X, Y, loads, MU, (fx, fy), spin, about)
    expected = relative_noise((fx, fy), spin, about, tuple(found.twist), FORCE_STD, TORQUE_STD)
    at_origin = spin + about[0] * fy - about[1] * fx
    rng, used = np.random.default_rng(8), []
    for _ in range(400):
        gx, gy = np.array((fx, fy)) + rng.normal(0.0, FORCE_STD, 2)
        torque = at_origin + rng.normal(0.0, TORQUE_STD)
        used.append(utilisation(X, Y, loads, MU, (gx, gy), torque, (0.0, 0.0)).value)
    assert np.std(used) / found.value == pytest.approx(expected, rel=0.15)


def test_without_a_motion_nothing_is_known() -> None:
    nan = math.nan
    assert relative_noise((0.0, 0.0), 0.0, (0.0, 0.0), (1.0, 0.0, 0.0), 0.02, 1e-3) == 0.0
    assert relative_noise((1.0, 0.0), 0.0, (0.0, 0.0), (nan, nan, nan), 0.02, 1e-3) == 0.0
