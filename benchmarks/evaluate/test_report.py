"""The report from few runs: its tables, its pictures, and the methods that it compares."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from chart.scenes import Scene
from evaluate import closed_loop, goals, methods, report
from evaluate.campaign import MAIN, Campaign, tasks
from evaluate.families import EVALUATION, FAMILIES
from evaluate.methods import METHODS, Found
from evaluate.reports import SLIPPING, STABLE, WARNING
from evaluate.running import Result
from evaluate.test_score import course, said, scored

WARNED = scored(course((1.0, 1.5)), said((0.0, STABLE), (0.8, WARNING), (1.01, SLIPPING)))
MUTE = scored(course((1.0, 1.5)), said((0.0, STABLE)))
FALSE = scored(course(used=0.5), said((0.0, STABLE), (0.6, SLIPPING), (0.8, STABLE)))
QUIET = scored(course(used=0.5), said((0.0, STABLE)))


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    """Two grasps of a family for every config: those of "pour" are warned of but for one, "shake" has a false slip."""
    made = {("pour", 0): WARNED, ("pour", 1): MUTE, ("shake", 0): FALSE, ("shake", 1): QUIET, ("hold", 0): QUIET}
    return Campaign(
        [Result(name, EVALUATION.start + k, variant, made[name, k]) for name, k in made for variant in MAIN], 2
    )


def cells(table: object, name: str) -> list[str]:
    return next([str(cell) for cell in row] for row in table.rows if str(row[0]).startswith(name))  # type: ignore[attr-defined]


def test_the_goals_say_what_is_reached_and_what_is_not(campaign: Campaign) -> None:
    table = goals.goals(campaign)
    assert cells(table, "false `slipping`, hold")[3] == "yes"
    assert cells(table, "false `slipping`, shake")[2].startswith("6 in ")
    assert cells(table, "false `slipping`, shake")[3] == "**no**"
    assert cells(table, "no alarm of any kind in 100 ms, factor 1.2")[1:] == ["≤ 5 %", "50 %", "**no**"]
    assert cells(table, "warned before gross slip")[2] == "50 % (oracle: 0.0 %)"
    assert cells(table, "false warnings (λ < 0.7), factors 0.9 to 1.1, families that hold")[2].startswith("3 in ")
    assert cells(table, "creep reported")[2:] == ["– of 0 (oracle: –)", ""], "nothing to say it from"


def test_creep_is_not_asked_to_be_reported_within_100_ms() -> None:
    made = {("pour", 0): WARNED, ("creep", 0): MUTE, ("flat creep", 0): MUTE}
    results = [Result(name, k, variant, made[name, k]) for name, k in made for variant in MAIN]
    rows = [row for row in goals.goals(Campaign(results, 1)).rows if "factor 1.1, μ_d/μ_s" in str(row[0])]
    assert sum(" of 1 " in str(row[2]) for row in rows) == 1, "the one slip of pour"
    assert all("100 %" not in str(row[2]).split(" of ")[0] for row in rows), "the misses are those of creep"


def test_rejections_stand_beside_the_published_ones() -> None:
    made = [Result("change of grip", k, MAIN[0], FALSE if k == 0 else QUIET) for k in range(4)]
    row = cells(goals.rejections(Campaign(made, 4)), "change of grip")
    assert row[1:3] == ["4", "75 %"]
    assert row[4] == "79.4 %"


def test_the_page_has_every_table_and_definition(campaign: Campaign) -> None:
    found = {name: Found([0.9, 1.0], [0.1, 0.7]) for name in METHODS}
    loop = {mode.name: [closed_loop.Outcome(False, 0.001, 0.0, 9.0, 7.0)] for mode in closed_loop.MODES}
    page = report.page("Somewhere", campaign, found, 1, loop)
    for heading in ("Asked and found", "Families that slip", "By the μ of the config", "Methods", "Definitions"):
        assert f"## {heading}" in page
    for family in FAMILIES:
        assert f"| {family} |" in page
    assert "PROMPT_S" not in page
    assert "nan" not in page


def test_the_pictures_are_drawn(campaign: Campaign, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from evaluate import pictures

    found = {name: Found([0.9, 1.0, math.inf], [0.1, 0.7]) for name in METHODS}
    pictures.save_figures(tmp_path / "figures.png", campaign)
    pictures.save_methods(tmp_path / "methods.png", found, dict.fromkeys(METHODS, 1e-5))
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("figures.png", "methods.png"))


def test_the_report_uses_the_seeds_of_the_evaluation() -> None:
    assert {task.seed for task in tasks(2)} == {EVALUATION[0], EVALUATION[1]}
    assert {task.family for task in tasks(1)} == FAMILIES.keys()


def test_a_curve_goes_from_everything_to_nothing() -> None:
    false, hit = Found([0.5, 0.9, math.inf], [0.2, 0.6]).curve(np.array([0.0, 0.5, 0.85, 2.0]))
    assert false.tolist() == [1.0, 0.5, 0.0, 0.0]
    assert hit == pytest.approx([1.0, 1.0, 2 / 3, 1 / 3])


@pytest.mark.parametrize("spin", [0.0, 0.02, -0.02])
def test_the_numbers_of_the_methods_are_near_the_utilisation(spin: float) -> None:
    angle = np.arange(16) * math.pi / 8.0
    ring = Scene(
        "", 0.01 * np.cos(angle), 0.01 * np.sin(angle), np.full(16, 0.5), 0.5, np.array((1.0, 0.5)), np.zeros(2)
    )
    exact = methods.utilisation(ring.x, ring.y, ring.loads, ring.mu, ring.tangential, spin, ring.about).value
    assert methods.ellipse_number(ring, spin) == pytest.approx(exact, rel=0.1)
    if spin == 0.0:
        assert methods.paper_number(ring, spin) == pytest.approx(exact, rel=0.1)


def test_methods_are_asked_about_slips_and_safe_spans() -> None:
    t = np.arange(0.0, 2.0, 0.01)
    found: tuple[list[float], list[float]] = ([], [])
    methods._collect(found, course((1.2, 1.5), used=0.5), t, np.where(t > 1.0, 0.95, 0.3))
    assert found == ([0.95], [0.3])


def test_a_box_stays_in_a_strong_grip_and_falls_from_a_weak_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the report, but poured three times as fast."""
    for name, seconds in (("POUR_S", 1.9), ("POURED_S", 2.9), ("END_S", 3.4)):
        monkeypatch.setattr(closed_loop, name, seconds)
    strong = closed_loop.Mode("strong", reflex=False, force_n=closed_loop.STRONG_N)
    assert closed_loop.hold(3, closed_loop.MODES[0]).dropped
    held = closed_loop.hold(3, strong)
    assert not held.dropped
    assert held.peak_n == pytest.approx(closed_loop.STRONG_N, abs=0.3)


def test_the_config_of_the_loop_has_its_mu_and_its_reflex() -> None:
    text = closed_loop.settings_text(closed_loop.MODES[3], 0.5)
    assert text.count("mu = 0.6000") == 2
    assert "[reflex]\nenabled = true" in text
