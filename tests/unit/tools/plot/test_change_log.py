from __future__ import annotations

from typing import Any

from slipd.tools.plot.change_log import MOST_CHANGES, MOST_SNAPSHOTS


def test_an_alarm_has_the_image_centroid_and_pole_of_its_reading(run: Any) -> None:
    run.add_image(0.9, "left", 0.0, 1.0, 2.0, 4.0)
    run.add_image(0.9, "right", 9.0, 9.0, 9.0, 9.0)
    run.add_change(1.0, "left", "stable", "warning", "rotation")
    run.add("slip.left", 1.1, centroid_m=[0.009, 0.0], pole_m=None)
    log = run.tracks.changes
    (change,) = log.snapshots
    assert (change.t_s, change.finger, change.level, change.reasons) == (1.0, "left", "warning", ("rotation",))
    assert change.image is not None
    assert change.image.peak == 4.0
    assert (change.centroid_m, change.pole_m) == ([0.001, 0.002], [0.003, 0.004])
    assert (log.count, log.alarms) == (1, 1)


def test_a_fall_and_a_caution_are_no_alarms(run: Any) -> None:
    run.add_image(0.0, "left", 0.0, 1.0, 2.0, 4.0)
    run.add_change(1.0, "left", "stable", "caution")
    run.add_change(2.0, "left", "slipping", "warning", rising=False)
    log = run.tracks.changes
    assert (log.count, log.alarms, log.snapshots) == (2, 0, [])


def test_an_alarm_without_an_image_is_counted(run: Any) -> None:
    run.add_change(1.0, "left", "stable", "warning")
    run.add("tactile.left", 1.5, rows=2, cols=2, loads_n=None)
    run.add_change(2.0, "left", "warning", "slipping")
    log = run.tracks.changes
    assert (log.alarms, log.snapshots) == (2, [])


def test_a_run_of_any_length_keeps_the_first_changes_and_counts_all(run: Any) -> None:
    run.add_image(0.0, "left", 0.0, 1.0, 2.0, 4.0)
    for n in range(MOST_CHANGES + 10):
        run.add_change(n, "left", "stable", "warning")
    log = run.tracks.changes
    assert (len(log.changes), log.count) == (MOST_CHANGES, MOST_CHANGES + 10)
    assert (len(log.snapshots), log.alarms) == (MOST_SNAPSHOTS, MOST_CHANGES + 10)
    assert log.snapshots[-1].t_s == MOST_SNAPSHOTS - 1
