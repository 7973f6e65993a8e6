from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slipd.tools.plot.binned_track import BinnedTrack, Extent, Held, Window, later, widest

times_and_values = st.lists(st.tuples(st.floats(0.0, 1e5), st.floats(-1e3, 1e3)), min_size=1, max_size=80)


@given(times_and_values)
def test_no_extreme_is_lost_and_the_memory_is_bounded(samples: list[tuple[float, float]]) -> None:
    track = BinnedTrack(widest, bins=8)
    for t_s, value in samples:
        track.add(t_s, (value, value))
    found = list(track.held(Extent(2e5)))
    assert len(found) <= 8
    values = [value for _, value in samples]
    assert (min(each.value[0] for each in found), max(each.value[1] for each in found)) == (min(values), max(values))


def test_a_value_holds_until_the_next_and_the_last_until_the_end() -> None:
    track = BinnedTrack(later, bins=100, width_s=0.1)
    track.add(30.0, "a")
    track.add(29.0, "of before")
    track.add(32.0, "b")
    assert list(track.held(Extent(39.0))) == [Held(30.0, 32.0, "of before"), Held(32.0, 39.0, "b")]


def test_a_value_does_not_hold_into_a_gap() -> None:
    track = BinnedTrack(later, bins=100, width_s=0.1)
    for t_s in (0.0, 1.0, 6.0, 7.0):
        track.add(t_s, "stable")
    extent = Extent(9.0, [Window(0.1, 0.9), Window(2.0, 6.0), Window(8.0, 8.5)])
    held = [(each.begin_s, each.end_s) for each in track.held(extent)]
    assert held == [(0.0, 0.1), (1.0, 2.0), (6.0, 7.0), (7.0, 8.0)]
    assert [(each.begin_s, each.end_s) for each in track.runs(extent)] == [(0.0, 0.1), (1.0, 2.0), (6.0, 8.0)]
