"""Tares of the force sensor, and what gives them up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from finger_bench import EMPTY, FULL, MS, T0, NoisyFinger, Press, verdict

from slipd.finger.finger import Finger
from slipd.types.samples import WrenchSample


class TestTareOfTheForceSensor:
    def test_tare_removes_the_bias(self, finger: Finger, press: Press) -> None:
        finger.force.tare.put(replace(finger.force.tare.current, origin="config"))  # not known yet
        finger.begin_tare(T0, 0.1, "someone")
        for _ in range(12):
            press(2.0, (1.0, 0.0), counts=EMPTY)
        assert finger.tare.current.id == 1
        assert verdict(press(2.0, (1.0, 0.0), counts=EMPTY)) == ("no_contact", ())
        state = press(12.0, (2.0, 0.0))
        assert state.contact.normal_n == pytest.approx(10.0)
        assert state.contact.tangential_n == pytest.approx((1.0, 0.0))

    def test_contact_gives_up_the_tare(self, finger: Finger, press: Press) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        for _ in range(5):
            press(0.0, counts=EMPTY)
        press(5.0, counts=FULL)
        assert not finger.tare.busy
        for _ in range(20):
            press(5.0, counts=FULL)
        assert finger.tare.current.id == 0

    def test_end_of_stream_gives_up_the_tare(self, finger: Finger, press: Press) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        press(0.0, counts=EMPTY)
        finger.disconnect(T0 + 20 * MS)
        assert not finger.tare.busy

    def test_short_silence_does_not_give_up_the_tare(self, finger: Finger, press: Press) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        press(0.0, counts=EMPTY)
        finger.check_silence(T0 + 50 * MS)
        for _ in range(12):
            press(0.0, counts=EMPTY)
        assert finger.tare.current.id == 1

    def test_readings_marked_by_the_sensor_are_left_out(self, finger: Finger, press: Press) -> None:
        finger.begin_tare(T0, 0.1, "someone")
        for k in range(24):
            press(0.0 if k % 2 else 500.0, counts=EMPTY, status=() if k % 2 else ("overload",))
        assert finger.tare.current.id == 1
        assert finger.tare.current.value == pytest.approx(np.zeros(6))


def test_undo_gives_up_a_tare_in_progress(noisy: NoisyFinger) -> None:
    noisy.finger.begin_tare(T0, 0.1, "someone")
    assert noisy.finger.tare.undo()
    assert noisy.finger.tare.current.id == 0
    assert not noisy.finger.tare.undo()


def test_tare_is_given_up_after_500_ms_of_silence(noisy: NoisyFinger) -> None:
    noisy.read(0.0)
    noisy.finger.begin_tare(noisy.t_ns, 0.1, "someone")
    noisy.finger.check_silence(noisy.t_ns + 400 * MS)
    assert noisy.finger.tare.busy
    noisy.finger.check_silence(noisy.t_ns + 600 * MS)
    assert (noisy.finger.tare.busy, noisy.finger.tare.aborted_reason) == (False, "silent")


def test_tare_averages_readings_that_arrive_together(noisy: NoisyFinger) -> None:
    noisy.finger.begin_tare(T0, 0.01, "someone")
    samples = [WrenchSample(T0 + k * MS, None, np.full(3, 0.1), np.zeros(3)) for k in range(30)]
    read = noisy.finger.decide(samples, [sample.t_ns for sample in samples])
    states = [state for batch in read for state in batch]
    assert noisy.finger.tare.current.id == 1
    assert states[0].wrench == pytest.approx((0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    assert states[-1].wrench == pytest.approx((0.0,) * 6)
