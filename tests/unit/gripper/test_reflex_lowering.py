"""The reflex lowers only its own raises, after a long calm, slowly, and never below the need."""

from __future__ import annotations

from dataclasses import replace

import pytest
from held_reflex import NOT_KNOWN, SETTINGS, Held

from slipd.config import Reflex as ReflexConfig
from slipd.gripper.reflex import ReflexAct

MS = 1_000_000
T0 = 50_000_000_000


def calmed(settings: ReflexConfig = SETTINGS, unit_n: float = 0.0) -> Held:
    """Raised by the reflex from 5 N to 10 N."""
    held = Held(settings, unit_n=unit_n)
    held.watch("warning", 10.0, 500)
    return held


def test_it_lowers_only_when_calm_for_long_and_then_slowly() -> None:
    held = calmed()
    assert held.watch("stable", 5.0, 2000) == []
    acts = held.watch("stable", 5.0, 1000)
    assert held.force_n == pytest.approx(8.0, abs=0.11)
    assert {act.reason for act in acts} == {"calm"}
    assert max(act.from_n - act.force_n for act in acts) <= 0.1 + 1e-9


def test_it_lowers_as_fast_as_it_may() -> None:
    held = calmed(replace(SETTINGS, lower_n_per_s=30.0))
    held.watch("stable", 5.0, 2000)
    assert len(held.watch("stable", 5.0, 100)) == 5
    assert held.force_n == pytest.approx(7.0, abs=0.6)


def test_A9_it_lowers_no_faster_than_the_gripper_may() -> None:
    held = Held(replace(SETTINGS, lower_n_per_s=30.0), step_n=2.0, rate_n_per_s=2.0)
    held.policy.record_force(15.0, held.t_ns, reflex=True)
    held.watch("stable", 5.0, 2000)
    held.watch("stable", 5.0, 2000)
    assert held.force_n == pytest.approx(9.0, abs=0.4), "a step at once, then 2 N/s"


def test_it_lowers_to_a_tenth_above_the_need() -> None:
    held = calmed()
    held.watch("stable", 6.0, 10_000)
    assert 6.6 <= held.force_n <= 6.7


def test_it_keeps_what_the_client_asked_for_last() -> None:
    held = calmed()
    held.watch("stable", 1.0, 10_000)
    assert 5.0 <= held.force_n <= 5.1
    held.policy.record_force(7.0, held.t_ns)
    assert held.watch("stable", 1.0, 10_000) == []


def test_it_never_lowers_with_a_lowering_rate_of_zero() -> None:
    assert calmed(replace(SETTINGS, lower_n_per_s=0.0)).watch("stable", 1.0, 60_000) == []


@pytest.mark.parametrize("internal_n", [7.0, 13.0])
def test_the_needed_force_is_kept_if_the_gripper_grips_less_or_more_than_commanded(internal_n: float) -> None:
    held = calmed()
    held.watch("stable", 6.0, 10_000, internal_n=internal_n)
    assert held.force_n >= 6.0 * 1.1


@pytest.mark.parametrize("level", ["no_contact", "caution", "warning", "slipping", "unknown"])
def test_another_level_than_stable_begins_the_calm_anew(level: str) -> None:
    held = calmed(replace(SETTINGS, slip_gain=1.0))
    held.watch("stable", 5.0, 1990)
    held.watch(level, 5.0, 5)
    assert held.watch("stable", 5.0, 2000) == []
    assert held.watch("stable", 5.0, 500) != []


@NOT_KNOWN
def test_N2_a_need_that_is_not_known_begins_the_calm_anew(unknown: float | None) -> None:
    held = calmed()
    held.watch("stable", 5.0, 1990)
    assert held.watch("stable", unknown, 5000) == []
    assert held.watch("stable", 5.0, 2000) == []


def test_a_doubtful_finger_begins_the_calm_anew() -> None:
    held = calmed()
    held.watch("stable", 5.0, 1990)
    assert held.watch("stable", 5.0, 5000, trusted=False) == []
    assert held.watch("stable", 5.0, 2000) == []


def test_C4_what_was_not_looked_at_was_not_calm() -> None:
    held = calmed()
    held.watch("stable", 5.0, 2500)
    force_n = held.force_n
    held.t_ns += 251 * MS
    assert held.watch("stable", 5.0, 2000) == []
    assert held.force_n == force_n
    assert held.watch("stable", 5.0, 10_000, every_ms=250) != []


@pytest.mark.parametrize("unit_n", [0.1, 0.85])
def test_coarse_settings_are_lowered_no_faster(unit_n: float) -> None:
    held = calmed(unit_n=unit_n)
    before_n = held.force_n
    held.watch("stable", 5.0, 3000)
    assert before_n - 2.0 - unit_n - 0.01 <= held.force_n <= before_n - 2.0 + unit_n + 0.11


def test_A8_a_lowering_that_is_not_carried_out_is_not_caught_up_with() -> None:
    held = calmed()
    held.policy.latch("E-stop")
    assert held.watch("stable", 5.0, 10_000) == []
    held.policy.acknowledge()
    assert [act.force_n for act in held.watch("stable", 5.0, 5)] == [pytest.approx(9.9)]


def test_A8_a_lowering_without_effect_is_repeated_seldom() -> None:
    held = calmed()
    held.watch("stable", 5.0, 2000)
    acts = []
    for _ in range(200):
        held.t_ns += 5 * MS
        act = held.reflex.decide("stable", 5.0, None, True, held.t_ns)
        if act is not None:
            held.reflex.acted(act)
        acts.append(act)
    assert 5 <= len([act for act in acts if act]) <= 11


def test_A8_an_hour_of_a_need_that_swings_is_bounded_by_the_budget_and_by_the_calm() -> None:
    held = Held(replace(SETTINGS, calm_s=0.1), budget_n=12.0)
    acts = []
    for k in range(720):
        acts += held.watch("warning", 8.0 + k % 2, 100, every_ms=20)
        acts += held.watch("stable", 5.0 + k % 2, 4900, every_ms=100)
    rises = [act.force_n - act.from_n for act in acts if act.force_n > act.from_n]
    assert 11.5 <= sum(rises) <= 12.0 + 1e-6
    assert held.force_n >= 5.0


def test_after_a_lowering_that_was_not_carried_out_a_rise_starts_from_what_is_in_force() -> None:
    held = Held(replace(SETTINGS, calm_s=0.01))
    held.watch("warning", 6.0, 5)
    acts = [held.reflex.decide("stable", 1.0, None, True, held.t_ns + ms * MS) for ms in (5, 15, 70)]
    assert acts == [None, None, ReflexAct(5.9, 6.0, "calm")]
    assert held.reflex.decide("warning", 12.0, None, True, held.t_ns + 90 * MS) == ReflexAct(7.0, 6.0, "needed")
