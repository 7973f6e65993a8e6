"""Levels rise at once at their thresholds, and fall a hysteresis below them after a dwell: noise changes them once."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from load_course import MU, Watch, contact_rows

from slipd.fusion.levels import Uncertainty
from slipd.fusion.rows import CAUTION, FREE, STABLE, WARNING

DWELL = 260
"""Readings at 1 kHz after which a level may be left."""


@pytest.fixture
def gate() -> Watch:
    return Watch()


@pytest.mark.parametrize(
    ("utilisation", "step"),
    [(0.0, STABLE), (0.699, STABLE), (0.70, CAUTION), (0.849, CAUTION), (0.85, WARNING), (math.inf, WARNING)],
)
def test_a_level_is_reached_at_its_threshold(gate: Watch, utilisation: float, step: int) -> None:
    assert gate.step(utilisation) == step


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
def test_a_level_is_left_a_hysteresis_below_it(gate: Watch, path: tuple[float, ...], steps: tuple[int, ...]) -> None:
    assert tuple([gate.step(used) for _ in range(DWELL)][-1] for used in path) == steps


def test_a_level_is_left_only_after_a_while(gate: Watch) -> None:
    gate.step(0.9)
    steps = [gate.step(0.5) for _ in range(DWELL)]
    assert steps[:240] == [WARNING] * 240
    assert steps[-1] == STABLE


def test_a_load_that_returns_within_the_dwell_changes_nothing(gate: Watch) -> None:
    steps = [gate.step(0.9 if k % 200 == 0 else 0.4) for k in range(600)]
    assert set(steps) == {WARNING}


def test_another_mu_changes_the_level_at_once(gate: Watch) -> None:
    gate.step(0.9)
    rows = contact_rows(1, 0.4 * 10.0 * MU, 10.0, 0.4, 1e-3)
    gate.watch.assess(rows, 2.0 * MU, Uncertainty(), 0.0)
    assert rows["assessment"]["friction_step"][0] == STABLE


def test_a_new_contact_begins_without_the_old_ones_hysteresis(gate: Watch) -> None:
    gate.step(0.86)
    gate.take(0.0, 0.1, math.nan, phase=FREE)
    assert gate.step(0.84) == CAUTION


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=30))
def test_a_level_is_never_below_that_of_the_load_nor_above_the_one_before(path: list[float]) -> None:
    gate = Watch()
    before = STABLE
    for used in path:
        step = gate.step(used)
        bare = (used >= 0.70) + (used >= 0.85)
        assert bare <= step <= max(bare, before)
        before = step
