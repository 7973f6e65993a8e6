"""A tare is explicit, readable and reversible, and uses all the readings of its duration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.averaging import MOVING_FACTOR
from slipd.signals.tare import MIN_READINGS, Tare

MS = 1_000_000


def feed(tare: Tare, values: list[list[float]], *, start_ns: int = 0) -> np.ndarray:
    """A reading a millisecond; returns the last one tared."""
    last = np.zeros(len(values[0]))
    for k, value in enumerate(values):
        last = tare.apply(np.array(value), start_ns + k * MS)
    return last


def test_the_offset_of_the_config_is_subtracted_from_the_beginning() -> None:
    tare = Tare(np.array((1.0, 2.0)))
    assert_allclose(tare.apply(np.array((1.5, 1.0)), 0), (0.5, -1.0))
    assert (tare.current.id, tare.current.t_ns, tare.current.readings) == (0, None, 0)


def test_the_config_cannot_be_changed_through_what_it_was_made_of() -> None:
    initial = np.zeros(2)
    tare = Tare(initial)
    initial += 7.0
    assert_allclose(tare.apply(np.ones(2), 0), np.ones(2))


def test_a_tare_is_the_mean_of_the_readings_of_its_time() -> None:
    tare = Tare(np.zeros(2))
    tare.begin(0, 0.010)
    readings = [[1.0 + 0.1 * k, -k] for k in range(11)]
    feed(tare, readings)
    assert_allclose(tare.current.value, np.mean(readings, axis=0))
    assert (tare.current.id, tare.current.t_ns, tare.current.readings) == (1, 10 * MS, 11)
    assert not tare.busy


def test_the_offset_in_force_stays_until_the_tare_is_taken() -> None:
    tare = Tare(np.array((5.0,)))
    tare.begin(0, 0.020)
    assert_allclose(feed(tare, [[6.0]] * 20), (1.0,))
    assert tare.busy
    assert_allclose(tare.apply(np.array((6.0,)), 20 * MS), (0.0,))
    assert not tare.busy


def test_too_few_readings_make_no_tare_however_long_it_takes() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.001)
    for k in range(MIN_READINGS - 1):
        tare.apply(np.array((1.0,)), k * 1000 * MS)
    assert tare.busy
    assert tare.current.id == 0
    tare.apply(np.array((1.0,)), MIN_READINGS * 1000 * MS)
    assert tare.current.readings == MIN_READINGS


@given(bad=st.sampled_from((math.nan, math.inf, -math.inf)), at=st.integers(0, 19), axis=st.integers(0, 1))
def test_N1_readings_that_are_no_numbers_do_not_enter_the_mean(bad: float, at: int, axis: int) -> None:
    tare = Tare(np.zeros(2))
    tare.begin(0, 0.018)
    readings = [[2.0, 3.0] for _ in range(20)]
    readings[at][axis] = bad
    feed(tare, readings)
    assert_allclose(tare.current.value, (2.0, 3.0))
    assert tare.current.readings in (18, 19)
    assert not tare.busy


def test_nothing_but_nan_never_becomes_a_tare() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.001)
    feed(tare, [[math.nan]] * 100)
    assert tare.busy
    assert_array_equal(tare.current.value, (0.0,))


def test_undo_puts_back_what_was_in_force_before() -> None:
    tare = Tare(np.array((4.0,)))
    assert not tare.undo()
    tare.begin(0, 0.009)
    feed(tare, [[6.0]] * 10)
    assert tare.undo()
    assert tare.current.id == 0
    assert_allclose(tare.apply(np.array((6.0,)), 0), (2.0,))
    assert not tare.undo(), "there is one step back, not two"


def test_a_tare_after_an_undo_has_an_id_of_its_own() -> None:
    tare = Tare(np.zeros(1))
    for start_ns in (0, 20 * MS):
        tare.begin(start_ns, 0.009)
        feed(tare, [[1.0]] * 10, start_ns=start_ns)
    tare.undo()
    assert tare.current.id == 1
    tare.begin(40 * MS, 0.009)
    feed(tare, [[1.0]] * 10, start_ns=40 * MS)
    assert tare.current.id == 3


def test_a_second_beginning_forgets_the_first() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.050)
    feed(tare, [[9.0]] * 10)
    tare.begin(10 * MS, 0.009)
    feed(tare, [[1.0]] * 10, start_ns=10 * MS)
    assert_allclose(tare.current.value, (1.0,))


def test_a_tare_that_is_given_up_leaves_the_old_one() -> None:
    tare = Tare(np.array((3.0,)))
    tare.begin(0, 0.005)
    feed(tare, [[9.0]] * 5)
    tare.abort("contact")
    assert not tare.busy
    feed(tare, [[9.0]] * 20, start_ns=5 * MS)
    assert tare.current.id == 0
    assert_allclose(tare.current.value, (3.0,))


def test_a_returned_offset_is_not_changed_by_the_next_tare() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.009)
    feed(tare, [[1.0]] * 10)
    told = tare.current.value
    tare.begin(10 * MS, 0.009)
    feed(tare, [[5.0]] * 10, start_ns=10 * MS)
    assert_allclose(told, (1.0,))


def test_an_image_is_tared_taxel_by_taxel() -> None:
    offset = np.arange(12.0).reshape(4, 3)
    tare = Tare(np.zeros((4, 3)))
    tare.begin(0, 0.0)
    for k in range(MIN_READINGS):
        tare.apply(offset + (-1) ** k, k)
    assert_allclose(tare.current.value, offset)


def test_a_tare_records_its_client_and_its_noise() -> None:
    tare = Tare(np.zeros(2))
    assert (tare.current.by, tare.current.std) == ("config", None)
    readings = [[0.1 * (-1) ** k, 2.0] for k in range(10)]
    tare.begin(0, 0.009, "00ff")
    feed(tare, readings)
    assert tare.current.by == "00ff"
    assert_allclose(tare.current.std, np.std(readings, axis=0, ddof=1))


def test_a_tare_keeps_the_gravity_in_which_it_was_taken() -> None:
    tare = Tare(np.zeros(1))
    assert_array_equal(tare.current.gravity_mps2, np.zeros(3), "the offset of the config holds no weight")
    tare.begin(0, 0.009, gravity_mps2=np.array((0.0, 0.0, -9.8)))
    feed(tare, [[1.0]] * 10)
    assert_array_equal(tare.current.gravity_mps2, (0.0, 0.0, -9.8))
    tare.begin(10 * MS, 0.009)
    feed(tare, [[1.0]] * 10, start_ns=10 * MS)
    assert tare.current.gravity_mps2 is None
    tare.undo()
    assert_array_equal(tare.current.gravity_mps2, (0.0, 0.0, -9.8))


def test_readings_that_move_are_no_tare_and_the_reason_can_be_read() -> None:
    tare = Tare(np.array((3.0, 0.0)), noise=np.array((0.02, 0.02)))
    tare.begin(0, 0.019)
    feed(tare, [[3.0, 0.1 * k] for k in range(20)])
    assert not tare.busy
    assert tare.current.id == 0
    assert_array_equal(tare.current.value, (3.0, 0.0))
    assert tare.aborted_text == "the readings moved: component 1 spreads by 0.592, its noise is 0.02; hold still"
    tare.begin(20 * MS, 0.019)
    assert tare.aborted_reason is None
    feed(tare, [[3.0, 0.02 * (-1) ** k] for k in range(20)], start_ns=20 * MS)
    assert tare.current.id == 1


def test_a_component_without_a_stated_noise_may_move() -> None:
    tare = Tare(np.zeros(2), noise=np.array((0.0, 0.02)))
    tare.begin(0, 0.019)
    feed(tare, [[float(k), 0.0] for k in range(20)])
    assert tare.current.id == 1


@pytest.mark.parametrize("noise", [np.zeros(3), np.array((0.1, -0.1)), np.array((math.nan, 0.1)), np.full(2, math.inf)])
def test_an_invalid_noise_is_refused(noise: np.ndarray) -> None:
    with pytest.raises(ValueError, match="noise must be finite, not negative, and of shape"):
        Tare(np.zeros(2), noise=noise)


@pytest.mark.parametrize("seed", range(100))
def test_F4_a_press_in_the_second_half_of_a_tare_is_reported_or_harmless(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise, readings = 0.02, 200
    values = rng.normal(scale=noise, size=(readings, 3))
    begins = rng.integers(readings // 2, readings)
    values[begins:] += rng.normal(size=3) * 10 ** rng.uniform(-2.0, 1.5)
    tare = Tare(np.zeros(3), noise=np.full(3, noise))
    tare.begin(0, (readings - 1) * 1e-3)
    feed(tare, values.tolist())
    assert not tare.busy
    assert bool(tare.aborted_reason) == (tare.current.id == 0)
    assert np.abs(tare.current.value).max() <= MOVING_FACTOR * noise


def test_F4_an_aborted_tare_gives_its_reason() -> None:
    tare = Tare(np.zeros(1))
    tare.abort("contact")
    assert tare.aborted_reason is None
    tare.begin(0, 1.0)
    tare.abort("contact")
    assert (tare.aborted_reason, tare.aborted_text) == ("contact", "a contact began")


def test_to_undo_a_tare_that_is_being_measured_is_to_give_it_up() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.009)
    feed(tare, [[1.0]] * 10)
    tare.begin(10 * MS, 1.0)
    assert tare.undo()
    assert not tare.busy
    assert (tare.aborted_reason, tare.aborted_text) == ("undone", "undone before it was taken")
    assert tare.current.id == 1, "the tare before it still holds"
    assert tare.undo()
    assert tare.current.id == 0


def test_what_is_not_trusted_does_not_enter_the_mean() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.020)
    for k in range(21):
        tare.apply(np.array((1.0 if k % 2 == 0 else 50.0,)), k * MS, trusted=k % 2 == 0)
    assert_allclose(tare.current.value, (1.0,))
    assert tare.current.readings == 11


@pytest.mark.parametrize("value", [1e308, -1e308, 1e13])
def test_N3_a_reading_that_no_device_can_send_is_no_part_of_an_offset(value: float) -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.019)
    feed(tare, [[1.0]] * 9 + [[value]] + [[1.0]] * 10)
    assert_array_equal(tare.current.value, (1.0,))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 5e-324])
def test_N1_one_odd_reading_outside_a_tare_touches_nothing(value: float) -> None:
    tare = Tare(np.array((1.0,)))
    tare.apply(np.array((value,)), 0)
    assert_array_equal(tare.apply(np.array((3.0,)), MS), (2.0,))


def test_N4_an_offset_is_never_denormal() -> None:
    tare = Tare(np.zeros(1))
    tare.begin(0, 0.009)
    feed(tare, [[5e-324]] * 10)
    assert (tare.current.id, tare.current.value[0]) == (1, 0.0)
