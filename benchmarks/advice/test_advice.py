"""The benchmark of the advice: what it draws, and what it says of what happened."""

from __future__ import annotations

import math

import pytest
from advice.__main__ import Carry, Outcome, carried, count, draw, report
from advice.safe_speed import holds_scale

from slipd.tools.sim.scene_parts import GRAVITY_MPS2


def test_a_grasp_that_is_drawn_holds_at_rest_and_its_peaks_are_as_stated() -> None:
    for seed in range(20):
        grasp = draw(seed)
        assert 0.45 <= grasp.mass_kg * GRAVITY_MPS2 / (2.0 * grasp.mu * grasp.grip_n) <= 0.7
        for move in grasp.path[1:]:
            peaks = [math.hypot(*move.acceleration(move.takes_s * i / 1000, 1.0)) for i in range(1001)]
            assert 3.0 <= max(peaks) <= 10.001


@pytest.mark.long
def test_the_oracle_is_the_fastest_motion_that_holds() -> None:
    grasp = draw(1)
    limits = [holds_scale(move, grasp.mass_kg, grasp.grip_n, grasp.mu) for move in grasp.path]
    assert min(limits) < 0.9
    assert count(carried(grasp, [0.97 * limit for limit in limits]), "slide_begins") == 0
    assert count(carried(grasp, [min(1.0, 1.08 * limit) for limit in limits]), "slide_begins") > 0


def test_the_report_has_slips_drops_and_the_cost(capsys: pytest.CaptureFixture[str]) -> None:
    advised = (Carry(0, 0, (2.0, 1.0)), Carry(1, 0, (1.0,), "no answer"))
    outcome = Outcome(draw(0), Carry(2, 1, (1.0, 1.0)), advised, (1.0, 1.0))
    report([outcome, outcome])
    shown = capsys.readouterr().out
    assert "without advice: 2 glasses, 2 slipped, 2 dropped, 0 not carried" in shown
    assert "mean +50.0 %" in shown
    assert "second carry with advice: 2 glasses, 2 slipped, 0 dropped, 2 not carried" in shown
    assert "ended early: no answer" in shown
