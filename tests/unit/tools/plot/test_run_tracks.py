from __future__ import annotations

import math
from typing import Any

import pytest

from slipd.tools.plot.binned_track import BinnedTrack, Extent, Range
from slipd.tools.plot.run_tracks import MOST_CHANGES, MOST_SNAPSHOTS, LevelState, RunTracks, worse

Demo = tuple[RunTracks, list[tuple[str, dict[str, Any]]]]


def whole(track: BinnedTrack[Range]) -> Range:
    values = [each.value for each in track.held(Extent(1e9))]
    return min(low for low, _ in values), max(high for _, high in values)


def test_the_tracks_of_a_real_run_reach_as_far_as_its_messages(demo: Demo) -> None:
    tracks, found = demo
    assert sorted(tracks.fingers) == ["left", "right"]
    left = [body for topic, body in found if topic == "slip.left"]
    numbers = tracks.fingers["left"].numbers
    for key in ("utilisation", "normal_n", "spin_nm"):
        values = [body[key] for body in left if body[key] is not None]
        assert whole(numbers[key]) == (min(values), max(values))
    forces = [math.hypot(*body["tangential_n"]) for body in left if body["tangential_n"] is not None]
    assert whole(numbers["tangential"]) == (min(forces), max(forces))
    grips = [body["internal_n"] for topic, body in found if topic == "grasp" and body["internal_n"] is not None]
    assert whole(tracks.grasp["now"]) == (min(grips), max(grips))
    assert tracks.window.end_s == max(body["t_ns"] - found[0][1]["t_ns"] for _, body in found) * 1e-9
    assert tracks.changes.count == sum(topic == "warning" for topic, _ in found)


@pytest.mark.parametrize(
    ("fields", "key", "range_"),
    [
        ({"utilisation": None}, "utilisation", None),
        ({"utilisation_lower": None}, "bounds", None),
        ({"tangential_n": None}, "tangential", None),
        ({"mu": None}, "mu", None),
        ({"mu_low": None}, "mu_interval", None),
        ({"mu_high": None}, "mu_interval", (0.4, math.inf)),
        ({"utilisation": None, "relative_utilisation": 0.7}, "relative", (0.7, 0.7)),
        ({"relative_utilisation": 0.7}, "relative", None),
        ({}, "tangential", (5.0, 5.0)),
        ({}, "bounds", (0.58, 0.62)),
    ],
)
def test_what_is_not_known_is_no_value_and_what_nothing_limits_is_infinite(
    run: Any, fields: dict[str, Any], key: str, range_: Range | None
) -> None:
    run.add("slip.left", 0.0, **fields)
    assert whole(run.tracks.fingers["left"].numbers[key]) == (range_ or (math.inf, -math.inf))


@pytest.mark.parametrize(
    ("one", "other", "kept"),
    [
        (LevelState("stable", ()), LevelState("warning", ("rotation",)), LevelState("warning", ("rotation",))),
        (LevelState("unknown", ("stale",)), LevelState("stable", ()), LevelState("unknown", ("stale",))),
        (
            LevelState("caution", ("rotation",)),
            LevelState("caution", ("tipping", "rotation")),
            LevelState("caution", ("rotation", "tipping")),
        ),
    ],
)
def test_a_column_shows_the_worse_level(one: LevelState, other: LevelState, kept: LevelState) -> None:
    assert worse(one, other) == kept


def test_the_health_of_a_stream_has_its_worst_time_and_its_counters(run: Any) -> None:
    for t_s, health, lost, masked in ((0.0, 0, 0, [3]), (1.0, 3, 7, [3, 4]), (2.0, 0, 7, [])):
        run.add_stream(t_s, health, "stale" * bool(health), lost=lost, masked=masked)
    pad, wrench = run.tracks.streams["left.pad"], run.tracks.streams["left.wrench"]
    assert [each.value for each in pad.health.runs(Extent(3.0))] == [(0, ""), (3, "stale"), (0, "")]
    assert (pad.counters["lost"], pad.masked, wrench.masked) == (7, 2, None)


def test_no_level_is_known_while_no_event_is_recorded(run: Any) -> None:
    """A level that stays needs no message; without events nobody knows that it stays."""
    run.add("slip.left", 0.0)
    for tick in range(200):
        run.add_event(tick * 0.005)
    run.add_event(4.0)
    run.add("slip.left", 4.0)
    run.add("slip.left", 5.0)
    runs = [(each.begin_s, each.end_s) for each in run.tracks.fingers["left"].level.runs(run.tracks.extent)]
    assert runs == [(0.0, pytest.approx(0.995)), (pytest.approx(4.0, abs=0.001), 5.0)]


def test_an_alarm_has_the_image_centroid_and_pole_of_its_reading(run: Any) -> None:
    run.add_image(0.9, "left", 0.0, 1.0, 2.0, 4.0)
    run.add_image(0.9, "right", 9.0, 9.0, 9.0, 9.0)
    run.add_change(1.0, "left", "stable", "warning", "rotation")
    run.add("slip.left", 1.1, centroid_m=[0.009, 0.0], pole_m=None)
    log = run.tracks.changes
    ((change, image),) = log.snapshots
    assert (change.t_s, change.warning["finger"], change.warning["reasons"]) == (1.0, "left", ["rotation"])
    assert (image["loads_n"][-1], log.count, log.alarms) == (4.0, 1, 1)
    assert (change.verdict["centroid_m"], change.verdict["pole_m"]) == ([0.001, 0.002], [0.003, 0.004])


def test_a_run_of_any_length_keeps_the_first_changes_and_counts_all(run: Any) -> None:
    run.add_image(0.0, "left", 0.0, 1.0, 2.0, 4.0)
    for n in range(MOST_CHANGES + 10):
        run.add_change(n, "left", "stable", "warning")
    log = run.tracks.changes
    assert (log.count, log.alarms, len(log.changes)) == (MOST_CHANGES + 10, MOST_CHANGES + 10, MOST_CHANGES)
    assert [each.t_s for each, _ in log.snapshots] == pytest.approx([*range(MOST_SNAPSHOTS)])
