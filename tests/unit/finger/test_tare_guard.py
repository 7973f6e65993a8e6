"""A tare of the force sensor takes its readings, one by one."""

from __future__ import annotations

import numpy as np
import pytest
from finger_bench import EMPTY, NoisyFinger, Press, make_finger, verdict
from fixture_types import Parse
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.finger.freshness import Read
from slipd.types.samples import TactileSample, WrenchSample


def test_tare_removes_the_bias_and_leaves_out_readings_that_the_sensor_marks(untared: Finger, image, wrench) -> None:  # type: ignore[no-untyped-def]
    untared.begin_tare(T0, 0.1, "someone")
    for k in range(30):
        sample = wrench(T0 + 10 * k * MS, *((2.0, (1.0, 0.0)) if k % 2 else (500.0,)), status=() if k % 2 else ("raw",))
        list(untared.decide(Read((sample,), (sample.t_ns,))))
    assert untared.tare.current.id == 1
    assert untared.tare.current.value == pytest.approx((1.0, 0.0, -2.0, 0.0, 0.0, 0.0))
    assert verdict(untared.state) == ("no_contact", ())


@pytest.mark.parametrize(("name", "values"), [("left", [40.0] * 16), ("right", [[1000.0, 1000.0, 1040.0]] * 4)])
def test_images_that_the_device_marks_invalid_are_left_out_of_a_tare(
    rig: str, parse: Parse, name: str, values: list[float]
) -> None:
    """A pad with a force sensor behind it, and one of three-axis taxels."""
    finger = make_finger(rig, parse, name, zeros=False)
    finger.begin_tare(T0, 0.1, "someone", "pad")
    for k in range(40):
        marked = k % 3 > 0
        sample = TactileSample(T0 + 10 * k * MS, None, np.array(values) + 500.0 * marked, ("invalid",) * marked)
        finger.update_image(sample)
    assert finger.image.tare.current.id == 1
    assert finger.image.tare.current.value.tolist() == values


def test_tare_averages_readings_that_arrive_together(noisy: NoisyFinger) -> None:
    noisy.finger.begin_tare(T0, 0.01, "someone")
    samples = [WrenchSample(T0 + k * MS, None, np.full(3, 0.1), np.zeros(3)) for k in range(30)]
    states = [
        state for batch in noisy.finger.decide(Read(samples, [sample.t_ns for sample in samples])) for state in batch
    ]
    assert noisy.finger.tare.current.id == 1
    assert states[0].wrench == pytest.approx((0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    assert states[-1].wrench == pytest.approx((0.0,) * 6)


def test_a_press_during_a_tare_is_no_zero(finger: Finger, press: Press) -> None:
    finger.begin_tare(T0, 0.1, "someone")
    for k in range(25):
        press(5.0 * (k >= 5), counts=EMPTY)
    assert (finger.tare.busy, finger.tare.current.id) == (False, 0)
