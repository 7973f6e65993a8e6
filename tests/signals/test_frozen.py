"""A stream that hangs, raves or flickers is told; one that repeats itself now and then is not."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from slipd.signals import frozen
from slipd.signals.frozen import (
    DEFAULT_REPEATS,
    FLICKER_NS,
    FrozenImage,
    WrenchWatch,
    repeats_of_a_stuck_sensor,
)

MS = 1_000_000
Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data" / "grips" / "2022-02-22-08-10-01"


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 200.0, 500.0])
@pytest.mark.parametrize("seed", range(5))
def test_T3_an_array_that_hangs_while_the_force_moves_is_told_within_100_ms(rate_hz: float, seed: int) -> None:
    """From its first image that should have differed, with the times of receipt a millisecond to and fro."""
    rng = np.random.default_rng(seed)
    watch = FrozenImage(0.2)
    last = rng.normal(size=128)
    for k in range(round(rate_hz)):
        t_ns = round(k * 1e9 / rate_hz + MS * rng.uniform(-1.0, 1.0))
        last = rng.normal(size=128)
        assert not watch.update(last, t_ns, 5.0 + 3.0 * math.sin(6.0 * k / rate_hz))
    first_s = round(rate_hz) / rate_hz
    told_s = math.inf
    for k in range(round(rate_hz), 2 * round(rate_hz)):
        t_ns = round(k * 1e9 / rate_hz + MS * rng.uniform(-1.0, 1.0))
        if watch.update(last.copy(), t_ns, 5.0 + 6.0 * (k / rate_hz - first_s)):
            told_s = min(told_s, t_ns * 1e-9)
    assert told_s - first_s <= 0.100
    assert not watch.update(rng.normal(size=128), 3_000 * MS, 5.0)


def test_T3_an_array_may_rest_as_long_as_its_load_does() -> None:
    watch = FrozenImage(0.2)
    for k in range(1000):
        assert not watch.update(np.ones(4), k * 10 * MS, 5.0 + 0.09 * math.sin(k))
    assert watch.update(np.ones(4), 10_000 * MS, 5.3)
    blind = FrozenImage(0.2)
    assert not any(blind.update(np.ones(4), k * 10 * MS, None if k % 2 else math.nan) for k in range(1000))


def test_T3_the_repeated_images_of_a_real_pad_are_no_fault() -> None:
    with (DATA / "robot_state.csv").open(encoding="utf-8") as file:
        times_ns = [round(float(row["time"]) * 1e9) for row in csv.DictReader(file)]
    for sensor in (1, 2):
        readings = np.loadtxt(DATA / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)
        assert (readings[1:] == readings[:-1]).all(axis=1).mean() > 0.05
        watch = FrozenImage(100.0)
        for t_ns, row in zip(times_ns, readings, strict=True):
            assert not watch.update(row, t_ns, float(row[2:48:3].sum()))


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_a_step_or_range_that_is_none_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="force_step_n must be positive and finite"):
        FrozenImage(bad)
    with pytest.raises(ValueError, match="range_n must be positive and finite"):
        WrenchWatch(bad)


@given(std=st.floats(0.25, 1e6), components=st.integers(1, 6))
def test_more_noise_and_more_components_need_fewer_repeats(std: float, components: int) -> None:
    needed = repeats_of_a_stuck_sensor(std, components)
    assert needed >= 4
    assert repeats_of_a_stuck_sensor(2.0 * std, components) <= needed
    assert repeats_of_a_stuck_sensor(std, components + 1) <= needed


def test_the_default_is_for_a_noise_of_a_third_of_a_count() -> None:
    assert repeats_of_a_stuck_sensor(0.3) <= DEFAULT_REPEATS < repeats_of_a_stuck_sensor(0.28)


@pytest.mark.parametrize("std", [0.0, -1.0, 0.05, 1e-300, math.nan])
def test_a_noise_too_small_to_tell_anything_is_refused(std: float) -> None:
    with pytest.raises(ValueError, match="too small"):
        repeats_of_a_stuck_sensor(std)


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
def test_F1_a_stuck_sensor_is_told_as_soon_as_chance_allows_and_forgiven_at_once(seed: int) -> None:
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


@pytest.mark.parametrize("bad", [300.0, math.inf, -math.inf, math.nan])
def test_F1_values_beyond_the_range_are_garbage_but_for_a_single_one(bad: float) -> None:
    stream = Stream()
    stream.send(10)
    assert stream.give(bad, 0.0, 0.0) == ""
    assert set(stream.send(200)) == {""}
    for _ in range(4):
        said = stream.give(0.0, 0.0, bad)
    assert said == "garbage"


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


@pytest.mark.parametrize("bad", [[math.inf, -math.inf, 0.0], [1e200, -1e200, 1e200]])
def test_N3_numbers_that_overflow_warn_of_nothing(bad: list[float]) -> None:
    stream = Stream()
    stream.send(10)
    said = [stream.give(*(sign * part for part in bad)) for sign in (1.0, -1.0, 1.0, -1.0, -1.0)]
    assert (said[0], said[-1]) == ("", "garbage")


ROWS = st.sampled_from(("well", "well", "well", "again", "jump", "far", "nan", "inf"))
#: What each reading of a read is, and how long after the one before it came, ms.
READS = st.lists(st.lists(st.tuples(ROWS, st.sampled_from((0, 1, 1, 1, 7, 21))), min_size=1, max_size=8), max_size=8)


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
def test_readings_that_come_together_are_told_of_as_if_they_came_singly(
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
        assert together.fault == singly.fault
        t_ns, last = times_ns[-1], rows[-1]


@given(kinds=st.lists(ROWS, min_size=1, max_size=5), seed=st.integers(0, 99))
def test_the_kernel_does_what_it_does_without_compilation(kinds: list[str], seed: int) -> None:
    before = np.full(6, 5.0)
    rows = rows_of(kinds, np.random.default_rng(seed), before)
    lively = frozen._is_lively(before, rows, 1e4, 625.0)
    plain = getattr(frozen._is_lively, "py_func", frozen._is_lively)
    with np.errstate(invalid="ignore"):
        assert plain(before, rows, 1e4, 625.0) == lively == (set(kinds) == {"well"})
