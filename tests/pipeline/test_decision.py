"""Levels rise at their thresholds, fall a hysteresis below, and say why."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.config import Levels
from slipd.pipeline.decision import CAUTION, NAMES, SEVERITY, STABLE, WARNING, LevelGate, danger_reasons
from slipd_client.messages import LEVELS


@pytest.fixture
def gate() -> LevelGate:
    return LevelGate(Levels(caution=0.70, warning=0.85, hysteresis=0.05))


@pytest.mark.parametrize(
    ("utilisation", "step"),
    [(0.0, STABLE), (0.699, STABLE), (0.70, CAUTION), (0.849, CAUTION), (0.85, WARNING), (math.inf, WARNING)],
)
def test_a_level_is_reached_at_its_threshold(gate: LevelGate, utilisation: float, step: int) -> None:
    assert gate.update(utilisation) == step


@pytest.mark.parametrize(
    ("path", "steps"),
    [
        ((0.70, 0.651, 0.649), (CAUTION, CAUTION, STABLE)),
        ((0.85, 0.801, 0.799, 0.651, 0.649), (WARNING, WARNING, CAUTION, CAUTION, STABLE)),
        ((0.85, 0.66), (WARNING, CAUTION)),
        ((0.85, 0.5), (WARNING, STABLE)),
        ((0.66, 0.81), (STABLE, CAUTION)),
        ((math.inf, 0.5), (WARNING, STABLE)),
    ],
)
def test_a_level_is_left_a_hysteresis_below_it(
    gate: LevelGate, path: tuple[float, ...], steps: tuple[int, ...]
) -> None:
    assert tuple(map(gate.update, path)) == steps


def test_a_new_contact_begins_without_the_old_ones_hysteresis(gate: LevelGate) -> None:
    gate.update(0.86)
    gate.reset()
    assert gate.update(0.84) == CAUTION


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=30))
def test_hysteresis_only_ever_holds_a_level_up_and_by_no_more_than_its_width(path: list[float]) -> None:
    gate = LevelGate(Levels(caution=0.70, warning=0.85, hysteresis=0.05))
    before = STABLE
    for utilisation in path:
        step = gate.update(utilisation)
        bare = (utilisation >= 0.70) + (utilisation >= 0.85)
        held = (utilisation >= 0.70 - 0.05) + (utilisation >= 0.85 - 0.05)
        assert bare <= step <= max(bare, min(before, held))
        before = step


def test_the_reason_is_what_uses_up_the_friction() -> None:
    assert danger_reasons(0.8, 0.79, 0.7) == ("translation",)
    assert danger_reasons(0.8, 0.1, 0.7) == ("rotation",)
    assert danger_reasons(0.95, 0.75, 0.7) == ("rotation", "translation")
    assert danger_reasons(math.inf, 0.1, 0.7) == ("unsupportable", "rotation")


@given(st.floats(0.0, 3.0), st.floats(0.0, 1.0))
def test_danger_never_goes_without_a_reason(utilisation: float, share: float) -> None:
    assert danger_reasons(utilisation, share * utilisation, 0.7)


def test_every_level_of_the_wire_has_its_severity() -> None:
    assert set(SEVERITY) == set(LEVELS)
    assert len(set(SEVERITY.values())) == len(LEVELS)
    assert set(NAMES) <= set(LEVELS)
    assert SEVERITY["stable"] < SEVERITY["unknown"] < SEVERITY["caution"], "unknown is not no slip"
