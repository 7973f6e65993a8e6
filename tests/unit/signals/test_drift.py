"""The zero of a force sensor is tracked without contact; a held load is never subtracted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.drift import BLOCK_NS, FULL_SWING_S, HOLD_OFF_NS, LONGEST_GAP_NS, LOOK_BACK_BLOCKS, DriftCompensation

MS = 1_000_000
S = 1_000_000_000
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


def learned() -> Stream:
    """A stream with a steady offset of 0.1 of the limit that is learned already."""
    stream = Stream(tau_s=0.5)
    assert_allclose(stream.run(90.0, 0.1), 0.1, atol=1e-6)
    return stream


def test_T4_a_drift_of_half_a_newton_in_an_hour_is_followed() -> None:
    stream = Stream(rate_hz=20.0)
    assert_allclose(stream.run(3600.0, 0.0, 0.5), 0.5, atol=0.004)
    assert stream.drift.total == pytest.approx(0.5, abs=0.004)


def test_T4_a_hold_of_ten_minutes_loses_nothing() -> None:
    stream = Stream(rate_hz=1000.0, tau_s=1.0)
    before = stream.run(10.0, 0.005).copy()
    assert before[0] > 0.0
    after = stream.run(600.0, 3.0, 3.1, free=False)
    assert_array_equal(after, before)


@pytest.mark.parametrize("hertz", [50.0, 60.0, 100.0])
def test_T4_hum_of_the_mains_is_no_drift(hertz: float) -> None:
    drift = DriftCompensation(0.1, np.ones(1))
    for k in range(8000):
        drift.update(np.array((0.5 * math.sin(2 * math.pi * hertz * k * 1e-3),)), k * MS, True)
    assert not drift.frozen
    assert abs(drift.value[0]) < 2e-3 * 0.5


def test_nothing_is_learned_while_contact_is_not_known() -> None:
    stream = Stream(tau_s=0.5)
    assert_array_equal(stream.run(60.0, 0.5, free=None), np.zeros(6))
    assert stream.drift.frozen


def test_it_waits_after_a_contact_before_it_learns_again() -> None:
    stream = learned()
    held = stream.run(0.5, 2.0, free=False)
    assert stream.drift.frozen
    wait_s = (HOLD_OFF_NS + LOOK_BACK_BLOCKS * BLOCK_NS) * 1e-9
    assert_array_equal(stream.run(HOLD_OFF_NS * 1e-9 - 0.1, 0.9), held)
    assert stream.drift.frozen
    assert_array_equal(stream.run(wait_s - HOLD_OFF_NS * 1e-9, 0.9), held)
    assert not stream.drift.frozen
    assert (stream.run(1.0, 0.9) > held).all()


def test_what_came_just_before_a_contact_was_noticed_is_not_learned() -> None:
    stream = learned()
    before = stream.run(0.1, 0.1).copy()
    stream.run(0.9 * LOOK_BACK_BLOCKS * BLOCK_NS * 1e-9, 0.1, 0.4)
    assert_allclose(stream.run(1.0, 0.4, free=False), before, atol=1e-6)
    assert_allclose(stream.run(HOLD_OFF_NS * 1e-9 + 1.0, 0.1), before, atol=1e-6)


@pytest.mark.parametrize("newtons_per_s", [0.3, 0.15, 0.05, 0.02])
def test_what_a_slow_press_loses_is_within_the_stated_bound(newtons_per_s: float) -> None:
    stream = Stream(rate_hz=100.0, tau_s=0.01)
    stream.run(SETTLED_S, 0.0)
    noticed_n, rate = 0.3, 1.0 / FULL_SWING_S
    pressed = 0.0
    while pressed - stream.drift.value[0] < noticed_n:
        stream.t_ns += stream.step_ns
        pressed += newtons_per_s * 0.01
        stream.drift.update(np.full(6, pressed), stream.t_ns, True)
    bound = max(0.0, rate * noticed_n / (newtons_per_s - rate) - 2.0 * rate)
    lost = stream.drift.value[0]
    block_s = BLOCK_NS * 1e-9
    assert lost <= bound + rate * block_s
    assert lost >= bound - 3.0 * rate * block_s, "a bound that is far from what happens says nothing"


def test_it_never_moves_faster_than_its_rate() -> None:
    stream = Stream(tau_s=0.01)
    stream.run(SETTLED_S, 0.0)
    before = stream.run(0.1, 0.0).copy()
    after = stream.run(30.0, 100.0)
    assert_allclose(after - before, 28.0 / FULL_SWING_S, rtol=0.01)


def test_the_offset_stops_at_its_limit_reports_it_and_recovers() -> None:
    stream = Stream(rate_hz=20.0, tau_s=0.5)
    assert_array_equal(stream.run(700.0, -2.0), -np.ones(6))
    assert stream.drift.total == 1.0
    assert (stream.run(60.0, 0.0) > -1.0).all()
    assert stream.drift.total < 1.0


def test_a_tare_begins_anew_and_its_undo_brings_the_drift_back() -> None:
    stream = learned()
    stream.drift.reset()
    assert_array_equal(stream.drift.value, np.zeros(6))
    assert_array_equal(stream.run(1.5, 0.1), np.zeros(6), "readings from before the tare were of the old offset")
    stream.drift.restore()
    assert_allclose(stream.drift.value / LIMIT, 0.1, atol=1e-6)


def test_after_a_silence_a_contact_is_unknown() -> None:
    stream = learned()
    stream.t_ns += LONGEST_GAP_NS
    stream.run(0.1, 0.1)
    assert stream.drift.frozen
    stream.run(HOLD_OFF_NS * 1e-9, 0.1)
    assert not stream.drift.frozen
    stream.t_ns -= S
    stream.run(0.1, 0.1)
    assert stream.drift.frozen, "a time that falls is no time"


def test_a_returned_value_is_not_changed_by_the_next() -> None:
    stream = learned()
    told = stream.drift.value
    kept = told.copy()
    stream.run(SETTLED_S, 0.5)
    assert_array_equal(told, kept)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308, -1e300])
def test_N1_N3_one_odd_reading_does_not_touch_the_state(value: float) -> None:
    stream, twin = learned(), learned()
    stream.t_ns += 1
    twin.t_ns += 1
    stream.drift.update(np.full(6, value), stream.t_ns, True)
    assert_allclose(stream.run(10.0, 0.1), twin.run(10.0, 0.1), rtol=1e-12)


def test_N1_nothing_but_nan_teaches_nothing() -> None:
    stream = learned()
    stream.run(SETTLED_S, 0.1)
    before = stream.drift.value.copy()
    stream.run(60.0, math.nan)
    assert_array_equal(stream.drift.value, before)


def test_N4_it_sinks_to_zero_and_never_to_a_denormal() -> None:
    stream = learned()
    stream.run(100.0, 5e-324)
    assert_array_equal(stream.drift.value, np.zeros(6))


@pytest.mark.parametrize("tau_s", [0.0, -1.0, math.nan, math.inf])
def test_an_invalid_time_constant_is_refused(tau_s: float) -> None:
    with pytest.raises(ValueError, match="tau_s must be positive and finite"):
        DriftCompensation(tau_s, LIMIT)


@pytest.mark.parametrize("limit", [np.zeros(6), np.array((1.0, math.nan)), np.array((math.inf,)), np.array(1.0)])
def test_an_invalid_limit_is_refused(limit: np.ndarray) -> None:
    with pytest.raises(ValueError, match="limit must be one positive finite number per component"):
        DriftCompensation(1.0, limit)
