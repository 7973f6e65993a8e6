"""The frequency of a swing, learned from the spin of both pads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.fusion.object_swing import swing_excess
from slipd.grasp.swing_estimate import SwingEstimate

PERIOD_NS = 20_000_000
TIMES_S = np.arange(0.0, 1.2, PERIOD_NS * 1e-9)
LIFT = 0.03 * (1.0 + 0.2 * np.sin(2.0 * math.pi * np.minimum(TIMES_S, 0.3) / 0.3))


def learned(hz: float, noise_nm: float = 0.0, swing: float = 1.0, gap_every: int = 1000, seed: int = 0) -> float | None:
    """Return the frequency after a lift in 0.3 s, Hz."""
    estimate, beyond = SwingEstimate(), np.empty((2, TIMES_S.size))
    swing_excess(TIMES_S, LIFT, 2.0 * math.pi * hz, 0.0, beyond)
    noise = np.random.default_rng(seed).normal(0.0, noise_nm, TIMES_S.size)
    for k, rigid_nm in enumerate(LIFT):
        t_ns = 10**9 + k * PERIOD_NS + k // gap_every * 10**8
        estimate.update(t_ns, rigid_nm + swing * beyond[1, k] + 0.004 + noise[k], rigid_nm)
    found = estimate.swing()
    return None if found is None else found.rate_radps / (2.0 * math.pi)


@pytest.mark.parametrize("hz", [4.0, 5.0, 8.0])
def test_a_swing_in_the_lift_shows_its_frequency_beside_an_offset_and_noise(hz: float) -> None:
    assert learned(hz, noise_nm=2e-4) == pytest.approx(hz, rel=0.08)


@pytest.mark.parametrize("seed", range(10))
def test_noise_shows_no_swing(seed: int) -> None:
    assert learned(5.0, noise_nm=5e-4, swing=0.0, seed=seed) is None


def test_readings_with_gaps_show_none_within_two_periods() -> None:
    assert learned(5.0, gap_every=12) is None
