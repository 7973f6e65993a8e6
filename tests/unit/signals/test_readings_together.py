"""Readings that arrive together are judged as if they arrived one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nanoseconds import MS
from plain_kernels import run_without_compilation

from slipd.fusion.streaming import new_readings
from slipd.signals import frozen
from slipd.signals.frozen import WrenchWatch
from slipd.types.arrays import Array

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
            alone = new_readings([row.tolist()], [row_ns])
            if singly.update(alone):
                found[at] = int(alone["doubts"][0])
        readings = new_readings(rows.tolist(), times_ns)
        assert together.update(readings) == bool(found)
        assert readings["doubts"].tolist() == [found.get(at, 0) for at in range(len(rows))]
        assert (together.fault, together.suspect) == (singly.fault, singly.suspect)
        t_ns, last = times_ns[-1], rows[-1]


@given(kinds=st.lists(ROWS, min_size=1, max_size=20), seed=st.integers(0, 99), step_ms=st.sampled_from((1, 7, 30)))
def test_the_kernel_does_what_it_does_without_compilation(kinds: list[str], seed: int, step_ms: int) -> None:
    rows = rows_of(kinds, np.random.default_rng(seed), np.full(6, 5.0))
    found = []
    for plain in (False, True):
        watch = WrenchWatch(100.0, 10.0)
        readings = new_readings(rows.tolist(), [k * step_ms * MS for k in range(len(kinds))])
        with pytest.MonkeyPatch.context() as patch, np.errstate(invalid="ignore"):
            run_without_compilation(patch, *[frozen] * plain)
            found.append((watch.update(readings), repr(readings), watch.suspect, repr(watch._stream)))
    assert found[0] == found[1]


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
    good = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    watch.update(new_readings([good], [0]))
    assert watch.update(new_readings([row], [MS]))
    assert watch.suspect is jumps
    for k in range(2, 6):
        watch.update(new_readings([row], [k * MS]))
    assert watch.fault == fault
