"""The times of a run of which nothing is known."""

from __future__ import annotations

import pytest

from slipd.recording.reader import GAP_S, EventGaps, Gap

BEGIN_NS = 5_000_000_000


def test_a_gap_is_a_longer_time_without_an_event() -> None:
    gaps = EventGaps(BEGIN_NS)
    times_s = [0.0, 0.005, 0.005 + 0.99 * GAP_S, 3.0, 3.005, 4.0]
    assert [gaps.add(BEGIN_NS + round(t_s * 1e9)) for t_s in times_s] == [False, False, False, True, False, True]
    assert gaps.found == [pytest.approx(Gap(0.104, 3.0)), pytest.approx(Gap(3.005, 4.0))]


def test_a_run_does_not_begin_with_a_gap() -> None:
    gaps = EventGaps()
    assert not gaps.add(BEGIN_NS)
    assert gaps.found == []
