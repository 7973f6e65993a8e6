"""The taxels of a charge pad together: slipd distinguishes warmth and faulty taxels from a long hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from slipd.signals import charge_reconstruction as charge_module
from slipd.signals.charge_reconstruction import ANCHOR_TAU_S, LOADED_SHARE, ChargeReconstruction
from slipd.tools.sim.scene_parts import Pad, Patch

TAU_S = 2.0
STEP_S = 0.005

FREE, HELD = True, False
PLAIN = getattr(charge_module._integrate, "py_func", charge_module._integrate)

SHARES = Pad().shares(Patch())
SLOW_STEP_S = 0.05
WARM_COUNTS = 1000.0
"""What warming adds to each taxel in ten minutes: some tenths of a kelvin, and twice the largest reading."""


def amplifiers(counts: np.ndarray, *, noise: float = 1.0) -> np.ndarray:
    """What the amplifiers of a pad give for the charge of each taxel, shape (scans, taxels), every ``SLOW_STEP_S``."""
    rng = np.random.default_rng(0)
    decay = math.exp(-SLOW_STEP_S / TAU_S)
    steps = np.diff(counts, axis=0, prepend=counts[:1]) * (TAU_S / SLOW_STEP_S * (1.0 - decay))
    y = lfilter((1.0,), (1.0, -decay), steps, axis=0)
    offset = 20.0 * rng.normal(size=counts.shape[1])
    return np.rint(y + offset + noise * rng.normal(size=y.shape)) if noise else y + offset


def held(counts: np.ndarray, force_n: np.ndarray, *, anchored: bool = False, noise: float = 1.0) -> np.ndarray:
    """The last image that is made of a course of charges, in counts."""
    charge = ChargeReconstruction(counts.shape[1], TAU_S)
    for k, readings in enumerate(amplifiers(counts, noise=noise)):
        if anchored:
            charge.anchor(2000.0 * float(force_n[k]) * float(SHARES.sum()))
        told = charge.update(readings, k * SLOW_STEP_S, bool(force_n[k] <= 0.0))
    return told


def ten_minutes(warm_counts: float, where: np.ndarray | float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Charges and force of 10 N held for ten minutes on a pad that warms, after five seconds of rest."""
    t_s = np.arange(0.0, 605.0, SLOW_STEP_S)
    force_n = 10.0 * np.clip((t_s - 5.0) / 0.3, 0.0, 1.0)
    warmth = warm_counts * np.clip((t_s - 5.0) / 600.0, 0.0, 1.0)
    return 2000.0 * force_n[:, None] * SHARES + warmth[:, None] * where, force_n


def misplaced(image: np.ndarray) -> float:
    """Share of the load that an image puts on the wrong taxels."""
    active = np.where(image > 10.0, image, 0.0)
    return float(0.5 * np.abs(active / active.sum() - SHARES / SHARES.sum()).sum())


