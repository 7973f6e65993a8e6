"""A charge pad measures a held force although its charge leaks away; one taxel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.charge_reconstruction import OFFSET_TAU_S, ChargeReconstruction

TAU_S = 2.0
STEP_S = 0.005
OFFSET = 37.0
FREE, HELD = True, False


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
