"""The zero of a force sensor is tracked without contact; a held load is never subtracted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nanoseconds import MS, S
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.drift import BLOCK_NS, FULL_SWING_S, HOLD_OFF_NS, LONGEST_GAP_NS, LOOK_BACK_BLOCKS, DriftCompensation

LIMIT = np.array((1.0, 1.0, 1.0, 0.02, 0.02, 0.02))
SETTLED_S = 6.0  # the hold-off, the look-back, and some time to learn


class Stream:
    """A sensor without noise, read at a rate; remembers where it is in time."""

    def __init__(self, rate_hz: float = 50.0, tau_s: float = 10.0) -> None:
        self.drift = DriftCompensation(tau_s, LIMIT)
        self.step_ns = round(1e9 / rate_hz)
        self.t_ns = 0

    def run(self, seconds: float, start: float, end: float | None = None, free: bool | None = True) -> np.ndarray:
        """Readings whose components all go from ``start`` to ``end`` times their limit; returns what is subtracted."""
        count = round(seconds * 1e9 / self.step_ns)
        for level in np.linspace(start, start if end is None else end, count):
            self.t_ns += self.step_ns
            self.drift.update(level * LIMIT, self.t_ns, free)
        return self.drift.value / LIMIT


@pytest.fixture
def learned() -> Stream:
    """A stream with a steady offset of 0.1 of the limit that is learned already."""
    stream = Stream(tau_s=0.5)
    assert_allclose(stream.run(90.0, 0.1), 0.1, atol=1e-6)
    return stream


def test_T4_a_drift_of_half_a_newton_in_an_hour_is_followed() -> None:
    stream = Stream(rate_hz=20.0)
    assert_allclose(stream.run(3600.0, 0.0, 0.5), 0.5, atol=0.004)
    assert stream.drift.total == pytest.approx(0.5, abs=0.004)


@pytest.mark.parametrize("free", [False, None])
def test_T4_a_hold_of_ten_minutes_loses_nothing(free: bool | None) -> None:
    stream = Stream(rate_hz=200.0, tau_s=1.0)
    before = stream.run(10.0, 0.005).copy()
    assert before[0] > 0.0
    assert_array_equal(stream.run(600.0, 3.0, 3.1, free=free), before)
    assert stream.drift.frozen


@pytest.mark.parametrize("hertz", [50.0, 60.0, 100.0])
def test_T4_hum_of_the_mains_is_no_drift(hertz: float) -> None:
    drift = DriftCompensation(0.1, np.ones(1))
    for k in range(8000):
        drift.update(np.array((0.5 * math.sin(2 * math.pi * hertz * k * 1e-3),)), k * MS, True)
    assert not drift.frozen
    assert abs(drift.value[0]) < 2e-3 * 0.5


def test_it_waits_after_a_contact_before_it_learns_again(learned: Stream) -> None:
    held = learned.run(0.5, 2.0, free=False).copy()
    for seconds, frozen in ((HOLD_OFF_NS * 1e-9 - 0.1, True), (LOOK_BACK_BLOCKS * BLOCK_NS * 1e-9, False)):
        assert_array_equal(learned.run(seconds, 0.9), held)
        assert learned.drift.frozen is frozen
    assert (learned.run(1.0, 0.9) > held).all()


def test_what_came_just_before_a_contact_was_noticed_is_not_learned(learned: Stream) -> None:
    before = learned.run(0.1, 0.1).copy()
    learned.run(0.9 * LOOK_BACK_BLOCKS * BLOCK_NS * 1e-9, 0.1, 0.4)
    assert_allclose(learned.run(1.0, 0.4, free=False), before, atol=1e-6)
    assert_allclose(learned.run(HOLD_OFF_NS * 1e-9 + 1.0, 0.1), before, atol=1e-6)


@pytest.mark.parametrize("newtons_per_s", [0.3, 0.15, 0.05, 0.02])
def test_what_a_slow_press_loses_is_within_the_stated_bound(newtons_per_s: float) -> None:
    stream = Stream(rate_hz=100.0, tau_s=0.01)
    stream.run(SETTLED_S, 0.0)
    noticed_n, rate, pressed = 0.3, 1.0 / FULL_SWING_S, 0.0
    while pressed - stream.drift.value[0] < noticed_n:
        stream.t_ns += stream.step_ns
        pressed += newtons_per_s * 0.01
        stream.drift.update(np.full(6, pressed), stream.t_ns, True)
    bound = max(0.0, rate * noticed_n / (newtons_per_s - rate) - 2.0 * rate)
    block = rate * BLOCK_NS * 1e-9
    assert bound - 3.0 * block <= stream.drift.value[0] <= bound + block, "a bound far from what happens says nothing"


def test_it_moves_at_its_rate_stops_at_its_limit_and_recovers() -> None:
    stream = Stream(rate_hz=20.0, tau_s=0.5)
    stream.run(SETTLED_S, 0.0)
    before = stream.run(0.1, 0.0).copy()
    assert_allclose(before - stream.run(30.0, -100.0), 28.0 / 600.0, rtol=0.01)
    assert_array_equal(stream.run(700.0, -2.0), -np.ones(6))
    assert stream.drift.total == 1.0
    assert (stream.run(60.0, 0.0) > -1.0).all()
    assert stream.drift.total < 1.0


def test_a_tare_begins_anew_and_its_undo_brings_the_drift_back(learned: Stream) -> None:
    learned.drift.reset()
    assert_array_equal(learned.drift.value, np.zeros(6))
    assert_array_equal(learned.run(1.5, 0.1), np.zeros(6), "readings from before the tare were of the old offset")
    learned.drift.restore()
    kept = learned.drift.value
    assert_allclose(kept / LIMIT, 0.1, atol=1e-6)
    learned.run(SETTLED_S, 0.5)
    assert_allclose(kept / LIMIT, 0.1, atol=1e-6, err_msg="a returned value is not changed by the next")


@pytest.mark.parametrize("jump_ns", [LONGEST_GAP_NS, -S])
def test_after_a_silence_or_where_time_falls_a_contact_is_unknown(learned: Stream, jump_ns: int) -> None:
    learned.t_ns += jump_ns
    for seconds, frozen in ((0.1, True), (HOLD_OFF_NS * 1e-9, False)):
        learned.run(seconds, 0.1)
        assert learned.drift.frozen is frozen


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308, -1e300])
def test_N1_N3_N4_readings_that_no_sensor_can_give_do_not_touch_the_state(learned: Stream, value: float) -> None:
    before = learned.run(SETTLED_S, 0.1).copy()
    for _ in range(150):
        learned.t_ns += learned.step_ns
        learned.drift.update(np.full(6, value), learned.t_ns, True)
    assert_allclose(learned.drift.value / LIMIT, before, rtol=1e-12)
    assert_allclose(learned.run(10.0, 0.1), before, atol=1e-6)
    assert_array_equal(learned.run(100.0, 5e-324), np.zeros(6), "it sinks to zero and never to a denormal")
