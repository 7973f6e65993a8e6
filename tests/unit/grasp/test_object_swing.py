"""A swing on soft pads: the exact damped oscillator beside a rigid grip, and its frequency, learned from the spin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain_kernels import run_without_compilation
from scipy.signal import lsim

from slipd.grasp import object_swing
from slipd.grasp.object_swing import DAMPING, SwingEstimate

OMEGA = 2.0 * math.pi * 5.0
UNEVEN_S = np.concatenate(([0.0], np.cumsum(np.random.default_rng(1).uniform(0.001, 0.03, 80))))


@pytest.fixture(autouse=True)
def plain_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    run_without_compilation(monkeypatch, object_swing)


def excess(rigid: np.ndarray, times_s: np.ndarray = UNEVEN_S, earlier: float = 0.0) -> np.ndarray:
    out = np.empty((2, rigid.size))
    object_swing.swing_excess(times_s, rigid, OMEGA, earlier, out)
    return out[1] if earlier == 0.0 else out[0]


def test_it_is_the_damped_oscillator_under_a_load_that_is_linear_between_the_points() -> None:
    rigid = np.sin(20.0 * UNEVEN_S) + 0.3
    even_s = np.linspace(0.0, UNEVEN_S[-1], 20001)
    system = ([OMEGA**2], [1.0, 2.0 * DAMPING * OMEGA, OMEGA**2])
    load = np.interp(even_s, UNEVEN_S, rigid)
    _, spin, _ = lsim(system, load - load[0], even_s)
    wanted = np.interp(UNEVEN_S, even_s, spin) + load[0] - rigid
    assert excess(rigid)[:-1] == pytest.approx(wanted[:-1], abs=2e-3)


@pytest.mark.parametrize("build_s", [0.05, 0.1, 0.3, 0.7])
def test_a_ramp_is_overshot_by_the_sinc_of_its_time_in_periods(build_s: float) -> None:
    times_s = np.arange(0.0, build_s + 0.3, 0.001)
    beyond = excess(np.minimum(times_s / build_s, 1.0), times_s)[times_s >= build_s].max()
    assert beyond == pytest.approx(abs(np.sinc(5.0 * build_s)), abs=0.1)


def test_the_object_swings_on_after_the_last_point() -> None:
    times_s = np.linspace(0.0, 0.05, 21)
    ended = excess(-times_s / 0.05, times_s)
    assert ended[-1] == pytest.approx(-abs(np.sinc(5.0 * 0.05)), abs=0.1)
    assert ended[-2] > 0.0  # it lags at first


def test_a_swing_from_before_fades_and_adds_as_squares_in_the_direction_of_the_spin() -> None:
    still = excess(np.full(UNEVEN_S.size, -1.0), earlier=0.2)
    assert still == pytest.approx(-0.2 * np.exp(-DAMPING * OMEGA * UNEVEN_S))
    jump = excess(np.where(UNEVEN_S > 0.0, 1.0, 0.0), earlier=0.2)
    assert jump[1] == pytest.approx(math.sqrt(1.04) - 1.0, abs=0.01)


PERIOD_NS = 20_000_000
TIMES_S = np.arange(0.0, 1.2, PERIOD_NS * 1e-9)
LIFT = 0.03 * (1.0 + 0.2 * np.sin(2.0 * math.pi * np.minimum(TIMES_S, 0.3) / 0.3))


def learned(hz: float, noise_nm: float = 0.0, swing: float = 1.0, gap_every: int = 1000, seed: int = 0) -> float | None:
    """Return the frequency after a lift in 0.3 s, Hz."""
    estimate, beyond = SwingEstimate(), np.empty((2, TIMES_S.size))
    object_swing.swing_excess(TIMES_S, LIFT, 2.0 * math.pi * hz, 0.0, beyond)
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
