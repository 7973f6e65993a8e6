"""The measurement of real pushes, on made-up motions and on one run of the repository."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from realdata import labelled
from realdata.__main__ import main
from realdata.score import Course, Onset, oracle, overlap_s, score, tremor
from realdata.truth import Motion, Span, motion

from slipd.tools.recordings.pushes_import import Pushes

RATE_HZ = 60.0
NONE = np.zeros((2, 7))


def moved(speed_mps: float, begin_s: float = 2.0, end_s: float = 4.0, noise_m: float = 2e-5) -> Motion:
    """Six seconds in which the object moves for two."""
    time_s = np.arange(0.0, 6.0, 1.0 / RATE_HZ)
    x = speed_mps * np.clip(time_s - begin_s, 0.0, end_s - begin_s)
    noise = noise_m * np.random.default_rng(1).standard_normal((2, len(time_s)))
    return motion(Pushes(NONE, np.stack([time_s, x + noise[0], noise[1], 0.0 * x], axis=1), NONE))


def test_a_slide_and_the_rests_around_it_are_found() -> None:
    found = moved(5e-3)
    (slide,) = found.slides
    assert slide.begin_s == pytest.approx(2.0, abs=0.05)
    assert slide.end_s == pytest.approx(4.0, abs=0.1)
    assert found.travel_m(slide.begin_s, slide.end_s) == pytest.approx(10e-3, abs=3e-4)
    assert [(rest.begin_s < 1.0 or rest.end_s > 5.0) for rest in found.rests] == [True, True]


def test_noise_and_short_travel_are_no_slides() -> None:
    assert moved(0.0).slides == []
    assert moved(2.5e-3, end_s=2.3).slides == [], "0.75 mm"


@pytest.mark.parametrize(
    ("reports", "onset"),
    [
        ([Span(2.04, 3.0)], Onset(pytest.approx(0.04, abs=0.03), pytest.approx(0.2e-3, abs=0.2e-3))),
        ([Span(1.9, 3.0)], Onset(0.0, 0.0)),
        ([Span(1.7, 1.8)], Onset(0.0, 0.0)),
        ([Span(1.0, 1.1), Span(3.0, 3.1)], Onset(pytest.approx(1.0, abs=0.05), pytest.approx(5e-3, abs=4e-4))),
        ([Span(4.5, 5.0)], Onset(None, None)),
    ],
)
def test_an_onset_is_reported_by_the_first_report_about_it(reports: list[Span], onset: Onset) -> None:
    found = score(moved(5e-3), reports, [False, True])
    assert found.onsets == [onset]


def test_reported_sliding_and_reports_at_rest_are_counted() -> None:
    found = score(moved(5e-3), [Span(0.0, 1.0), Span(3.0, 3.5)], [False, True])
    assert found.reported_s == pytest.approx(0.5)
    assert 0.0 < found.false_s < 1.01 < found.rested_s
    assert (found.clear, found.pressed) == ((1, 1), (1, 0))
    assert Onset(0.2, 0.9e-3).in_time
    assert Onset(0.04, 3e-3).in_time
    assert not Onset(0.2, 3e-3).in_time
    assert not Onset(None, None).in_time
    assert overlap_s(Span(0.0, 1.0), Span(2.0, 3.0)) == 0.0


def test_the_oracle_finds_the_limit_that_separates_sliding_from_rest() -> None:
    found = moved(5e-3)
    time_s = np.arange(0.0, 6.0, 0.01)
    required = np.where((time_s > 2.0) & (time_s < 4.0), 0.4, 0.3)
    best = oracle(found, time_s, required, [False, False])
    assert best.clear == (2, 0)
    assert best.reported_s == pytest.approx(best.slid_s, abs=0.1)


def test_the_tremor_is_that_around_the_trend() -> None:
    ramp = np.arange(100) * 0.01
    shaken = ramp + 0.02 * (-1.0) ** np.arange(100)
    none = np.zeros(100)
    assert tremor(Course(none, none, ramp, none)).max() == pytest.approx(0.0, abs=1e-9)
    assert tremor(Course(none, none, shaken, none))[50] == pytest.approx(0.02, rel=0.1)


@pytest.mark.long
def test_a_run_of_the_repository_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robot_push_1"]) == 0
    table = capsys.readouterr().out
    assert "| robot_push_1 | 1 |" in table
    assert "of 13 s" in table


def test_labelled_trials_are_scored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = np.zeros((1000, 73))
    pillars = rows[:, 1:].reshape(1000, 9, 8)
    pillars[400:, :, 7] = 0.5
    pillars[600:, :, 5] = 0.45
    pillars[600:, :, 1] = 1.0
    pillars[:, :, 5:] += np.random.default_rng(1).normal(0.0, 0.002, (1000, 9, 3))
    rows[:, 1:] = pillars.reshape(1000, 72)
    np.savetxt(tmp_path / "trial.csv", rows, delimiter=",", fmt="%.6g")
    assert labelled.main(["papillarray", str(tmp_path / "trial.csv")]) == 0
    slipping, both = capsys.readouterr().out.splitlines()
    assert slipping.startswith("slipping: ")
    assert both.startswith("warning or slipping: 1 of 1 slips by 50 ms, 1 at all; 0.4")
    assert labelled.main(["arq", str(tmp_path / "none.h5"), "GGCNN2/none"]) == 1


def test_a_folder_without_runs_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--folder", str(tmp_path)]) == 1
    assert "runs.csv" in capsys.readouterr().err
