"""Messages are numbered without gaps and dated; their rate is limited by the time of their readings."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nanoseconds import MS

from slipd.events import Publish, WallClock
from slipd.publish.message_sequencer import MessageSequencer, Pace

T0 = 77_000_000_000


def test_each_topic_is_numbered_without_gaps() -> None:
    sequencer = MessageSequencer("b00t", "c0ffee", WallClock(0))
    topics = ["slip.left", "warning", "slip.left", "slip.right", "slip.left", "warning"]
    numbers = [sequencer.message(topic, T0, "", {}).body["seq"] for topic in topics]
    assert numbers == [0, 0, 1, 0, 2, 1]
    assert sequencer.published == 6


def test_every_message_has_the_head() -> None:
    sequencer = MessageSequencer("b00t", "c0ffee", WallClock(1_700_000_000_000_000_000))
    assert sequencer.message("warning", 1_500_000_000, "left_pad", {"x": 1}) == Publish(
        "warning",
        {
            "v": 1,
            "seq": 0,
            "boot": "b00t",
            "t_ns": 1_500_000_000,
            "timestamp": 1_700_000_001.5,
            "frame": "left_pad",
            "config_id": "c0ffee",
            "x": 1,
        },
        "left_pad",
    )


@pytest.mark.parametrize(
    ("readings", "passed"),
    [
        ([(k * MS, 0) for k in range(9)], [0, 4, 8]),
        ([(0, 0), (1000 * MS, 0), (1001 * MS, 0)], [0, 1]),
        ([(0, 0), (1, 0), (2, 1), (3, 1)], [0, 2]),
        ([*((k * MS, k) for k in range(1000)), *((k * MS, 999) for k in range(1000, 1004))], [*range(1001)]),
    ],
    ids=["one in four", "no making up for silence", "a change at once", "changes do not delay the regular"],
)
def test_a_pace_of_four_milliseconds(readings: list[tuple[int, int]], passed: list[int]) -> None:
    pace = Pace(250.0)
    assert [k for k, (t_ns, stated) in enumerate(readings) if pace.passes(T0 + t_ns, stated)] == passed


def test_a_pace_does_not_drift_against_readings_that_do_not_fit_it() -> None:
    pace = Pace(250.0)
    passed = sum(pace.passes(T0 + k * 3 * MS) for k in range(1000))
    assert passed == pytest.approx(3.0 * 250, abs=2), "3 ms readings at 4 ms: 750 of 1000, not every second"


@given(
    rate_hz=st.floats(1.0, 1000.0),
    steps=st.lists(st.tuples(st.integers(0, 20 * MS), st.booleans()), max_size=200),
)
def test_a_pace_is_never_exceeded(rate_hz: float, steps: list[tuple[int, bool]]) -> None:
    pace, t_ns, stated, passed = Pace(rate_hz), T0, 0, []
    for step_ns, changes in steps:
        t_ns, stated = t_ns + step_ns, stated + changes
        if pace.passes(t_ns, stated) and not changes:
            passed.append(t_ns)
    for first in passed:
        assert len([t for t in passed if first <= t < first + 10 * 1e9 / rate_hz]) <= 11
