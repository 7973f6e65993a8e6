"""A force stream that is stuck, out of range or intermittent is reported; occasional repeats are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from watched_wrench import MS, Stream, take

from slipd.signals.frozen import DEFAULT_REPEATS, FLICKER_NS, WrenchWatch

ONES, NONE = np.ones(3), np.zeros(3)


def test_the_default_is_for_a_noise_of_a_third_of_a_count() -> None:
    by_chance = {std: math.erf(0.5 / (math.sqrt(2.0) * std)) ** (6 * DEFAULT_REPEATS) for std in (0.28, 0.3)}
    assert by_chance[0.3] < 1e-12 < by_chance[0.28]


def test_F1_a_stuck_sensor_is_reported_as_soon_as_chance_is_ruled_out_and_cleared_at_once() -> None:
    for seed in range(20):
        stream = Stream(seed)
        stream.send(200)
        said = stream.repeat(200)
        assert said.index("stuck") <= DEFAULT_REPEATS
        assert set(said[DEFAULT_REPEATS:]) == {"stuck"}
        assert stream.give(5.0, 5.0, 5.5) == ""


@pytest.mark.parametrize(("step_ms", "first_stuck"), [(1, 20), (5, 4)])
def test_F1_a_few_repeats_in_a_short_time_are_one_conversion_sent_often(step_ms: int, first_stuck: int) -> None:
    watch = WrenchWatch(200.0, repeats=4)
    said = [take(watch, ONES, ONES, k * step_ms * MS) for k in range(40)]
    assert said.index("stuck") == first_stuck
    assert take(watch, ONES, NONE, 40 * step_ms * MS) == "", "its torque moves"


def test_F1_random_values_are_garbage_within_ten_readings_and_until_they_have_been_gone() -> None:
    for seed in range(20):
        stream = Stream(seed)
        stream.send(100)
        said = [stream.give(*stream.rng.uniform(-200.0, 200.0, 3)) for _ in range(50)]
        assert "garbage" in said[:10]
        assert said[-1] == "garbage"
        said = stream.send(100)
        assert (set(said[:20]), said[-1]) == ({"garbage"}, "")


@pytest.mark.parametrize(
    ("bad", "single"), [(300.0, "garbage"), (1e200, "garbage"), (math.inf, ""), (-math.inf, ""), (math.nan, "")]
)
def test_F1_N1_N3_values_beyond_the_range_are_garbage_and_a_single_one_spoils_no_other(bad: float, single: str) -> None:
    """What is not finite is no fault of the stream before it comes again; whoever reads it sees it by itself."""
    stream = Stream()
    stream.send(10)
    assert stream.give(bad, 0.0, 0.0) == single
    assert set(stream.send(500)) == {""}
    said = [stream.give(*(sign * bad for _ in range(3))) for sign in (1.0, -1.0, 1.0, -1.0, -1.0)]
    assert said[-1] == "garbage"
    stream.send(100)
    assert "stuck" in stream.repeat(100)


def test_F1_a_torque_beyond_its_range_is_garbage() -> None:
    watch = WrenchWatch(200.0, 5.0)
    said = [
        take(watch, ONES, np.array((0.0, *yz)), k * MS) for k, yz in enumerate(((0.0, 4.9), (3.6, -3.6), (0.0, 0.0)))
    ]
    assert said == ["", "garbage", ""]
    assert take(WrenchWatch(), ONES, np.array((0.0, 0.0, 3e38)), MS) == "garbage", "no sensor states that"


@pytest.mark.parametrize(
    "blows", [[90.0] * 20 + [2.0] * 20, [-60.0 * math.sin(k) for k in range(3)], [90.0, 90.5, 2.0, 2.5, 90.0, 90.5]]
)
def test_F1_blows_are_not_garbage(blows: list[float]) -> None:
    stream = Stream()
    stream.send(100)
    assert {stream.give(0.01 * k, 0.0, force_n) for k, force_n in enumerate(blows)} == {""}
    assert stream.watch.lively, "nothing of the blows is left"


@pytest.mark.parametrize(("well", "found"), [(300, "intermittent"), (6_000, "")])
def test_F1_a_stream_that_fails_again_and_again_is_intermittent_until_it_has_been_well_for_long(
    well: int, found: str
) -> None:
    stream = Stream()
    for expected in ("", "", found, found):
        assert stream.send(well)[-1] in ("", found)
        stream.t_ns += 100 * MS
        assert stream.send() == [expected]
    if found:
        stream.repeat(200)
        assert stream.give(5.0, 5.0, 5.5) == "intermittent"
        said = stream.send(FLICKER_NS // MS + 2)
        assert (said[0], said[-1]) == ("intermittent", "")


def test_F1_equal_readings_before_and_behind_a_gap_are_two_runs() -> None:
    stream = Stream()
    stream.send(10)
    stream.repeat(45)
    stream.t_ns += 100 * MS
    stream.repeat()
    assert stream.watch.suspect
    assert set(stream.repeat(44)) == {""}


@pytest.mark.parametrize("repeats", [0, 200])
def test_F1_a_sensor_whose_readings_rest_is_not_stuck_by_time_and_a_jump_is_no_rest(repeats: int) -> None:
    watch = WrenchWatch(200.0, repeats=repeats)
    found = [(take(watch, ONES, ONES, k * MS), watch.suspect, watch.rests) for k in range(150)]
    assert set(found[1:]) == {("", True, repeats == 0)}, "it may hang all the same"
    for force, suspect in ((2.0, False), (100.0, True)):
        take(watch, force * ONES, ONES, 150 * MS)
        assert (watch.suspect, watch.rests) == (suspect, False)
