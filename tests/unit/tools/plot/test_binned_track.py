from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.tools.plot.binned_track import NO_VALUE, BinnedTrack, Extent, Held, Window, later, widest

times_and_values = st.lists(st.tuples(st.floats(0.0, 1e5), st.floats(-1e3, 1e3)), min_size=1, max_size=80)


@given(times_and_values)
def test_no_extreme_is_lost_and_the_memory_is_bounded(samples: list[tuple[float, float]]) -> None:
    track = BinnedTrack(widest, bins=8)
    for t_s, value in samples:
        track.add(t_s, (value, value))
    found = list(track.held(Extent(2e5)))
    assert len(found) <= 8
    assert min(each.value[0] for each in found) == min(value for _, value in samples)
    assert max(each.value[1] for each in found) == max(value for _, value in samples)


@given(times_and_values)
def test_every_value_is_held_where_it_was(samples: list[tuple[float, float]]) -> None:
    track = BinnedTrack(widest, bins=8)
    for t_s, value in samples:
        track.add(t_s, (value, value))
    found = list(track.held(Extent(2e5)))
    assert all(one.end_s == other.begin_s for one, other in pairwise(found))
    for t_s, value in samples:
        t_s = max(t_s, samples[0][0])
        assert any(each.begin_s <= t_s < each.end_s and each.value[0] <= value <= each.value[1] for each in found)


def test_a_value_holds_until_the_next_and_the_last_until_the_end() -> None:
    track = BinnedTrack(later, bins=100, width_s=0.1)
    track.add(30.0, "a")
    track.add(29.0, "of before")
    track.add(32.0, "b")
    assert list(track.held(Extent(39.0))) == [Held(30.0, 32.0, "of before"), Held(32.0, 39.0, "b")]


def test_equal_values_are_one_run() -> None:
    track = BinnedTrack(later, bins=100, width_s=1.0)
    for t_s, value in enumerate("aabbba"):
        track.add(t_s, value)
    assert [(each.value, each.begin_s, each.end_s) for each in track.runs(Extent(8.0))] == [
        ("a", 0.0, 2.0),
        ("b", 2.0, 5.0),
        ("a", 5.0, 8.0),
    ]


def test_a_value_does_not_hold_into_a_gap() -> None:
    track = BinnedTrack(later, bins=100, width_s=0.1)
    for t_s in (0.0, 1.0, 6.0, 7.0):
        track.add(t_s, "stable")
    extent = Extent(9.0, [Window(0.1, 0.9), Window(2.0, 6.0), Window(8.0, 8.5)])
    held = [(each.begin_s, each.end_s) for each in track.held(extent)]
    assert held == [(0.0, 0.1), (1.0, 2.0), (6.0, 7.0), (7.0, 8.0)]
    assert [(each.begin_s, each.end_s) for each in track.runs(extent)] == [(0.0, 0.1), (1.0, 2.0), (6.0, 8.0)]


def test_an_empty_track_holds_nothing() -> None:
    track = BinnedTrack(later)
    assert list(track.held(Extent(1.0))) == list(track.runs(Extent(1.0))) == []


def test_an_odd_number_of_bins_is_merged_too() -> None:
    track = BinnedTrack(widest, bins=3, width_s=1.0)
    for t_s in range(5):
        track.add(t_s, (t_s, t_s))
    assert [each.value for each in track.held(Extent(5.0))] == [(0, 1), (2, 3), (4, 4)]


def test_no_value_is_wider_than_none() -> None:
    assert widest(NO_VALUE, (1.0, 2.0)) == widest((1.0, 2.0), NO_VALUE) == (1.0, 2.0)
    assert widest(NO_VALUE, NO_VALUE) == NO_VALUE


@pytest.mark.parametrize("length_s", [1.6, 60.0, 3600.0])
def test_an_hour_is_as_fine_as_the_picture(length_s: float) -> None:
    track = BinnedTrack(widest)
    for n in range(20_000):
        t_s = n * length_s / 20_000
        track.add(t_s, (math.sin(t_s), math.sin(t_s)))
    assert 790 < len(list(track.held(Extent(length_s)))) <= 1600
