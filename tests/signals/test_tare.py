"""A tare is explicit, readable and reversible, and never made of less than it says."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

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
def test_readings_that_are_no_numbers_do_not_enter_the_mean(bad: float, at: int, axis: int) -> None:
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
    tare.abort()
    assert not tare.busy
    feed(tare, [[9.0]] * 20, start_ns=5 * MS)
    assert tare.current.id == 0
    assert_allclose(tare.current.value, (3.0,))


def test_an_offset_that_was_told_is_not_changed_by_the_next_tare() -> None:
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
