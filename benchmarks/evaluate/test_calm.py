"""False alarms over hours: the draws, one short grasp, and the page."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest
from evaluate import calm
from evaluate.families import EVALUATION
from evaluate.reports import SLIPPING, STABLE
from evaluate.test_score import course, said, scored
from evaluate.worlds import WORLDS

FALSE = scored(course(used=0.5), said((0.0, STABLE), (0.6, SLIPPING), (0.8, STABLE)))
QUIET = scored(course(used=0.5), said((0.0, STABLE)))


def test_the_grasps_are_of_both_families_and_all_factors_and_of_seeds_kept_apart() -> None:
    drawn = list(islice(calm.minutes(), 6))
    assert {(one.family, one.factor) for one in drawn} == {(f, k) for f in calm.FAMILIES for k in calm.FACTORS}
    assert all(one.seed in EVALUATION for one in drawn)


@pytest.mark.parametrize("world", WORLDS)
def test_a_short_hold_is_quiet(world: str) -> None:
    found = calm.run(calm.Minute("hold", 7, 1.0, world), 1.5)
    assert (found.false_slipping, found.false_warnings, found.episodes) == (0, 0, [])
    assert found.quiet_s == pytest.approx(1.5, abs=0.3)
    assert found.steady_s > 0.5
    assert 0.0 < found.used_errors.max() < 0.2, "there were messages"


def test_the_page_states_hours_counts_and_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = [(calm.Minute("hold", 0, 0.9), QUIET), (calm.Minute("shake", 0, 1.0), FALSE)]
    monkeypatch.setattr(calm, "run_all", lambda *_: made)
    assert calm.main(["--hours", "0.02", "--into", str(tmp_path)]) == 0
    page = (tmp_path / "calm_hours.md").read_text()
    (row,) = [line for line in page.splitlines() if line.startswith("| both")]
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[1] == "2"
    assert cells[3] == "1"
    assert "Gross slips in truth: 0." in page
