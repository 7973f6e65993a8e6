"""A force stream that is stuck, out of range or intermittent is reported; occasional repeats are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.arrays import Array
from slipd.signals.frozen import (
    DEFAULT_REPEATS,
    FLICKER_NS,
    Habit,
    WrenchWatch,
)
from slipd.signals.reading_comparison import any_finding, compare

MS = 1_000_000


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_an_invalid_range_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="range_n must be positive and finite"):
        WrenchWatch(bad)
    with pytest.raises(ValueError, match="range_nm must be positive and finite"):
        WrenchWatch(100.0, bad)


def test_the_default_is_for_a_noise_of_a_third_of_a_count() -> None:
    by_chance = {std: math.erf(0.5 / (math.sqrt(2.0) * std)) ** (6 * DEFAULT_REPEATS) for std in (0.28, 0.3)}
    assert by_chance[0.3] < 1e-12 < by_chance[0.28]


def take(watch: WrenchWatch, force: Array, torque: Array, t_ns: int) -> str:
    """What is said of a reading that comes alone."""
    six = (*force.tolist(), *torque.tolist())
    said = watch.update([six], [t_ns], np.array([six]))
    assert said == ({0: watch.fault} if watch.fault else {})
    return watch.fault


class Stream:
    """A force sensor at 1 kHz with noise of 0.3 counts of 10 mN, and what is said of it."""

    def __init__(self, seed: int = 0, **options: float) -> None:
        self.rng = np.random.default_rng(seed)
        self.watch = WrenchWatch(200.0, **options)  # type: ignore[arg-type]
        self.t_ns = 0
        self.force, self.torque = np.zeros(3), np.zeros(3)

    def send(self, count: int = 1, at: float = 5.0) -> list[str]:
        said = []
        for _ in range(count):
            self.force = 0.01 * np.rint(100.0 * at + 0.3 * self.rng.normal(size=3))
            self.torque = 0.001 * np.rint(0.3 * self.rng.normal(size=3))
            said.append(self.repeat()[0])
        return said

    def repeat(self, count: int = 1) -> list[str]:
        said = []
        for _ in range(count):
            self.t_ns += MS
            said.append(take(self.watch, self.force, self.torque, self.t_ns))
        return said

    def give(self, *force: float) -> str:
        self.force = np.array(force)
        return self.repeat()[0]


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


@pytest.mark.parametrize("rate_hz", [30.0, 43.0, 60.0, 100.0, 200.0, 500.0, 1000.0, 4000.0])
def test_F1_at_any_rate_a_repeat_is_suspect_at_once_and_a_stuck_sensor_is_reported_within_100_ms(
    rate_hz: float,
) -> None:
    rng = np.random.default_rng(3)
    watch = WrenchWatch(200.0, gap_ns=200 * MS)
    live = round(2.0 * rate_hz)
    said, suspect = [], []
    for k in range(2 * live):
        if k < live:
            six = rng.normal(size=6)
        said.append(take(watch, six[:3], six[3:], round(k * 1e9 / rate_hz)))
        suspect.append(watch.suspect)
    assert not any(suspect[1:live])
    assert all(suspect[live:])
    assert (said.index("stuck") - (live - 1)) / rate_hz <= 0.1
    assert set(said[live + round(0.1 * rate_hz) :]) == {"stuck"}
    assert take(watch, -six[:3], six[3:], round(2 * live * 1e9 / rate_hz)) == ""
    assert not watch.suspect


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_F1_what_a_coarse_sensor_is_used_to_is_neither_stuck_nor_suspect(rate_hz: float) -> None:
    """Its noise is 0.3 counts: more than half of its readings repeat the one before."""
    rng = np.random.default_rng(4)
    watch = WrenchWatch(200.0, gap_ns=200 * MS)
    said, suspect = [], []
    for k in range(20_000):
        six = 0.01 * np.rint(0.3 * rng.normal(size=6))
        said.append(take(watch, six[:3], six[3:], round(k * 1e9 / rate_hz)))
        suspect.append(watch.suspect)
    assert set(said) == {""}
    assert np.mean(suspect[5_000:]) < 0.01


def test_F1_a_device_that_hands_on_each_conversion_four_times_is_not_suspect() -> None:
    rng = np.random.default_rng(5)
    watch = WrenchWatch(200.0)
    suspect = []
    for k in range(400):
        if k % 4 == 0:
            six = rng.normal(size=6)
        take(watch, six[:3], six[3:], k * MS)
        suspect.append(watch.suspect)
    assert not any(suspect[20:])


def test_F1_a_sensor_that_hung_twice_is_reported_as_soon_the_third_time() -> None:
    """Runs that are rare, or that were reported, are no habit."""
    rng = np.random.default_rng(6)
    watch = WrenchWatch(200.0)
    t_ns = 0
    for hung_ms in (60, 300, 60, 300, 90):
        for _ in range(200):
            six = rng.normal(size=6)
            t_ns += 5 * MS
            take(watch, six[:3], six[3:], t_ns)
        said = []
        for _ in range(hung_ms // 5):
            t_ns += 5 * MS
            said.append(take(watch, six[:3], six[3:], t_ns))
            assert watch.suspect
    assert said.index("stuck") == 13, "70 ms"


def test_F1_a_habit_is_forgotten() -> None:
    habit = Habit()
    habit.age(0)
    for _ in range(3):
        habit.learn(7)
    for at_s, repeats in ((5, 7), (11, 7), (12, 7), (22, 0)):
        habit.age(at_s * 1_000 * MS)
        assert habit.repeats == repeats
    habit.learn(3)
    habit.age(60_000 * MS)
    assert habit.repeats == 0


def test_F1_a_run_that_ends_with_readings_that_come_together_is_a_habit_too() -> None:
    rng = np.random.default_rng(7)
    watch = WrenchWatch(200.0)
    six, t_ns = rng.normal(size=6), 0
    for k in range(4):
        for _ in range(3):
            t_ns += MS
            take(watch, six[:3], six[3:], t_ns)
        assert watch.suspect is (k < 3), "the fourth time it is used to two repeats"
        rows = rng.normal(size=(2, 6))
        t_ns += 2 * MS
        assert watch.update([*map(tuple, rows.tolist())], [t_ns - MS, t_ns], rows) == {}
        assert watch.lively
        six = rng.normal(size=6)


def test_readings_that_arrive_together_and_differ_are_lively() -> None:
    watch = WrenchWatch(200.0)
    rows = np.random.default_rng(8).normal(size=(6, 6))
    for read in (slice(0, 1), slice(1, 4), slice(4, 6)):
        times_ns = [MS * k for k in range(6)][read]
        assert watch.update([*map(tuple, rows[read].tolist())], times_ns, rows[read]) == {}
    assert watch.lively
    assert not watch.suspect


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


ROWS = st.sampled_from(("well", "well", "well", "again", "jump", "far", "nan", "inf"))
READS = st.lists(st.lists(st.tuples(ROWS, st.sampled_from((0, 1, 1, 1, 7, 21))), min_size=1, max_size=8), max_size=8)
"""What each reading of a read is, and how long after the one before it came, ms."""


def rows_of(kinds: list[str], rng: np.random.Generator, last: Array) -> Array:
    """Readings of a sensor with range 100 N that follow ``last``."""
    rows = []
    for kind in kinds:
        stays = np.abs(last[:3]).max() < 100.0  # false for what is no number
        row = np.concatenate(((last[:3] if stays else 5.0) + 0.01 * rng.normal(size=3), 0.001 * rng.normal(size=3)))
        if kind == "again":
            row = last
        elif kind != "well":
            wrong = {"jump": 60.0, "far": 150.0, "nan": math.nan, "inf": math.inf}[kind]
            row[rng.integers(3)] = wrong * rng.choice((-1.0, 1.0))
        rows.append(row)
        last = row
    return np.array(rows)


@given(reads=READS, seed=st.integers(0, 99), failed=st.booleans())
def test_readings_that_arrive_together_are_judged_as_if_they_arrived_singly(
    reads: list[list[tuple[str, int]]], seed: int, failed: bool
) -> None:
    together, singly = (WrenchWatch(100.0, repeats=4) for _ in range(2))
    rng = np.random.default_rng(seed)
    t_ns, last = 0, np.ones(6)
    before = [[("again", 1)] * 30, [("well", 40)], [("well", 40)]] if failed else []
    for read in [*before, *reads]:
        rows = rows_of([kind for kind, _ in read], rng, last)
        times_ns = (t_ns + MS * np.cumsum([ms for _, ms in read])).tolist()
        found = {}
        for at, (row, row_ns) in enumerate(zip(rows, times_ns, strict=True)):
            if singly.update([tuple(row.tolist())], [row_ns], row.reshape(1, 6)):
                found[at] = singly.fault
        assert together.update([*map(tuple, rows.tolist())], times_ns, rows) == found
        assert (together.fault, together.suspect) == (singly.fault, singly.suspect)
        t_ns, last = times_ns[-1], rows[-1]


@given(kinds=st.lists(ROWS, min_size=1, max_size=5), seed=st.integers(0, 99))
def test_the_kernel_does_what_it_does_without_compilation(kinds: list[str], seed: int) -> None:
    before, limits = (5.0,) * 6, (100.0, 10.0, 25.0)
    rows = rows_of(kinds, np.random.default_rng(seed), np.array(before))
    found = any_finding(before, rows, *limits)
    assert found == (set(kinds) != {"well"})
    if hasattr(any_finding, "py_func"):
        assert any_finding.py_func(before, rows, *limits) == found
    plain = getattr(compare, "py_func", compare)
    for row, last in zip(rows, (before, *rows), strict=False):
        with np.errstate(invalid="ignore"):
            assert plain(last, row, *limits) == compare(tuple(last), tuple(row), *limits)


@pytest.mark.parametrize(
    ("row", "fault", "jumps"),
    [
        ((math.nan, 0.0, 0.0, 0.0, 0.0, 0.0), "garbage", False),
        ((0.0, 0.0, 0.0, math.nan, 0.0, 0.0), "", False),
        ((0.0, 0.0, 0.0, math.nan, math.inf, 0.0), "garbage", False),
        ((math.inf, math.nan, 0.0, 0.0, 0.0, 0.0), "garbage", True),
    ],
)
def test_N1_a_force_without_a_value_is_impossible_and_a_torque_without_one_is_not(
    row: tuple[float, ...], fault: str, jumps: bool
) -> None:
    watch = WrenchWatch(100.0)
    watch.update([(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)], [0], np.empty((0, 6)))
    watch.update([row], [MS], np.empty((0, 6)))
    assert not watch.lively
    assert watch.suspect is jumps
    for k in range(2, 6):
        watch.update([row], [k * MS], np.empty((0, 6)))
    assert watch.fault == fault
