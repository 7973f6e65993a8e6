"""The measurement of real grasps, on grasps that are made up."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from grip_trials import write_trial
from realgrasps.__main__ import main
from realgrasps.labels import Label, LabelError, read_labels
from realgrasps.score import Reported, Trial, score

from slipd.tools.evaluation.config_run import LevelSpan

OPEN, HELD = 40, 120
LABELS = """\
name,object,rate_hz,dropped,grasp_row,end_row,kind,begin_row,onset_row,far_row
held,box,40,0,45,119,hold,,,
pulled,box,40,1,45,119,slip,80,90,95
quick,box,40,0,45,119,slip,80,90,
odd,box,40,0,45,119,unclear,,,
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four trials: held with half of what friction carries, and pulled beyond, slowly or too late."""
    normal = np.where(np.arange(HELD) < OPEN, 0.0, 20_000.0)
    ratios = np.full(HELD, 0.1)
    slow, late = ratios.copy(), ratios.copy()
    slow[75:] = 0.6
    late[92:] = 0.6
    for name, ratio in (("held", ratios), ("pulled", slow), ("quick", late), ("odd", slow)):
        write_trial(tmp_path / name, normal, ratio * normal)
    (tmp_path / "labels.csv").write_text(LABELS)
    return tmp_path


def test_trials_are_imported_replayed_and_compared(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(folder), "--tare-rows", "30", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    counts = found["totals"]["warning or slipping"]
    assert counts["by_onset"] == [1, 2], "pulled, but not quick"
    assert counts["by_far"] == [1, 1], "quick never moved so far"
    assert counts["held_alarmed"] == [0, 1]
    assert counts["drop"] == [1, 1]
    assert counts["slips_alarmed_early"] == [0, 2]
    assert counts["reasons"]["translation"] == 2, "quick is alarmed of, but later"
    pulled = next(trial for trial in found["trials"] if trial["label"]["name"] == "pulled")
    assert pulled["alarms"]["first_s"] == pytest.approx(-5 / 40, abs=0.02)
    assert [trial["label"]["name"] for trial in found["trials"]] == ["held", "pulled", "quick", "odd"]


def test_the_report_has_a_line_for_each_trial_and_each_count(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(folder)]) == 0
    told = capsys.readouterr().out
    assert "slips reported by 5 mm or 5°             1 of 2, 50%" in told
    assert "holds alarmed                            0 of 1, 0%" in told
    lines = told.splitlines()[1:5]
    assert [line.split()[:4] for line in lines] == [
        ["held", "box", "hold", "quiet"],
        ["pulled", "box", "drop", "yes"],
        ["quick", "box", "slip", "no"],
        ["odd", "box", "unclear"],
    ]


BEGIN_S, ONSET_S, FAR_S, END_S = 10.0, 10.2, 10.4, 12.0
SLIP = Label("a", "box", "slip", True, 5.0, END_S, BEGIN_S, ONSET_S, FAR_S)
HOLD = Label("a", "box", "hold", False, 5.0, END_S, None, None, None)


def reported(label: Label, *alarms: tuple[float, float], level: str = "warning") -> Reported:
    """Compare with alarms (begin, end) of one finger, which is stable otherwise."""
    spans = [(level, *alarm) for alarm in alarms]
    calm = [("stable", before, after) for (_, before), (after, _) in pairwise([(0.0, 0.0), *alarms, (99.0, 99.0)])]
    in_order = sorted(spans + calm, key=lambda span: span[1:])
    return score(label, {"left": [], "right": [LevelSpan(word, (), (), *span) for word, *span in in_order]}).alarms


@pytest.mark.parametrize(
    ("alarm", "by_onset", "by_far", "drop", "early"),
    [
        ((9.51, 9.6), True, True, True, 0),
        ((9.4, 9.45), False, False, False, 1),
        ((9.4, 9.9), False, False, False, 1),
        ((6.0, 10.01), True, True, True, 1),
        ((4.0, 5.1), False, False, False, 1),
        ((4.0, 4.9), False, False, False, 0),
        ((10.2, 10.3), True, True, True, 0),
        ((10.3, 10.35), False, True, True, 0),
        ((11.6, 11.65), False, False, True, 0),
        ((11.8, 12.5), False, False, False, 0),
    ],
)
def test_an_alarm_counts_for_the_slip_it_is_about(
    alarm: tuple[float, float], by_onset: bool, by_far: bool, drop: bool, early: int
) -> None:
    found = reported(SLIP, alarm)
    assert (found.by_onset, found.by_far, found.drop, found.early) == (by_onset, by_far, drop, early)


def test_the_lax_counts_accept_any_alarm_since_the_grasp() -> None:
    found = reported(SLIP, (6.0, 6.1))
    assert (found.by_onset, found.by_onset_lax, found.by_far_lax, found.drop_lax) == (False, True, True, True)
    assert reported(SLIP, (4.0, 4.9)).by_onset_lax is False


def test_a_hold_counts_alarms_while_it_lasts() -> None:
    assert reported(HOLD, (4.0, 4.9), (12.1, 13.0)).held_alarmed is False
    assert reported(HOLD, (11.9, 13.0)).held_alarmed is True
    assert reported(HOLD, (6.0, 7.0), level="caution").held_alarmed is False


def test_early_alarms_of_two_fingers_last_as_long_as_either() -> None:
    spans = {
        name: [LevelSpan("warning", (), (), begin, begin + 1.0)] for name, begin in (("left", 6.0), ("right", 6.5))
    }
    found = score(SLIP, spans).alarms
    assert (found.early, found.early_s) == (2, pytest.approx(1.5))


def test_warning_and_slipping_are_one_alarm_and_slipping_is_counted_alone() -> None:
    levels = [LevelSpan("warning", ("rotation",), (), 9.0, 10.1), LevelSpan("slipping", (), ("load_drop",), 10.1, 10.3)]
    found = score(SLIP, {"left": [*levels, LevelSpan("unknown", (), (), 10.3, 13.0)]})
    assert (found.alarms.first_s, found.slipping.first_s) == (pytest.approx(-1.0), pytest.approx(0.1))
    assert (found.alarms.evidence, found.alarms.reasons) == (("load_drop",), ("rotation",))
    assert (found.slipping.early, found.alarms.early) == (0, 1)
    assert (found.unknown_s, found.held_s) == (pytest.approx(1.7), 7.0)


def test_unclear_trials_count_nowhere() -> None:
    unclear = Label("a", "box", "unclear", False, 5.0, END_S, None, None, None)
    trial: Trial = score(unclear, {"left": [LevelSpan("slipping", (), (), 6.0, 7.0)]})
    assert trial.alarms == trial.slipping == Reported()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (",hold,", ",held,", "labels.csv:2: kind must be one of slip, hold, unclear, got 'held'"),
        ("slip,80,90,95", "slip,80,,95", "labels.csv:3: a slip must have onset_row, got none"),
        ("slip,80,90,95", "slip,80,90,85", "labels.csv:3: the rows must be in the order grasp_row, begin_row"),
        ("slip,80,90,95", "slip,80,90,120", "labels.csv:3: far_row must be a row of the trial, 0 to 119, got '120'"),
        ("onset_row", "onset", "labels.csv:1: must have the columns"),
        ("held,box", "gone,box", "robot_state.csv: must have a column time of numbers"),
    ],
)
def test_wrong_labels_are_reported_with_their_line(
    folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, told: str
) -> None:
    (folder / "labels.csv").write_text(LABELS.replace(old, new))
    with pytest.raises(LabelError):
        read_labels(folder)
    assert main([str(folder)]) == 1
    assert told in capsys.readouterr().err


def test_a_folder_without_labels_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path)]) == 1
    assert "labels.csv: cannot be read: No such file" in capsys.readouterr().err


def test_a_trial_that_begins_in_the_grasp_is_reported(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(folder), "--tare-rows", "60"]) == 1
    assert "must be at rest in the first 60 rows" in capsys.readouterr().err
