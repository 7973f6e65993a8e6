"""Simulated grasps from end to end: the families, the runs and the tables."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from evaluate import __main__ as program
from evaluate.families import DEVELOPMENT, EVALUATION, FAMILIES, PERTURBATIONS, draw
from evaluate.intervals import share
from evaluate.offline_grasp import run_offline
from evaluate.playing import SAFETY, play, truth_of
from evaluate.running import READ_NS, Result, Task, Variant, config_text, record, run_all, run_task
from evaluate.summary import summarise
from evaluate.user_errors import ERRORS


def test_there_are_enough_families_and_no_seed_is_of_both_ranges() -> None:
    assert len(FAMILIES) >= 16
    assert set(PERTURBATIONS) < FAMILIES.keys()
    assert not set(DEVELOPMENT) & set(EVALUATION)


def test_a_seed_draws_the_same_grasp_and_another_a_different_one() -> None:
    first, again, other = draw("ramp", 3), draw("ramp", 3), draw("ramp", 4)
    assert (first.patch, first.friction, first.sensors) == (again.patch, again.friction, again.sensors)
    assert np.array_equal(first.load, again.load)
    assert first.friction != other.friction


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_draws_valid_courses(family: str) -> None:
    for seed in range(3):
        scene = draw(family, seed)
        assert scene.load.shape == (len(scene.grip_n), 3)
        assert np.isfinite(scene.load).all()
        assert (scene.grip_n >= 0.0).all()
        assert scene.grip_n[0] == 0.0
        assert 0.15 < scene.closed_s < scene.seconds
        assert 0.6 * scene.friction.mu_s <= scene.friction.mu_d <= scene.friction.mu_s


def test_the_truth_of_a_held_object_is_the_utilisation_that_was_drawn() -> None:
    scene = draw("hold", 1)
    truth = truth_of(scene, play(scene))
    assert truth.episodes() == []
    steady = truth.utilisation[truth.t_s > 1.5]
    assert 0.2 <= steady.min() <= steady.max() <= 0.67
    assert np.ptp(steady) < 0.02
    assert scene.patch.growth == 0.0
    assert truth.needed_n[-1] == pytest.approx(SAFETY * steady[-1] * truth.normal_n[-1], rel=0.02)


def test_the_need_of_a_contact_that_grows_is_that_of_its_size_at_that_force() -> None:
    """A pure torque on a contact whose size goes with f^γ has its limit at f^(1 + γ)."""
    scene = next(scene for scene in (draw("torsion", seed) for seed in range(9)) if scene.patch.growth > 0.0)
    truth = truth_of(scene, play(scene))
    k = int(np.argmax((truth.utilisation > 0.6) & (truth.t_s > scene.closed_s)))
    need = truth.normal_n[k] * (SAFETY * truth.utilisation[k]) ** (1.0 / (1.0 + scene.patch.growth))
    assert truth.needed_n[k] == pytest.approx(need, rel=0.03)


def test_an_object_that_falls_ends_its_run() -> None:
    scene = draw("pour", 0)
    truth = truth_of(scene, play(scene))
    (slip,) = truth.episodes()
    assert slip.end_s == pytest.approx(truth.t_s[-1])
    assert truth.path_m(*slip) == pytest.approx(0.04, rel=0.05)


@pytest.fixture(scope="module")
def poured() -> list[Result]:
    return run_task(
        Task("pour", 0, (Variant(0.8), Variant(1.0), Variant(None), Variant(1.0, error="sensor turned 5°")))
    )


def test_a_poured_object_is_warned_of_and_its_slip_is_reported(poured: list[Result]) -> None:
    for result in poured[:2]:
        (slip,) = result.score.episodes
        assert slip.warned
        assert slip.latency_s < 0.1
        assert not slip.missed


def test_a_lower_mu_warns_earlier_and_leaves_the_errors_as_they_are(poured: list[Result]) -> None:
    careful, exact = (result.score for result in poured[:2])
    assert careful.episodes[0].lead_s > exact.episodes[0].lead_s
    assert np.median(careful.used_errors) == pytest.approx(np.median(exact.used_errors), rel=0.2)
    assert np.median(exact.grip_errors) == pytest.approx(0.0, abs=0.05)
    assert np.median(careful.grip_errors) == pytest.approx(0.25, abs=0.06)


def test_a_config_on_the_events_of_another_run_gives_its_own_messages() -> None:
    scene = draw("grip closes", 0)
    trace = play(scene)
    tape = record(scene, trace, "", 5)
    for variant in (Variant(), Variant(0.8)):
        text = config_text(scene, variant)
        alone = run_offline(trace, {"left": scene.sensors}, text, 5, read_ns=READ_NS)
        assert [tuple(one) for one in alone] == [tuple(one) for one in tape.play(text)]


def test_an_error_of_the_user_changes_what_is_reported(poured: list[Result]) -> None:
    right, turned = poured[1].score, poured[3].score
    assert np.median(turned.used_errors) > 2.0 * np.median(right.used_errors)


@pytest.mark.parametrize("error", ERRORS)
def test_every_error_of_the_user_changes_the_sensors(error: str) -> None:
    sensors = draw("hold", 0).sensors
    assert ERRORS[error](sensors) != sensors


def test_a_summary_counts_what_the_scores_say(poured: list[Result]) -> None:
    found = summarise(result.score for result in poured[:2])
    assert (found.runs, found.slips, found.long, found.warned, found.missed) == (2, 2, 2, 1.0, 0.0)
    assert math.isnan(found.warned_again)
    assert math.isnan(share(0, 0))


def test_results_are_kept_and_taken_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (first,) = run_all([Task("grip closes", 0, (Variant(1.0),))])
    assert len([path for path in tmp_path.rglob("*") if path.is_file()]) == 1
    monkeypatch.setattr("evaluate.running.run_task", lambda task: pytest.fail("it must not run again"))
    (again,) = run_all([Task("grip closes", 0, (Variant(1.0),))])
    assert np.array_equal(first.score.used_errors, again.score.used_errors)
    assert program.main(["--quick", "--families", "grip closes", "--seeds", "1", "--factors", "1", "--runs"]) == 0
    assert "grip closes" in capsys.readouterr().out


def test_what_cannot_be_run_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["--quick", "--families", "nonsense"]) == 2
    assert program.main(["--quick", "--families", "hold", "--first", str(EVALUATION.start)]) == 2
    assert "the others are the report's" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        program.main(["--quick", "--factors", "0.8,much"])
    assert "invalid factors value: '0.8,much'" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        program.main(["--quick", "--seeds", "0"])
    assert "argument --seeds: must be a whole number from 1 on, got '0'" in capsys.readouterr().err


def test_families_are_chosen_by_parts_of_their_names() -> None:
    assert program.chosen("ramp, set_down") == ["set down", "ramp"]
    assert program.chosen("change") == ["change of grip", "change of load"]
    assert program.chosen("") == list(FAMILIES)
