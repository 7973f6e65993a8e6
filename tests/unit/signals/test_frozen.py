"""A force stream that is stuck, out of range or intermittent is reported; occasional repeats are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from watched_wrench import MS, Stream, take

from slipd.signals.frozen import DEFAULT_REPEATS, FLICKER_NS, WrenchWatch


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_an_invalid_range_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="range_n must be positive and finite"):
        WrenchWatch(bad)
    with pytest.raises(ValueError, match="range_nm must be positive and finite"):
        WrenchWatch(100.0, bad)


def test_the_default_is_for_a_noise_of_a_third_of_a_count() -> None:
    by_chance = {std: math.erf(0.5 / (math.sqrt(2.0) * std)) ** (6 * DEFAULT_REPEATS) for std in (0.28, 0.3)}
    assert by_chance[0.3] < 1e-12 < by_chance[0.28]


def test_F1_a_coarse_sensor_at_rest_is_not_stuck() -> None:
    assert set(Stream().send(20_000)) == {""}


@pytest.mark.parametrize("seed", range(20))
def test_F1_a_stuck_sensor_is_reported_as_soon_as_chance_is_ruled_out_and_cleared_at_once(seed: int) -> None:
    stream = Stream(seed)
    stream.send(200)
    said = stream.repeat(200)
    assert said.index("stuck") <= DEFAULT_REPEATS
    assert set(said[DEFAULT_REPEATS:]) == {"stuck"}
    assert stream.give(5.0, 5.0, 5.5) == ""


def test_F1_a_few_repeats_in_a_short_time_are_one_conversion_sent_often() -> None:
    watch = WrenchWatch(200.0, repeats=4)
    force, torque, none = np.ones(3), np.ones(3), np.zeros(3)
    said = [take(watch, force, torque, k * MS) for k in range(40)]
    assert said.index("stuck") == 20
    assert take(watch, force, none, 40 * MS) == "", "its torque moves"
    without = WrenchWatch(200.0, repeats=4)
    assert [take(without, force, none, k * 5 * MS) for k in range(6)] == ["", "", "", "", "stuck", "stuck"]
    assert take(without, force, torque, 30 * MS) == "", "it has a torque now"


@pytest.mark.parametrize("seed", range(20))
def test_F1_random_values_are_garbage_within_ten_readings_and_until_they_have_been_gone(seed: int) -> None:
    stream = Stream(seed)
    stream.send(100)
    said = [stream.give(*stream.rng.uniform(-200.0, 200.0, 3)) for _ in range(50)]
    assert "garbage" in said[:10]
    assert said[-1] == "garbage"
    said = stream.send(100)
    assert said[:20] == ["garbage"] * 20
    assert said[-1] == ""


@pytest.mark.parametrize(("bad", "single"), [(300.0, "garbage"), (math.inf, ""), (-math.inf, ""), (math.nan, "")])
def test_F1_values_beyond_the_range_are_garbage_and_a_single_one_spoils_no_other(bad: float, single: str) -> None:
    """What is not finite is no fault of the stream before it comes again; whoever reads it sees it by itself."""
    stream = Stream()
    stream.send(10)
    assert stream.give(bad, 0.0, 0.0) == single
    assert set(stream.send(200)) == {""}
    for _ in range(4):
        said = stream.give(0.0, 0.0, bad)
    assert said == "garbage"


def test_F1_a_torque_beyond_its_range_is_garbage() -> None:
    watch = WrenchWatch(200.0, 5.0)
    force = np.ones(3)
    assert take(watch, force, np.array((0.0, 0.0, 4.9)), MS) == ""
    assert take(watch, force, np.array((0.0, 3.6, -3.6)), 2 * MS) == "garbage"
    assert take(watch, force, np.zeros(3), 3 * MS) == ""
    absurd = WrenchWatch()
    assert take(absurd, force, np.array((0.0, 0.0, 3e38)), MS) == "garbage", "no sensor states that"


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_N1_one_reading_that_is_no_number_poisons_nothing(bad: float) -> None:
    stream = Stream()
    stream.send(50)
    stream.give(bad, bad, bad)
    assert set(stream.send(500)) == {""}
    assert "stuck" in stream.repeat(100)


def test_F1_a_blow_is_not_garbage() -> None:
    stream = Stream()
    assert set(stream.send(100) + stream.send(100, at=90.0) + stream.send(100, at=2.0)) == {""}
    said = [stream.give(0.0, 0.0, -60.0 * math.sin(k)) for k in range(3)]
    assert set(said) == {""}


def test_F1_blows_that_follow_each_other_with_readings_between_are_not_garbage() -> None:
    stream = Stream()
    assert {stream.give(force_n, 0.0, 0.0) for force_n in (90.0, 90.5, 2.0, 2.5, 90.0, 90.5)} == {""}
    assert stream.watch.lively, "nothing of the blows is left"


def test_F1_a_stream_that_fails_again_and_again_is_intermittent_until_it_has_been_well_for_long() -> None:
    stream = Stream()
    for _ in range(2):
        stream.send(300)
        stream.t_ns += 100 * MS
        assert stream.send() == [""]
    stream.send(300)
    stream.t_ns += 100 * MS
    assert stream.send() == ["intermittent"]
    stream.repeat(200)
    assert stream.give(5.0, 5.0, 5.5) == "intermittent"
    said = stream.send(FLICKER_NS // MS + 2)
    assert (said[0], said[-1]) == ("intermittent", "")


def test_F1_failures_far_apart_are_not_intermittent() -> None:
    stream = Stream()
    for _ in range(5):
        stream.send(6_000)
        stream.t_ns += 100 * MS
        assert stream.send() == [""]


def test_F1_equal_readings_before_and_behind_a_gap_are_two_runs() -> None:
    stream = Stream()
    stream.send(10)
    stream.repeat(45)
    stream.t_ns += 100 * MS
    assert set(stream.repeat(45)) == {""}


def test_F1_a_reading_that_repeats_the_one_before_a_gap_is_suspect() -> None:
    stream = Stream()
    stream.send(10)
    stream.t_ns += 100 * MS
    stream.repeat()
    assert stream.watch.suspect


@pytest.mark.parametrize("bad", [[math.inf, -math.inf, 0.0], [1e200, -1e200, 1e200]])
def test_N3_numbers_that_overflow_warn_of_nothing(bad: list[float]) -> None:
    stream = Stream()
    stream.send(10)
    said = [stream.give(*(sign * part for part in bad)) for sign in (1.0, -1.0, 1.0, -1.0, -1.0)]
    assert (said[0], said[-1]) == ("garbage" if math.isfinite(bad[0]) else "", "garbage")


@pytest.mark.parametrize("repeats", [0, 200])
def test_F1_a_sensor_whose_readings_rest_is_not_stuck_by_time(repeats: int) -> None:
    watch = WrenchWatch(200.0, repeats=repeats)
    ones = np.ones(3)
    said, suspect, rests = [], [], []
    for k in range(150):
        said.append(take(watch, ones, ones, k * MS))
        suspect.append(watch.suspect)
        rests.append(watch.rests)
    assert set(said) == {""}
    assert suspect[1:] == [True] * 149, "it may hang all the same"
    assert rests[1:] == [repeats == 0] * 149
    take(watch, 2.0 * ones, ones, 150 * MS)
    assert not watch.suspect
    assert not watch.rests


def test_F1_a_jump_is_no_rest() -> None:
    watch = WrenchWatch(200.0, repeats=0)
    for k, force_n in enumerate((0.0, 0.0, 100.0)):
        take(watch, np.array((0.0, 0.0, force_n)), np.zeros(3), k * MS)
    assert watch.suspect
    assert not watch.rests