@pytest.mark.no_cover
def test_T4_a_hold_of_ten_minutes_on_a_warming_pad_keeps_its_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of the load is misplaced: what noise made of each offset adds up. Uncorrected, it is near half."""
    counts, force_n = ten_minutes(WARM_COUNTS)
    assert misplaced(held(counts, force_n)) < 0.15
    assert misplaced(held(counts, force_n, anchored=True)) < 0.15
    monkeypatch.setattr(charge_module, "UNLOADED_TAXELS", 1000)
    monkeypatch.setattr(charge_module, "_integrate", PLAIN)
    assert misplaced(held(counts, force_n)) > 0.4


@pytest.mark.no_cover
def test_T4_warmth_of_the_object_alone_is_taken_from_the_sum_by_the_force_sensor() -> None:
    counts, force_n = ten_minutes(WARM_COUNTS, np.where(SHARES > 0.0, 1.0, 0.0))
    force_counts = 20_000.0 * SHARES.sum()
    assert held(counts, force_n).sum() > 1.5 * force_counts
    anchored = held(counts, force_n, anchored=True)
    assert anchored.sum() == pytest.approx(force_counts, rel=0.05)
    assert misplaced(anchored) < 0.15


def test_T4_a_load_held_for_ten_minutes_is_never_erased() -> None:
    counts, force_n = ten_minutes(0.0)
    for anchored in (False, True):
        told = held(counts, force_n, anchored=anchored, noise=0.0)
        loaded = SHARES / SHARES.max() > LOADED_SHARE
        assert_allclose(told[loaded], 20_000.0 * SHARES[loaded], rtol=0.01)
        assert (told[~loaded] <= 20_000.0 * SHARES[~loaded] + 1.0).all()


def test_T1_hot_taxels_do_not_make_the_others_look_unloaded() -> None:
    t_s = np.arange(0.0, 20.0, SLOW_STEP_S)
    force_n = 10.0 * np.clip((t_s - 2.0) / 0.3, 0.0, 1.0)
    counts = 2000.0 * force_n[:, None] * SHARES
    counts[t_s > 5.0, 60:62] += 30_000.0
    told = held(counts, force_n, noise=0.0)
    loaded = SHARES / SHARES.max() > LOADED_SHARE
    loaded[60:62] = False
    assert_allclose(told[loaded], 20_000.0 * SHARES[loaded], rtol=0.02)


def test_a_contact_of_one_taxel_is_measured() -> None:
    t_s = np.arange(0.0, 60.0, SLOW_STEP_S)
    force_n = 5.0 * np.clip((t_s - 2.0) / 0.3, 0.0, 1.0)
    counts = np.zeros((t_s.size, 128))
    counts[:, 40] = 2000.0 * force_n
    assert held(counts, force_n)[40] == pytest.approx(10_000.0, rel=0.02)


@pytest.mark.parametrize("takes_s", [0.5, 20.0])
def test_T4_a_contact_that_moves_on_while_it_is_held_is_followed(takes_s: float) -> None:
    """Most of the taxels that it comes to were outside it before."""
    t_s = np.arange(0.0, 60.0, SLOW_STEP_S)
    force_n = 10.0 * np.clip((t_s - 2.0) / 0.3, 0.0, 1.0)
    moved = np.clip((t_s - 10.0) / takes_s, 0.0, 1.0)[:, None]
    after = Pad().shares(Patch(0.026, 0.010, 4.0, (0.0, 0.0)))
    counts = 2000.0 * force_n[:, None] * ((1.0 - moved) * SHARES + moved * after)
    assert_allclose(held(counts, force_n, noise=0.0), 20_000.0 * after, atol=0.05 * 20_000.0 * after.max())


def test_T4_a_contact_on_the_whole_pad_leaves_no_taxel_to_tell_the_warmth() -> None:
    t_s = np.arange(0.0, 60.0, SLOW_STEP_S)
    force_n = 10.0 * np.clip((t_s - 2.0) / 0.3, 0.0, 1.0)
    counts = force_n[:, None] * np.linspace(50.0, 100.0, 64)
    assert_allclose(held(counts, force_n, noise=0.0), counts[-1], rtol=0.01)


def test_T4_the_force_sensor_is_followed_slowly_and_evenly_over_the_contact() -> None:
    """A bias of the force sensor passes to the pad slowly, and is reported first; drift adds to all taxels alike."""
    charge = ChargeReconstruction(2, 1000.0)
    charge.update(np.zeros(2), 0.0, FREE)
    for k in range(1, 101):
        charge.anchor(360.0)
        told = charge.update(np.array((100.0, 200.0)), 0.05 * k, HELD)
    short = (300.0 - 360.0) * math.exp(-4.95 / ANCHOR_TAU_S)
    assert told.sum() == pytest.approx(360.0 + short, abs=3.0)
    assert told[1] - told[0] == pytest.approx(100.0, abs=1.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_N1_a_force_that_is_no_number_moves_nothing(bad: float) -> None:
    charge = ChargeReconstruction(2, 1000.0)
    charge.update(np.zeros(2), 0.0, FREE)
    for k in range(1, 50):
        charge.anchor(bad)
        told = charge.update(np.array((100.0, 200.0)), 0.05 * k, HELD)
    assert_allclose(told, (100.0, 200.0), rtol=0.01)


def test_a_contact_that_pulls_has_no_loaded_taxel() -> None:
    charge = ChargeReconstruction(16, TAU_S)
    charge.update(np.zeros(16), 0.0, FREE)
    charge.anchor(5.0)
    assert_allclose(charge.update(np.full(16, -5.0), STEP_S, HELD), -5.0, atol=0.1)


@pytest.mark.parametrize("anchor", [math.nan, 7.0])
@pytest.mark.parametrize("loaded", [0, 40, 128])
def test_the_kernel_does_what_it_does_without_compilation(loaded: int, anchor: float) -> None:
    rng = np.random.default_rng(loaded)
    readings, offset = rng.normal(0.0, 0.01, 128), rng.normal(0.0, 0.01, 128)
    readings[:loaded] += 5.0
    made = []
    for kernel in (charge_module._integrate, PLAIN):
        told, integral, last = np.empty(128), np.linspace(0.0, 0.1, 128), np.linspace(0.0, 1.0, 128)
        common = kernel(told, integral, last, readings, offset, 0.002, 2.0, 0.03, anchor)
        made.append((told, integral, last, common))
    for compiled, plain in zip(*made, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-14, atol=1e-15)
