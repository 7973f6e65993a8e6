"""Silence and age of one stream."""

from __future__ import annotations

import pytest
from finger_bench import MS, T0

from slipd.finger.freshness import PROMPT, Arrival, Freshness

STALE_NS = 20 * MS


def test_stream_is_stale_but_not_silent_before_the_first_reading() -> None:
    freshness = Freshness(STALE_NS)
    assert freshness.is_stale(T0)
    assert freshness.silent_ns(T0) == 0


@pytest.mark.parametrize(
    ("arrival", "came_ns"),
    [
        (PROMPT, T0),
        (Arrival(500 * MS), T0 - 80 * MS),
        (Arrival(500 * MS, dated=False), T0),
    ],
)
def test_reading_that_waited_came_within_stale_ns_of_its_acquisition(arrival: Arrival, came_ns: int) -> None:
    freshness = Freshness(STALE_NS)
    freshness.update(T0, T0 - 100 * MS, arrival)
    assert freshness.came_ns == came_ns
    assert freshness.silent_ns(T0) == T0 - came_ns, "its line is empty"
    assert not freshness.is_stale(came_ns + STALE_NS)
    assert freshness.is_stale(came_ns + STALE_NS + 1)
    for unread_ns in (0, 300 * MS):  # readings that wait are not late before they are read
        assert freshness.silent_ns(T0 + unread_ns, unread_ns) == 0
        assert not freshness.is_stale(T0 + unread_ns + STALE_NS, unread_ns)
        assert freshness.is_stale(T0 + unread_ns + STALE_NS + 1, unread_ns)
