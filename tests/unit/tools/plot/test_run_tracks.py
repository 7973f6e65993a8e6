from __future__ import annotations

import math
from typing import Any

import pytest

from slipd.tools.plot.binned_track import Extent, Range
from slipd.tools.plot.run_tracks import LevelState, Numbers, RunTracks, worse

Demo = tuple[RunTracks, list[tuple[str, dict[str, Any]]]]


def whole(track: Numbers) -> Range:
    values = [each.value for each in track.held(Extent(1e9))]
    return min(low for low, _ in values), max(high for _, high in values)


def test_the_tracks_of_a_real_run_reach_as_far_as_its_messages(demo: Demo) -> None:
    tracks, found = demo
    assert tracks.finger_names == ["left", "right"]
    left = [body for topic, body in found if topic == "slip.left"]
    finger = tracks.fingers["left"]
    for track, key in ((finger.used, "utilisation"), (finger.normal, "normal_n"), (finger.spin, "spin_nm")):
        values = [body[key] for body in left if body[key] is not None]
        assert whole(track) == (min(values), max(values))
    forces = [math.hypot(*body["tangential_n"]) for body in left if body["tangential_n"] is not None]
    assert whole(finger.tangential) == (min(forces), max(forces))
    grips = [body["internal_n"] for topic, body in found if topic == "grasp" and body["internal_n"] is not None]
    assert whole(tracks.grip) == (min(grips), max(grips))
    assert tracks.window.end_s == max(body["t_ns"] - found[0][1]["t_ns"] for _, body in found) * 1e-9
    assert tracks.changes.count == sum(topic == "warning" for topic, _ in found)


def test_the_levels_of_a_real_run_are_those_of_its_warnings(demo: Demo) -> None:
    tracks, found = demo
    told = [body["level"] for topic, body in found if topic == "warning" and body["finger"] == "left"]
    runs = [run.value.level for run in tracks.fingers["left"].level.runs(tracks.extent)]
    levels = [level for before, level in zip(["unknown", *runs], runs, strict=False) if level != before]
    assert levels == told


def test_what_is_not_known_is_no_value(run: Any) -> None:
    unknown = dict.fromkeys(("utilisation", "utilisation_lower", "tangential_n", "mu", "mu_low", "mu_high"))
    run.add("slip.left", 0.0, **unknown, relative_utilisation=0.7)
    finger = run.tracks.fingers["left"]
    for track in (finger.used, finger.bounds, finger.tangential, finger.mu, finger.mu_interval):
        assert whole(track) == (math.inf, -math.inf)
    assert whole(finger.relative) == (0.7, 0.7)


def test_an_interval_that_nothing_limits_is_infinite(run: Any) -> None:
    run.add("slip.left", 0.0, mu_high=None, mu_source="learned")
    assert whole(run.tracks.fingers["left"].mu_interval) == (0.4, math.inf)


def test_the_relative_utilisation_is_drawn_only_without_a_coefficient(run: Any) -> None:
    run.add("slip.left", 0.0, relative_utilisation=0.9)
    assert whole(run.tracks.fingers["left"].relative) == (math.inf, -math.inf)


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


COUNTERS = dict.fromkeys(("lost", "bad", "duplicates", "dropped", "restarts", "reconnects"), 0)


def test_the_health_of_a_stream_has_its_worst_time_and_its_counters(run: Any) -> None:
    for t_s, health, lost, masked in ((0.0, 0, 0, [3]), (1.0, 3, 7, [3, 4]), (2.0, 0, 7, [])):
        stream = COUNTERS | {"health": health, "message": "stale" if health else "", "lost": lost, "masked": masked}
        run.add("status", t_s, streams={"left.pad": stream, "gripper": COUNTERS | {"health": 0, "message": ""}})
    pad, gripper = run.tracks.streams["left.pad"], run.tracks.streams["gripper"]
    assert [each.value.code for each in pad.health.runs(Extent(3.0))] == [0, 3, 0]
    assert (pad.counters["lost"], pad.masked, gripper.masked) == (7, 2, None)


def test_evidence_within_a_column_is_kept(run: Any) -> None:
    run.add("slip.left", 0.0, evidence=["load_drop"])
    run.add("slip.left", 0.0002, evidence=["width"])
    run.add("slip.left", 0.5, evidence=[], force_unit="uncalibrated")
    finger = run.tracks.fingers["left"]
    assert [each.value for each in finger.evidence.runs(Extent(1.0))] == [{"load_drop", "width"}, frozenset()]
    assert not finger.in_newtons


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


def test_an_alarm_after_a_gap_has_no_image_of_before(run: Any) -> None:
    run.add_image(0.9, "left", 0.0, 1.0, 2.0, 4.0)
    run.add_event(1.0)
    run.add_event(3.0)
    run.add_change(3.0, "left", "stable", "warning", "rotation")
    assert run.tracks.changes.snapshots == []
