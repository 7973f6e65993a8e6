"""Frames at a fixed rate: the newest value at each time, with its age, and never a later one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from nanoseconds import MS

from slipd.errors import SlipdError
from slipd.tools.export.frames import (
    AGE,
    LEVEL,
    STATE,
    UNKNOWN_LEVEL,
    Feature,
    FrameLayout,
    FrameSampler,
    Tap,
)

LAYOUT = FrameLayout(
    (
        Feature(STATE, ("x", "y", "z", "utilisation")),
        Feature(LEVEL, ("left",), "int64"),
        Feature(AGE, ("wrench.left", "slip.left")),
    ),
    {
        "wrench.left": (Tap(STATE, slice(0, 3), "force_n"),),
        "slip.left": (Tap(STATE, slice(3, 4), "utilisation"), Tap(LEVEL, slice(0, 1), "level_code")),
    },
    {},
)
BEGIN = 5_000_000_000_000


class Run:
    """A sampler whose frames are kept, and times in ms since the begin."""

    def __init__(self, rate_hz: int) -> None:
        self.frames: list[dict[str, list[float]]] = []
        self.sampler = FrameSampler(LAYOUT, rate_hz, self._keep, "run.mcap")

    def _keep(self, frame: dict[str, np.ndarray[Any, Any]]) -> None:
        self.frames.append({name: numbers.tolist() for name, numbers in frame.items()})

    def wrench(self, ms: float, force_n: list[float] | None, age_ms: float | None = 0.0) -> None:
        self._message(ms, "wrench.left", {"force_n": force_n, "age_s": None if age_ms is None else age_ms * 1e-3})

    def slip(self, ms: float, code: int, utilisation: float | None) -> None:
        t_ns = BEGIN + round(ms * MS)
        self._message(ms, "slip.left", {"level_code": code, "utilisation": utilisation, "t_ns": t_ns - 2 * MS})

    def _message(self, ms: float, topic: str, body: dict[str, Any]) -> None:
        t_ns = BEGIN + round(ms * MS)
        self.sampler.event(t_ns)
        self.sampler.message(t_ns, topic, body)


def test_a_frame_has_the_newest_values_published_until_then() -> None:
    run = Run(100)
    for ms in range(40):
        run.wrench(ms, [float(ms), 0.0, 0.0], age_ms=1.5)
    run.sampler.finish()
    assert [frame[STATE][0] for frame in run.frames] == [0.0, 10.0, 20.0, 30.0]
    assert [frame[AGE][0] for frame in run.frames] == pytest.approx([1.5e-3] * 4)


def test_a_held_value_ages_and_what_was_never_published_is_missing() -> None:
    run = Run(100)
    run.slip(0, 1, 0.5)
    run.wrench(0, None, age_ms=None)
    run.slip(30, 2, None)
    run.slip(50, 4, 1.0)
    run.sampler.finish()
    assert [frame[LEVEL] for frame in run.frames] == [[1], [1], [1], [2], [2], [4]]
    np.testing.assert_array_equal([frame[STATE][3] for frame in run.frames], [0.5] * 3 + [math.nan] * 2 + [1.0])
    assert [frame[AGE][1] for frame in run.frames] == pytest.approx([2e-3, 12e-3, 22e-3, 2e-3, 12e-3, 2e-3])
    assert all(math.isnan(number) for frame in run.frames for number in (*frame[STATE][:3], frame[AGE][0]))


def test_nothing_is_known_in_a_gap_of_the_recording() -> None:
    run = Run(20)
    run.slip(0, 1, 0.5)
    for ms in range(0, 100, 10):
        run.wrench(ms, [1.0, 2.0, 3.0])
    run.wrench(320, [4.0, 5.0, 6.0])
    run.wrench(350, [7.0, 8.0, 9.0])
    run.sampler.finish()
    assert [frame[LEVEL] for frame in run.frames] == [[1], [1]] + [[UNKNOWN_LEVEL]] * 6
    np.testing.assert_array_equal([frame[STATE][0] for frame in run.frames], [1.0] * 2 + [math.nan] * 5 + [7.0])
    assert all(math.isnan(frame[AGE][0]) for frame in run.frames[2:7])


def test_topics_without_a_place_are_left_out_and_events_without_messages_go_on() -> None:
    run = Run(10)
    run.sampler.event(BEGIN - 50 * MS)
    run.sampler.finish()
    assert run.frames == []
    assert run.sampler.begin_ns is None
    run._message(0, "status", {"t_ns": BEGIN})
    for ms in (90, 180, 200):
        run.sampler.event(BEGIN + ms * MS)
    run.sampler.finish()
    assert run.sampler.begin_ns == BEGIN
    assert len(run.frames) == 3


def test_a_jump_of_years_is_refused_at_once() -> None:
    run = Run(50)
    run.wrench(0.0, [1.0, 2.0, 3.0])
    with pytest.raises(
        SlipdError, match=r"run\.mcap: a gap .* at most 3600 s, .*; 0\.0 s after the first message one of 94608000 s"
    ):
        run.sampler.event(BEGIN + 3 * 365 * 86_400_000 * MS)
    assert len(run.frames) == 0
