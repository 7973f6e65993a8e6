"""A tare is explicit, readable and reversible, and uses all the readings of its duration but those that are none."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from nanoseconds import MS
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.tare import LARGEST_READING, MIN_READINGS, MOVING_FACTOR, Average, Offset, Tare
from slipd.types.arrays import flushed

STORED = Offset(7, np.array((2.0,)), -5, 10, "earlier", np.zeros(1), None, "stored")


def feed(tare: Tare, values: list[list[float]], *, start_ns: int = 0) -> None:
    """Give a reading a millisecond."""
    for k, value in enumerate(values):
        tare.apply(np.array(value), start_ns + k * MS)


class Model:
    """What a tare should do, of single numbers."""

    def __init__(self) -> None:
        self.now, self.before, self.newest = (0, 5.0, "config"), None, 0
        self.run: list[float] | None = None
        self.until_ns = 0

    def read(self, value: float, t_ns: int) -> None:
        if self.run is None:
            return
        self.run.append(value)
        if t_ns >= self.until_ns and len(self.run) >= MIN_READINGS:
            self.newest += 1
            self.put((self.newest, float(np.mean(self.run)), "measured"))
            self.run = None

    def put(self, offset: tuple[int, float, str]) -> None:
        self.before, self.now = self.now, offset

    def undo(self) -> bool:
        if self.run is not None:
            self.run = None
            return True
        if self.before is None:
            return False
        self.now, self.before = self.before, None
        return True


READ = st.tuples(st.just("read"), st.floats(-3.0, 3.0), st.booleans())
OTHER = st.tuples(
    st.sampled_from(("begin", "begin", "abort", "undo", "restore", "observe", "reject")),
    st.sampled_from((0.0, 0.004, 0.02)),
    st.just(True),
)


@given(st.lists(st.one_of(READ, READ, READ, OTHER), max_size=80))
def test_offset_follows_readings_and_requests(actions: list[tuple[str, float, bool]]) -> None:
    tare, model, told = Tare(np.array((5.0,))), Model(), [0]
    tare.on_change.append(lambda *_: told.append(tare.current.id))
    for k, (action, number, trusted) in enumerate(actions):
        t_ns, changes, before = k * MS, len(told), (tare.busy, tare.current)
        if action == "read":
            if trusted:
                model.read(number, t_ns)
            assert tare.apply(np.array((number,)), t_ns, trusted=trusted) == pytest.approx(number - model.now[1])
        elif action == "begin":
            model.run, model.until_ns = [], t_ns + round(number * 1e9)
            tare.begin(t_ns, number)
        elif action == "abort":
            model.run = None
            tare.abort("contact")
        elif action == "undo":
            assert tare.undo() is model.undo()
        elif action == "restore":
            model.put((7, 2.0, "stored"))
            model.newest = 7
            tare.restore(STORED)
        elif action == "observe":
            model.now = (*model.now[:2], "observed")
            tare.observe(t_ns)
        elif model.now[2] == "stored" and model.before is not None:
            model.now, model.before = model.before, None
            tare.reject("it reads a load")
            assert tare.aborted_text == "the stored zero does not fit: it reads a load"
        else:
            tare.reject("it reads a load")
        assert (tare.current.id, tare.current.origin, tare.busy) == (model.now[0], model.now[2], model.run is not None)
        assert tare.current.value == pytest.approx(model.now[1])
        assert tare.known is (model.now[2] != "config")
        assert told[-1] == tare.current.id
        if before != (tare.busy, tare.current):
            assert len(told) > changes, "whoever depends on it is called"


def test_a_tare_records_when_by_whom_from_what_with_which_noise_and_gravity() -> None:
    initial = np.zeros((2, 2))
    tare = Tare(initial)
    initial += 7.0
    assert (tare.current.by, tare.current.std, tare.current.t_ns, tare.current.readings) == ("config", None, None, 0)
    assert_array_equal(tare.current.value, np.zeros((2, 2)), "it cannot be changed through what it was made of")
    assert_array_equal(tare.current.gravity_mps2, np.zeros(3), "the offset of the config holds no weight")
    readings = [[[0.1 * (-1) ** k, 2.0], [k, -k]] for k in range(10)]
    tare.begin(0, 0.009, "00ff", np.array((0.0, 0.0, -9.8)))
    feed(tare, readings)
    found = tare.current
    assert (found.by, found.t_ns, found.readings, found.age_s(10 * MS)) == ("00ff", 9 * MS, 10, pytest.approx(0.001))
    assert_allclose(found.std, np.std(readings, axis=0, ddof=1))
    assert_array_equal(found.gravity_mps2, (0.0, 0.0, -9.8))
    kept = replace(found, value=found.value.copy())
    tare.begin(10 * MS, 0.009)
    feed(tare, readings, start_ns=10 * MS)
    assert tare.current.gravity_mps2 is None
    assert_array_equal(found.value, kept.value, "a returned offset is not changed by the next tare")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308, -1e308, 1e13, -2 * LARGEST_READING])
def test_N1_N3_a_reading_that_no_device_can_send_is_no_part_of_an_offset(value: float) -> None:
    tare = Tare(np.zeros(2))
    tare.begin(0, 0.019)
    feed(tare, [[1.0, 2.0]] * 9 + [[value, 2.0]] + [[1.0, 2.0]] * 11)
    assert_array_equal(tare.current.value, (1.0, 2.0))
    assert tare.current.readings == 19
    tare.begin(30 * MS, 0.001)
    feed(tare, [[value, 2.0]] * 100, start_ns=30 * MS)
    assert tare.busy, "nothing but such readings never becomes a tare"


def test_readings_that_move_are_no_tare_and_the_reason_can_be_read() -> None:
    tare = Tare(np.array((3.0, 0.0)), noise=np.array((0.0, 0.02)))  # the noise of the first is not stated
    for slope, taken, text in (
        (0.0175, 0, "the readings moved: component 1 spreads by 0.104, its noise is 0.02; hold still"),
        (0.0165, 1, ""),
    ):
        tare.begin(0, 0.019)
        assert tare.aborted_reason is None
        feed(tare, [[float(k), slope * k] for k in range(20)])
        assert (tare.busy, tare.current.id, tare.aborted_text) == (False, taken, text)


def test_F4_a_press_in_the_second_half_of_a_tare_is_reported_or_harmless() -> None:
    for seed in range(100):
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


def average(readings: np.ndarray) -> Average:
    found = Average(readings.shape[1:])
    for reading in readings:
        found.add(reading)
    return found


@given(arrays(np.float64, (20, 3), elements=st.floats(-100.0, 100.0)))
def test_mean_and_spread_are_those_of_numpy(readings: np.ndarray) -> None:
    found = average(readings)
    assert_allclose(
        average(1e9 + np.array([[0.0], [1.0], [2.0]])).std, (1.0,), err_msg="a small spread beside an offset"
    )
    assert found.count == 20
    assert_allclose(found.mean, readings.mean(axis=0), atol=1e-9)
    assert_allclose(found.std, readings.std(axis=0, ddof=1), atol=1e-6)


def test_N4_a_mean_is_never_denormal() -> None:
    found = average(np.fromiter(repeat(5e-324, 10), dtype=float).reshape(10, 1))
    assert_array_equal((found.mean, found.std), ((0.0,), (0.0,)))
    assert_array_equal(flushed(np.array((5e-324, -1e-300, 1e-20, -2.0))), (0.0, 0.0, 1e-20, -2.0))
