"""A force stream that is stuck, out of range or intermittent is reported; repeats that it is used to are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nanoseconds import MS
from plain_kernels import run_without_compilation

from slipd.fusion.rows import NOT_FINITE
from slipd.fusion.streaming import new_readings
from slipd.signals import frozen
from slipd.signals.frozen import DEFAULT_REPEATS, FAULTS, FLICKER_NS, WrenchWatch
from slipd.types.arrays import Array


@pytest.fixture(params=["compiled", "plain"])
def both_ways(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test with the compiled kernels, and without compilation."""
    if request.param == "plain":
        run_without_compilation(monkeypatch, frozen)


def take(watch: WrenchWatch, force: Array, torque: Array, t_ns: int) -> str:
    """Return the fault that is reported of a reading that arrives alone."""
    six = (*force.tolist(), *torque.tolist())
    rows = new_readings([six], [t_ns])
    doubted, doubts = watch.update(rows), int(rows["doubts"][0])
    assert doubted == (doubts != 0)
    assert (bool(doubts & NOT_FINITE), FAULTS[doubts & ~NOT_FINITE]) == (not np.isfinite(six).all(), watch.fault)
    return watch.fault


class Stream:
    """A force sensor at 1 kHz with noise of 0.3 counts of 10 mN, and the faults that are reported of it."""

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


ONES, NONE = np.ones(3), np.zeros(3)


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
    assert not stream.watch.suspect, "nothing of the blows is left"


@pytest.mark.usefixtures("both_ways")
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


def watched(rate_hz: float, readings: np.ndarray) -> tuple[list[str], list[bool]]:
    """Return what is said of readings that come one by one, and whether each is suspect."""
    watch = WrenchWatch(200.0, gap_ns=200 * MS)
    said, suspect = [], []
    for k, six in enumerate(readings):
        said.append(take(watch, six[:3], six[3:], round(k * 1e9 / rate_hz)))
        suspect.append(watch.suspect)
    return said, suspect


@pytest.mark.parametrize("rate_hz", [30.0, 43.0, 60.0, 100.0, 200.0, 500.0, 1000.0, 4000.0])
def test_F1_at_any_rate_a_repeat_is_suspect_at_once_and_a_stuck_sensor_is_reported_within_100_ms(
    rate_hz: float,
) -> None:
    live, late = round(2.0 * rate_hz), round(0.1 * rate_hz)
    readings = np.random.default_rng(3).normal(size=(live, 6))
    said, suspect = watched(rate_hz, np.vstack((readings, np.tile(readings[-1], (live, 1)), readings[:1])))
    assert suspect == [suspect[0], *[False] * (live - 1), *[True] * live, False]
    assert (said.index("stuck") - (live - 1)) / rate_hz <= 0.1
    assert (set(said[live + late : -1]), said[-1]) == ({"stuck"}, "")


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_F1_what_a_coarse_sensor_is_used_to_is_neither_stuck_nor_suspect(rate_hz: float) -> None:
    """Its noise is 0.3 counts: more than half of its readings repeat the one before."""
    said, suspect = watched(rate_hz, 0.01 * np.rint(0.3 * np.random.default_rng(4).normal(size=(20_000, 6))))
    assert set(said) == {""}
    assert np.mean(suspect[5_000:]) < 0.01


def test_F1_a_device_that_hands_on_each_conversion_four_times_is_not_suspect() -> None:
    assert not any(watched(1000.0, np.repeat(np.random.default_rng(5).normal(size=(100, 6)), 4, axis=0))[1][20:])


def test_F1_a_sensor_that_hung_twice_is_reported_as_soon_the_third_time() -> None:
    """Runs that are rare, or that were reported, are no habit."""
    rng, hung = np.random.default_rng(6), (12, 60, 12, 60, 18)
    parts = [np.vstack((live, np.tile(live[-1], (n, 1)))) for n in hung for live in [rng.normal(size=(200, 6))]]
    said, suspect = watched(200.0, np.vstack(parts))
    assert said[-18:].index("stuck") == 13, "70 ms"
    assert all(suspect[-18:])


