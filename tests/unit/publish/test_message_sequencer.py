"""Messages are numbered without gaps, dated, and limited in rate by the time of their readings."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.publish.message_sequencer import MessageSequencer, Pace
from slipd.types.clocks import WallClock

MS = 1_000_000
T0 = 77_000_000_000


def test_each_topic_is_numbered_without_gaps() -> None:
    sequencer = MessageSequencer("b00t", "c0ffee", WallClock(0))
    topics = ["slip.left", "warning", "slip.left", "slip.right", "slip.left", "warning"]
    numbers = [sequencer.message(topic, T0, "", {}).body["seq"] for topic in topics]
    assert numbers == [0, 0, 1, 0, 2, 1]
    assert sequencer.published == 6


def test_every_message_has_the_head() -> None:
    made = MessageSequencer("b00t", "c0ffee", WallClock(1_700_000_000_000_000_000)).message(
        "warning", 1_500_000_000, "left_pad", {"x": 1}
    )
    assert made.topic == "warning"
    assert made.body == {
        "v": 1,
        "seq": 0,
        "boot": "b00t",
        "t_ns": 1_500_000_000,
        "timestamp": 1_700_000_001.5,
        "frame": "left_pad",
        "config_id": "c0ffee",
        "x": 1,
    }


def test_a_pace_lets_one_reading_in_four_pass() -> None:
    pace = Pace(250.0)
    assert [pace.passes(T0 + k * MS) for k in range(9)] == [True, False, False, False] * 2 + [True]


def test_a_pace_does_not_drift_against_readings_that_do_not_fit_it() -> None:
    pace = Pace(250.0)
    passed = sum(pace.passes(T0 + k * 3 * MS) for k in range(1000))
    assert passed == pytest.approx(3.0 * 250, abs=2), "3 ms readings at 4 ms: 750 of 1000, not every second"


def test_a_pace_does_not_make_up_for_silence() -> None:
    pace = Pace(250.0)
    pace.passes(T0)
    assert pace.passes(T0 + 1000 * MS)
    assert not pace.passes(T0 + 1001 * MS)


def test_an_urgent_message_passes_at_once() -> None:
    pace = Pace(250.0)
    pace.passes(T0)
    assert not pace.passes(T0 + 1)
    assert pace.passes(T0 + 2, now=True)


def test_urgent_messages_do_not_delay_the_regular_ones() -> None:
    """After a second of changes at every reading the next regular message is on time."""
    pace = Pace(250.0)
    assert all(pace.passes(T0 + k * MS, now=True) for k in range(1000))
    assert any(pace.passes(T0 + (1000 + k) * MS) for k in range(4))


@given(
    rate_hz=st.floats(1.0, 1000.0),
    steps=st.lists(st.tuples(st.integers(0, 20 * MS), st.booleans()), max_size=200),
)
def test_a_pace_is_never_exceeded(rate_hz: float, steps: list[tuple[int, bool]]) -> None:
    pace, t_ns, passed = Pace(rate_hz), T0, []
    for step_ns, now in steps:
        t_ns += step_ns
        if pace.passes(t_ns, now=now) and not now:
            passed.append(t_ns)
    period_ns = 1e9 / rate_hz
    for first in range(len(passed)):
        assert len([t for t in passed if passed[first] <= t < passed[first] + 10 * period_ns]) <= 11
