"""A charge pad measures a held force although its charge leaks away."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

from slipd.signals import charge_reconstruction as charge_module
from slipd.signals.charge_reconstruction import ANCHOR_TAU_S, LOADED_SHARE, OFFSET_TAU_S, ChargeReconstruction
from slipd.sim.true_contact import Pad, Patch

TAU_S = 2.0
STEP_S = 0.005
OFFSET = 37.0
FREE, HELD = True, False
PLAIN = getattr(charge_module._integrate, "py_func", charge_module._integrate)


def amplifier(force: np.ndarray, tau_s: float = TAU_S, offset: float = OFFSET) -> np.ndarray:
    """Exact answer of y' = f' − y/τ to a force that is linear between its samples, plus an offset."""
    decay = math.exp(-STEP_S / tau_s)
    y = np.zeros_like(force)
    for k in range(1, len(force)):
        y[k] = y[k - 1] * decay + (force[k] - force[k - 1]) / STEP_S * tau_s * (1.0 - decay)
    return y + offset


def reconstruct(force: np.ndarray, *, contact_above: float = 1e-9, tau_s: float = TAU_S) -> np.ndarray:
    """What is made of the amplifier's output, one taxel."""
    charge = ChargeReconstruction(1, tau_s)
    readings = amplifier(force, tau_s)
    return np.array(
        [
            charge.update(np.array((reading,)), k * STEP_S, bool(f <= contact_above))[0]
            for k, (reading, f) in enumerate(zip(readings, force, strict=True))
        ]
    )


def press(n: float, held_s: float, *, before_s: float = 1.0, rise_s: float = 0.1) -> np.ndarray:
    rise = np.linspace(0.0, n, round(rise_s / STEP_S) + 1)[1:]
    return np.concatenate((np.zeros(round(before_s / STEP_S)), rise, np.full(round(held_s / STEP_S), n)))


def test_a_press_held_for_five_leak_times_is_still_measured() -> None:
    """Without the integral only e^−5 of it, under 1 %, would be left."""
    force = press(1000.0, 5 * TAU_S)
    assert amplifier(force)[-1] - OFFSET < 10.0
    assert reconstruct(force)[-1] == pytest.approx(1000.0, rel=0.005)


def test_the_force_is_followed_while_it_changes() -> None:
    t_s = np.arange(0.0, 6.0, STEP_S)
    force = np.where(t_s < 1.0, 0.0, 500.0 * np.minimum(t_s - 1.0, 1.0) + 100.0 * np.sin(3.0 * (t_s - 1.0)))
    assert_allclose(reconstruct(force), force, atol=2.0)


@pytest.mark.no_cover
@given(offset=st.floats(-30000.0, 30000.0), n=st.floats(10.0, 30000.0))
def test_an_offset_seen_without_contact_does_not_become_a_drift(offset: float, n: float) -> None:
    force = press(n, 2.0)
    charge = ChargeReconstruction(1, TAU_S)
    for k, reading in enumerate(amplifier(force, offset=offset)):
        told = charge.update(np.array((reading,)), k * STEP_S, bool(force[k] <= 0.0))
    assert told[0] == pytest.approx(n, rel=0.005)


def test_without_contact_the_force_is_zero_whatever_the_amplifier_reads() -> None:
    charge = ChargeReconstruction(3, TAU_S)
    assert_array_equal(charge.update(np.array((1.0, -5.0, 900.0)), 0.0, FREE), np.zeros(3))


def test_the_offset_is_learned_slowly_so_that_noise_is_not() -> None:
    charge = ChargeReconstruction(1, TAU_S)
    charge.update(np.array((0.0,)), 0.0, FREE)
    charge.update(np.array((100.0,)), OFFSET_TAU_S * math.log(2.0), FREE)  # half of the way after so long
    told = charge.update(np.array((100.0,)), OFFSET_TAU_S * math.log(2.0), HELD)
    assert_allclose(told, (50.0,))


def test_a_warming_pad_does_not_press_by_itself() -> None:
    """The offset creeps by 40 counts in 20 s without contact; the press afterwards is told all the same."""
    charge = ChargeReconstruction(1, TAU_S)
    for k in range(4000):
        charge.update(np.array((0.01 * k,)), k * STEP_S, FREE)
    t_s = 4000 * STEP_S
    told = charge.update(np.array((540.0,)), t_s, HELD)[0]
    assert told == pytest.approx(500.0, abs=2.0)


@pytest.mark.parametrize("rest_s", [0.5, 2.0, 10.0])
def test_the_next_contact_is_measured_as_well_as_the_first(rest_s: float) -> None:
    """What leaked away under the first load is missing after it: that must not be learned as an offset."""
    force = np.concatenate((press(1000.0, 3.0), np.zeros(round(rest_s / STEP_S)), press(600.0, 3.0, before_s=0.0)))
    told = reconstruct(force)
    assert told[-1] == pytest.approx(600.0, rel=0.01)
    assert_allclose(told, force, atol=10.0)


def test_a_contact_that_was_not_seen_does_not_spoil_the_offset_either() -> None:
    held = np.concatenate((press(1000.0, 3.0), np.zeros(200), press(600.0, 3.0, before_s=0.0)))
    charge = ChargeReconstruction(1, TAU_S)
    for k, (y, f) in enumerate(zip(amplifier(held), held, strict=True)):
        if not 190 < k < 600:  # nothing arrives while the first load is put on
            told = charge.update(np.array((y,)), k * STEP_S, bool(f <= 0.0))[0]
    assert told == pytest.approx(600.0, rel=0.01)


