"""Levels rise at their thresholds and fall a hysteresis below; a drop of R is a slip only when the load itself gives
way, quickly, from near the limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.fusion.levels import Assessment, ContactWatch, SlipSettings, Thresholds, Uncertainty
from slipd.fusion.rows import CAUTION, FREE, READING, STABLE, TOUCHING, WARNING, Rows, new_rows

MU = 0.6


def row_of(count: int, load_n: object, normal_n: float, used: object, t_s: object, phase: int = TOUCHING) -> Rows:
    """Readings of a contact at the pad's centre, well inside its outline, pulled along X."""
    rows = new_rows(READING, count)
    contact, utilisation = rows["contact"], rows["utilisation"]
    rows["t_s"], rows["phase"], rows["tipping_margin_m"] = t_s, phase, 0.01
    contact["normal_n"], contact["fx_n"] = normal_n, load_n
    contact["friction_ratio"] = contact["fx_n"] / normal_n
    for name in ("value", "lower", "upper"):
        utilisation[name] = used
    return rows


class Watch:
    """A contact whose readings come one by one, at 1 kHz."""

    def __init__(self, settings: SlipSettings | None = None) -> None:
        self.watch = ContactWatch(Thresholds(0.70, 0.85, 0.05), settings or SlipSettings(), 0.001, 0.3)
        self.k = 0

    def take(self, load_n: float, normal_n: float, used: float, *, phase: int = TOUCHING) -> Assessment:
        row = row_of(1, load_n, normal_n, used, self.k * 1e-3, phase)
        self.k += 1
        self.watch.assess(row, MU, Uncertainty(), 0.0)
        return Assessment(*row["assessment"].item(0))

    def step(self, used: float) -> int:
        return self.take(1.0, 10.0, used).friction_step

    def slips(self, load_n: float, normal_n: float, used: float) -> bool:
        return self.take(load_n, normal_n, used).slips


def told(tangential: np.ndarray, normal: np.ndarray, settings: SlipSettings | None = None) -> list[int]:
    """Milliseconds at which a slip is told, readings coming at 1 kHz."""
    watch = Watch(settings)
    return [k for k, (ft, fn) in enumerate(zip(tangential, normal, strict=True)) if watch.slips(ft, fn, ft / fn / MU)]


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
    assert tuple(map(gate.step, path)) == steps


def test_a_new_contact_begins_without_the_old_ones_hysteresis(gate: Watch) -> None:
    gate.step(0.86)
    gate.take(0.0, 0.1, math.nan, phase=FREE)
    assert gate.step(0.84) == CAUTION


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=30))
def test_hysteresis_only_ever_holds_a_level_up_and_by_no_more_than_its_width(path: list[float]) -> None:
    gate = Watch()
    before = STABLE
    for utilisation in path:
        step = gate.step(utilisation)
        bare = (utilisation >= 0.70) + (utilisation >= 0.85)
        held = (utilisation >= 0.70 - 0.05) + (utilisation >= 0.85 - 0.05)
        assert bare <= step <= max(bare, min(before, held))
        before = step


def test_the_drop_from_static_to_dynamic_friction_is_reported_at_once() -> None:
    load = np.concatenate((np.linspace(2.0, 6.0, 400), np.full(200, 4.5)))
    noise = np.random.default_rng(0).normal(0, 0.02, 600)
    found = told(load + noise, np.full(600, 10.0))
    assert 400 <= found[0] <= 402


def test_a_slip_is_reported_for_its_hold_time() -> None:
    load = np.concatenate((np.full(100, 6.0), np.full(900, 4.5)))
    found = told(load, np.full(1000, 10.0))
    assert found == list(range(found[0], found[0] + 250))


def test_a_tightened_grip_is_no_slip() -> None:
    assert (
        told(np.full(300, 5.5), np.concatenate((np.full(100, 10.0), np.linspace(10, 25, 50), np.full(150, 25.0)))) == []
    )


def test_setting_an_object_down_is_no_slip() -> None:
    slowly = np.concatenate((np.full(100, 5.5), np.linspace(5.5, 0.0, 600)))
    assert told(slowly, np.full(700, 10.0)) == []


def test_a_load_that_gives_way_far_from_the_limit_is_no_slip() -> None:
    assert told(np.concatenate((np.full(100, 2.0), np.full(100, 1.0))), np.full(200, 10.0)) == []


def test_opening_the_gripper_is_no_slip_while_r_stays() -> None:
    fall = np.concatenate((np.full(100, 1.0), np.linspace(1.0, 0.2, 60)))
    assert told(5.0 * fall, 10.0 * fall) == []


def test_an_unknown_utilisation_arms_nothing() -> None:
    watch = Watch()
    assert not any(watch.slips(6.0 if k < 50 else 3.0, 10.0, math.nan) for k in range(200))


def test_the_end_of_the_contact_forgets_a_slip() -> None:
    watch = Watch()
    for k in range(60):
        slips = watch.slips(6.0 if k < 50 else 4.0, 10.0, 0.9)
    assert slips
    watch.take(0.0, 0.1, math.nan, phase=FREE)
    assert not watch.slips(4.0, 10.0, 0.7)


def test_a_smaller_fall_is_a_slip_once_the_coefficients_are_known_better() -> None:
    load = np.concatenate((np.full(100, 6.0), np.full(100, 5.5)))
    assert told(load, np.full(200, 10.0)) == []
    watch = Watch()
    watch.watch.set_drop(0.06)
    assert any(watch.slips(ft, 10.0, ft / 6.0) for ft in load)


def test_a_read_longer_than_the_window_is_followed_as_a_whole() -> None:
    count = 700
    load = np.where(np.arange(count) < 400, 6.0, 4.5)
    rows = row_of(count, load, 10.0, load / 6.0, np.arange(count) * 1e-4)
    watch = ContactWatch(Thresholds(0.70, 0.85, 0.05), SlipSettings(), 0.001, 0.3)
    watch.assess(rows, MU, Uncertainty(), 0.0)
    assert np.flatnonzero(rows["assessment"]["slips"])[0] == 400
