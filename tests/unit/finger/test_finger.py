"""One finger: staleness, readings that cannot be used, and streams that it does not have."""

from __future__ import annotations

import math

import numpy as np
import pytest
from finger_bench import MS, T0, NoisyFinger, Parse, Press, Wrench, make_finger, read_force, verdict
from known_zeros import known_finger

from slipd.config import Levels, stale_after_ns
from slipd.finger.finger import Finger
from slipd.finger.stream_health import finger_conditions
from slipd.types.samples import TactileSample, WrenchSample


def test_finger_is_unknown_before_the_first_reading(finger: Finger) -> None:
    assert verdict(finger.state) == ("unknown", ("stale",))
    assert finger.check_silence(T0) is None, "nothing changed"
    assert finger.age_s(T0) is None


@pytest.mark.parametrize(("pull_n", "level"), [(1.0, "stable"), (3.5, "caution"), (4.5, "warning")])
def test_image_of_three_periods_ago_takes_back_stable_and_caution_but_no_warning(
    finger: Finger, press: Press, wrench: Wrench, pull_n: float, level: str
) -> None:
    edge = press(10.0, (pull_n, 0.0)).t_ns + 30 * MS
    state = read_force(finger, wrench(edge, 10.0, (pull_n, 0.0)))
    assert (state.verdict.level, finger.check_silence(edge)) == (level, None)
    after = ("unknown", ("rotation_unobserved",)) if level != "warning" else verdict(state)
    changed = finger.check_silence(edge + 1)
    assert (changed is None) is (level == "warning")
    assert verdict(finger.state) == after
    assert finger.check_silence(edge + 2) is None, "it is reported once"
    if level != "warning":
        assert finger.state.model == "none"
        assert verdict(read_force(finger, wrench(edge + 1, 10.0, (pull_n, 0.0)))) == after


@pytest.mark.parametrize(
    ("rate_hz", "stale_ns"), [(1000.0, 20 * MS), (150.0, 20 * MS), (100.0, 30 * MS), (10.0, 300 * MS)]
)
def test_stream_is_stale_after_three_periods_but_not_within_20_ms(
    left: str, parse: Parse, wrench: Wrench, rate_hz: float, stale_ns: int
) -> None:
    robotous = left.replace('"bota"', '"robotous"').replace("rate_hz = 1000.0", f"rate_hz = {rate_hz}\nbaud = 921600")
    config = parse(robotous).finger["left"]
    assert stale_after_ns(config.wrench) == stale_ns
    finger = known_finger("left", config, Levels())
    read_force(finger, wrench(T0, 10.0))
    assert finger.check_silence(T0 + stale_ns) is None
    state = finger.check_silence(T0 + stale_ns + 1)
    assert verdict(state) == ("unknown", ("stale",))
    assert state.wrench is None
    assert finger.check_silence(T0 + stale_ns + 2) is None, "it is reported once"
    assert finger.age_s(T0 + stale_ns + 1) == pytest.approx(stale_ns * 1e-9)
    assert read_force(finger, wrench(T0 + stale_ns + 3, 10.0)).contact is not None


@pytest.mark.parametrize("word", ["overload", "invalid", "raw"])
def test_reading_marked_by_the_sensor_is_unknown(press: Press, word: str) -> None:
    press(10.0)
    state = press(10.0, (1.0, 0.0), status=(word,))
    assert verdict(state) == ("unknown", (word,))
    assert state.status == (word,)
    assert state.contact is None, "such a reading gives no contact"
    assert state.utilisation is None


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_reading_that_is_not_finite_is_unknown_and_affects_no_other(
    finger: Finger, press: Press, bad: float, place: int
) -> None:
    before = press(10.0, (1.0, 0.0))
    values = np.array((1.0, 0.0, -10.0, 0.0, 0.0, 0.0))
    values[place] = bad
    spoilt = read_force(finger, WrenchSample(T0 + 11 * MS, None, values[:3], values[3:]))
    assert verdict(spoilt) == ("unknown", ("not_finite",))
    after = press(10.0, (1.0, 0.0), ms=2.0)
    assert verdict(after) == verdict(before)
    assert after.utilisation.value == pytest.approx(before.utilisation.value)


def test_finger_refuses_streams_that_it_does_not_have(left: str, right: str, parse: Parse) -> None:
    config = parse(left + right)
    bare = config.finger["left"].model_copy(update={"wrench": None, "pad": None})
    with pytest.raises(ValueError, match="has no stream"):
        known_finger("left", bare, Levels())
    sensorless = known_finger("right", config.finger["right"], Levels())
    with pytest.raises(ValueError, match="has no force sensor"):
        read_force(sensorless, WrenchSample(T0, None, np.zeros(3), np.zeros(3)))
    padless = known_finger("left", config.finger["left"].model_copy(update={"pad": None}), Levels())
    assert padless.update_image(TactileSample(T0, None, np.zeros(16))) is None
    padless.disconnect_image()
    assert list(padless.channels) == ["wrench"]
    for refused in (lambda: padless.channel("pad"), lambda: finger_conditions(padless, "pad", T0)):
        with pytest.raises(ValueError, match="finger left has no pad"):
            refused()


def test_N1_three_axis_image_that_is_not_finite_is_unknown(right: str, parse: Parse) -> None:
    finger = make_finger(right, parse, "right")
    batch = finger.update_image(TactileSample(T0, None, np.full((4, 3), math.nan)))
    (state,) = batch
    assert (state.verdict.level, state.verdict.reasons, state.wrench) == ("unknown", ("not_finite",), None)


def test_C4_F1_reading_that_arrives_too_late_is_stale(noisy: NoisyFinger) -> None:
    noisy.look(8.0)
    assert noisy.read(8.0).verdict.level == "stable"
    late = WrenchSample(noisy.t_ns + 50 * MS, None, np.array((0.0, 0.0, -8.0)), np.zeros(3))
    state = read_force(noisy.finger, late, noisy.t_ns + 10 * MS)
    assert (state.verdict.level, state.verdict.reasons) == ("unknown", ("stale",))
    assert noisy.finger.age_s(noisy.t_ns + 50 * MS) == pytest.approx(0.04)