def test_charge_that_was_given_up_is_unknown_until_the_next_rest() -> None:
    charge = ChargeReconstruction(1, TAU_S)
    charge.update(np.zeros(1), 0.0, FREE)
    charge.update(np.full(1, 9.0), STEP_S, HELD)
    charge.forget()
    assert np.isnan(charge.update(np.full(1, 9.0), 2 * STEP_S, HELD)).all()
    charge.update(np.zeros(1), 3 * STEP_S, FREE)
    assert_allclose(charge.update(np.full(1, 9.0), 4 * STEP_S, HELD), (9.0,), rtol=0.01)


def test_a_contact_whose_beginning_was_missed_is_unknown() -> None:
    charge = ChargeReconstruction(2, TAU_S)
    for k in range(10):
        assert np.isnan(charge.update(np.ones(2), k * STEP_S, HELD)).all()
    charge.update(np.ones(2), 1.0, FREE)
    assert np.isfinite(charge.update(np.ones(2), 1.0 + STEP_S, HELD)).all()


def test_a_moment_of_unknown_contact_does_not_end_the_integration() -> None:
    """Only a force sensor that reads no contact may end it: a held load must not become an offset."""
    force = press(1000.0, 3.0)
    charge = ChargeReconstruction(1, TAU_S)
    for k, reading in enumerate(amplifier(force)):
        known_free = k < 100  # nothing is known from half a second before the press on
        told = charge.update(np.array((reading,)), k * STEP_S, known_free)
    assert told[0] == pytest.approx(1000.0, rel=0.005)


def test_a_gap_that_loses_the_charge_makes_the_rest_of_the_contact_unknown() -> None:
    charge = ChargeReconstruction(1, TAU_S)
    charge.update(np.zeros(1), 0.0, FREE)
    longest_s = 0.1 * TAU_S
    assert np.isfinite(charge.update(np.full(1, 9.0), 0.999 * longest_s, HELD)).all()
    assert np.isnan(charge.update(np.full(1, 9.0), 2.001 * longest_s, HELD)).all()
    assert np.isnan(charge.update(np.full(1, 9.0), 2.002 * longest_s, HELD)).all(), "it does not heal by itself"
    charge.update(np.zeros(1), 3.0 * longest_s, FREE)
    assert np.isfinite(charge.update(np.full(1, 9.0), 3.1 * longest_s, HELD)).all()


def test_charge_that_was_given_up_at_rest_does_not_spoil_the_offset() -> None:
    """The host slept just after a release: what was missing then is no longer missing when it wakes."""
    charge = ChargeReconstruction(1, TAU_S)
    held = np.concatenate((press(1000.0, 3.0), np.zeros(40)))
    for k, (y, f) in enumerate(zip(amplifier(held), held, strict=True)):
        charge.update(np.array((y,)), k * STEP_S, bool(f <= 0.0))
    charge.forget()
    start_s = len(held) * STEP_S
    later = press(600.0, 3.0)
    for k, (y, f) in enumerate(zip(amplifier(later), later, strict=True)):
        told = charge.update(np.array((y,)), start_s + k * STEP_S, bool(f <= 0.0))[0]
    assert told == pytest.approx(600.0, rel=0.02)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("when", [FREE, HELD])
def test_one_reading_that_is_no_number_poisons_nothing_for_ever(bad: float, when: bool) -> None:
    charge = ChargeReconstruction(2, TAU_S)
    charge.update(np.zeros(2), 0.0, FREE)
    assert np.isnan(charge.update(np.array((1.0, bad)), STEP_S, when)).all()
    assert_array_equal(charge.update(np.zeros(2), 2 * STEP_S, FREE), np.zeros(2))
    assert_allclose(charge.update(np.full(2, 9.0), 3 * STEP_S, HELD), (9.0, 9.0), rtol=0.01)


def test_two_scans_at_one_instant_add_nothing_up() -> None:
    charge = ChargeReconstruction(1, TAU_S)
    charge.update(np.zeros(1), 0.0, FREE)
    charge.update(np.full(1, 100.0), STEP_S, HELD)
    first = charge.update(np.full(1, 100.0), 2 * STEP_S, HELD)
    assert_array_equal(charge.update(np.full(1, 100.0), 2 * STEP_S, HELD), first)


def test_a_returned_image_is_not_changed_by_the_next_scan() -> None:
    charge = ChargeReconstruction(1, TAU_S)
    charge.update(np.zeros(1), 0.0, FREE)
    told = charge.update(np.full(1, 100.0), STEP_S, HELD)
    kept = told.copy()
    charge.update(np.full(1, 300.0), 2 * STEP_S, HELD)
    assert_array_equal(told, kept)


@pytest.mark.parametrize("tau_s", [0.0, -1.0, math.inf, math.nan])
def test_an_invalid_leak_time_is_refused(tau_s: float) -> None:
    with pytest.raises(ValueError, match="tau_s must be positive and finite"):
        ChargeReconstruction(1, tau_s)


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
    """A bias of it must be told before it is believed, and drift adds alike to all taxels."""
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


def test_a_moved_zero_of_the_readings_moves_no_force() -> None:
    """A tare under way changes what is subtracted before the charge is rebuilt, also while something presses."""
    force = press(100.0, 1.0)
    told = {}
    for shift_at in (len(force), len(force) // 4, len(force) // 2):
        charge = ChargeReconstruction(1, TAU_S)
        charge.shift(np.array((5.0,)))
        forces, by = [], 0.0
        for k, (reading, f) in enumerate(zip(amplifier(force), force, strict=True)):
            if k == shift_at:
                by = 30.0
                charge.shift(np.array((by,)))
            forces.append(charge.update(np.array((reading - by,)), k * STEP_S, bool(f <= 1e-9))[0])
        told[shift_at] = forces
    for forces in told.values():
        assert_allclose(forces, told[len(force)], atol=1e-9)
    assert told[len(force)][-1] == pytest.approx(100.0, rel=0.01)