@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize(
    ("step_ms", "repeats", "runs", "stuck", "suspect"),
    [
        *((1, repeats, (), stuck, 1) for repeats, stuck in ((0, None), (4, 20), (50, 50), (51, 51), (100, 100))),
        *((5, repeats, (), stuck, 1) for repeats, stuck in ((4, 4), (50, 14), (51, 51))),
        *((10, repeats, (), stuck, 1) for repeats, stuck in ((4, 4), (50, 7), (51, 51))),
        *((30, repeats, (), stuck, 1) for repeats, stuck in ((4, 3), (50, 3), (51, 51))),
        # what it is used to
        *((1, 50, 3 * (run,), 50, run + 1) for run in (0, 1, 3, 6)),
        *((5, 50, runs, stuck, suspect) for runs, stuck, suspect in (((3, 3, 3), 14, 4), ((6, 6, 6), 21, 7))),
        *((10, 50, runs, stuck, suspect) for runs, stuck, suspect in (((3, 3, 3), 12, 4), ((6, 6, 6), 21, 6))),
        (5, 50, (6, 6), 14, 1),
    ],
)
def test_F1_a_sensor_is_stuck_and_suspect_from_these_repeats_on(
    step_ms: int, repeats: int, runs: tuple[int, ...], stuck: int | None, suspect: int
) -> None:
    watch, found = WrenchWatch(200.0, repeats=repeats, gap_ns=300 * MS), []
    readings = [run for run, length in enumerate((*runs, 200)) for _ in range(length + 1)]
    for k, run in enumerate(readings):
        found.append((take(watch, 0.1 * run * ONES, NONE, k * step_ms * MS), watch.suspect))
    faults, suspicions = zip(*found[-201:], strict=True)
    assert (faults.index("stuck") if "stuck" in faults else None, suspicions.index(True)) == (stuck, suspect)


@pytest.mark.usefixtures("both_ways")
@pytest.mark.parametrize(
    ("force_n", "times", "found"),
    [
        *((300.0, times, (times, 0 if times == 1 else 61)) for times in (1, 2, 3, 4, 8, 20)),
        (60.0, 2, (0, 0)), (60.0, 3, (0, 61)),
        (60.0, 5, (2, 61)), (24.9, 8, (0, 0)), (25.1, 8, (4, 60)),
    ],
)  # fmt: skip
def test_F1_readings_to_and_fro_are_garbage_and_leave_this_much_of_it(
    force_n: float, times: int, found: tuple[int, int]
) -> None:
    """Values beyond the range, and jumps by more than a quarter of it; how many are garbage, of them and after them."""
    watch = WrenchWatch(200.0)
    forces = [*(0.01 * np.arange(50)), *(force_n * (-1.0) ** np.arange(times)), *(0.01 * np.arange(200))]
    said = [take(watch, np.roll((x, 0.0, 1.0), times), NONE, k * MS) for k, x in enumerate(forces)]
    assert (said[: 50 + times].count("garbage"), said[50 + times :].count("garbage")) == found


@pytest.mark.usefixtures("both_ways")
def test_F1_a_habit_is_forgotten() -> None:
    """Runs of 7 repeats, which are a habit after the third; one or two are chance."""
    watch = WrenchWatch(200.0, gap_ns=20_000 * MS)
    for at_s, usual in ((0, 0), (1, 0), (2, 0), (5, 7), (11, 7), (12, 7), (25, 0)):
        found = []
        for k in range(9):
            take(watch, (10.0 + at_s + 0.5 * (k == 8)) * ONES, NONE, (1_000 * at_s + k) * MS)
            found.append(watch.suspect)
        assert found == [False] + [usual == 0] * 7 + [False]


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
        assert not watch.update(new_readings(rows.tolist(), [t_ns - MS, t_ns]))
        assert (watch.fault, watch.suspect) == ("", False)
        six = rng.normal(size=6)
