"""The reflex raises the grip by what is needed, and never oscillates."""

from __future__ import annotations

from dataclasses import replace

import pytest
from held_reflex import NOT_KNOWN, SETTINGS, Held

from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.reflex import Reflex, ReflexAct

MS = 1_000_000
T0 = 50_000_000_000


def test_a_warning_raises_at_once_by_what_one_period_allows() -> None:
    held = Held()
    assert held.watch("warning", 9.0, 5) == [ReflexAct(6.0, 5.0, "needed")]


def test_it_goes_on_at_its_rate_and_ends_at_what_is_needed() -> None:
    held = Held()
    acts = held.watch("warning", 7.5, 1000)
    assert [act.force_n for act in acts] == pytest.approx([6.0, 7.0, 7.5])
    assert [act.from_n for act in acts] == pytest.approx([5.0, 6.0, 7.0])


@pytest.mark.parametrize("level", ["no_contact", "stable", "caution", "unknown"])
def test_nothing_is_raised_without_a_warning(level: str) -> None:
    assert Held().watch(level, 9.0, 500) == []


def test_nothing_is_raised_where_the_grip_is_enough() -> None:
    assert Held().watch("warning", 4.9, 500) == []


@NOT_KNOWN
def test_N2_nothing_is_raised_on_a_warning_where_the_need_is_not_known(unknown: float | None) -> None:
    assert Held().watch("warning", unknown, 500) == []


@NOT_KNOWN
def test_N2_without_a_measured_grip_the_commanded_force_counts(unknown: float | None) -> None:
    held = Held()
    held.watch("stable", 5.0, 200, internal_n=unknown)
    held.watch("warning", 7.0, 500, internal_n=unknown)
    assert held.force_n == pytest.approx(7.0)


def test_a_gripper_that_grips_less_than_commanded_is_commanded_more() -> None:
    held = Held()
    held.watch("caution", 5.0, 200, internal_n=4.0)
    held.watch("warning", 7.0, 500, internal_n=4.0)
    assert held.force_n >= 8.0


def test_a_gripper_that_grips_more_than_commanded_is_commanded_less() -> None:
    held = Held()
    held.watch("caution", 5.0, 200, internal_n=7.0)
    assert held.watch("warning", 6.9, 50, internal_n=7.0) == []


def test_what_one_grasp_taught_is_forgotten_with_it() -> None:
    held = Held()
    held.watch("caution", 5.0, 200, internal_n=3.0)
    held.policy.end_grasp()
    held.watch("no_contact", None, 5)
    held.policy.record_force(5.0, held.t_ns)
    assert held.watch("warning", 4.9, 20) == []


def test_A8_a_gripper_that_follows_late_is_not_wound_up() -> None:
    held = Held()
    held.watch("caution", 5.0, 200, internal_n=5.0)
    held.watch("warning", 9.0, 90, internal_n=5.0)  # it has not yet moved
    held.watch("warning", 9.0, 500, internal_n=9.0)
    assert held.force_n == pytest.approx(9.0)


def test_what_is_felt_by_a_doubtful_finger_is_not_learned() -> None:
    held = Held()
    held.watch("caution", 5.0, 200, internal_n=1.0, trusted=False)
    held.watch("warning", 6.0, 90, internal_n=5.0)
    assert held.force_n == pytest.approx(6.0)


@pytest.mark.parametrize("needed_n", [None, 4.0, 5.05])
def test_a_slip_that_should_not_be_asks_for_the_gain(needed_n: float | None) -> None:
    held = Held()
    assert held.watch("slipping", needed_n, 50) == [ReflexAct(6.0, 5.0, "slipping")]


def test_a_slip_under_too_little_grip_asks_for_what_is_needed() -> None:
    held = Held()
    assert {act.reason for act in held.watch("slipping", 8.0, 100)} == {"needed"}
    assert held.force_n == pytest.approx(8.0)


def test_A8_a_slip_that_goes_on_asks_again_only_when_the_last_rise_could_be_felt() -> None:
    held = Held()
    acts = held.watch("slipping", None, 245)
    assert [act.force_n for act in acts] == pytest.approx([6.0, 7.0, 7.2, 8.2, 8.64])


def test_A8_a_slip_that_comes_and_goes_asks_no_faster() -> None:
    held = Held()
    for _ in range(10):
        held.watch("slipping", None, 5)
        held.watch("warning", 4.0, 5)
    assert held.force_n == pytest.approx(6.0)


def test_a_goal_that_a_client_has_gone_below_is_given_up() -> None:
    held = Held(replace(SETTINGS, slip_gain=2.0))
    held.watch("slipping", None, 5)
    held.policy.record_force(4.0, held.t_ns)
    assert held.watch("slipping", None, 95) == []
    held.watch("slipping", None, 500)
    assert held.force_n > 4.0


def test_nothing_exceeds_the_ceiling() -> None:
    held = Held()
    held.watch("warning", 24.0, 2000)
    assert held.force_n == 20.0
    held.policy.record_force(22.0, held.t_ns)
    assert held.watch("warning", 24.0, 500) == [], "nor does it lower what a client asked for above it"


def test_nothing_exceeds_the_limit_of_the_policy() -> None:
    held = Held(replace(SETTINGS, ceiling_n=40.0))
    held.watch("warning", 30.0, 2000)
    assert held.force_n == 25.0


def test_A8_the_budget_is_used_up_and_then_there_is_quiet() -> None:
    held = Held(budget_n=3.5)
    held.watch("warning", 24.0, 500)
    assert held.force_n == pytest.approx(8.5)
    assert held.watch("warning", 24.0, 5000) == []


def test_without_a_limit_nothing_moves() -> None:
    policy = GripPolicy(GripLimits(0.0, None, 2.0, 10.0, 2.0, 25.0), 200)
    policy.record_force(5.0, T0)
    assert Reflex(SETTINGS, policy).decide("warning", 9.0, None, True, T0) is None


def test_nothing_gripped_nothing_done() -> None:
    held = Held()
    held.policy.end_grasp()
    assert held.watch("slipping", 9.0, 200) == []
    held.policy.record_force(5.0, held.t_ns)
    assert held.watch("warning", 9.0, 5) != []


def test_A6_D4_a_latched_fault_stops_it_until_it_is_acknowledged() -> None:
    held = Held()
    held.watch("warning", 9.0, 5)
    held.policy.latch("E-stop")
    assert held.watch("warning", 9.0, 500) == []
    held.policy.acknowledge()
    assert held.watch("warning", 9.0, 5) == [ReflexAct(7.0, 6.0, "needed")]


def test_A7_a_sensor_lost_during_the_rise_ends_it_at_the_last_value() -> None:
    held = Held()
    held.watch("warning", 12.0, 60)
    force_n = held.force_n
    assert held.watch("warning", 12.0, 500, trusted=False) == []
    assert held.watch("slipping", 12.0, 500, trusted=False) == []
    assert 5.0 < held.force_n == force_n < 12.0


def test_C4_a_loop_that_stood_still_makes_up_for_nothing() -> None:
    held = Held()
    held.watch("warning", 15.0, 5)
    held.t_ns += 10_000 * MS
    assert held.watch("warning", 15.0, 5) == [ReflexAct(7.0, 6.0, "needed")]


def test_C4_an_earlier_time_counts_as_the_last() -> None:
    held = Held()
    held.watch("warning", 15.0, 5)
    held.t_ns -= 10_000 * MS
    assert held.watch("warning", 15.0, 500) == []


def test_C4_an_act_of_long_ago_that_was_not_carried_out_is_not_built_upon() -> None:
    held = Held()
    assert held.reflex.decide("warning", 15.0, None, True, held.t_ns) is not None
    held.t_ns += 95 * MS
    assert held.watch("warning", 15.0, 5) == [ReflexAct(6.0, 5.0, "needed")]


def test_a_rise_goes_on_from_where_a_client_has_lowered_to() -> None:
    held = Held()
    held.watch("warning", 15.0, 5)
    held.policy.record_force(4.5, held.t_ns)
    assert held.watch("warning", 15.0, 20) == [ReflexAct(5.5, 4.5, "needed")]


@pytest.mark.parametrize(("rate", "unit_n"), [(2.0, 0.1), (2.0, 0.85), (50.0, 0.85)])
def test_coarse_settings_are_reached_too_however_slow_the_rise(rate: float, unit_n: float) -> None:
    held = Held(replace(SETTINGS, raise_n_per_s=rate), unit_n=unit_n)
    held.watch("warning", 9.0, 6000)
    assert 9.0 - unit_n - 0.1 <= held.force_n <= 9.0


@pytest.mark.parametrize("unit_n", [0.0, 0.85])
def test_A9_step_and_rate_of_the_gripper_bind_it_too(unit_n: float) -> None:
    held = Held(unit_n=unit_n, step_n=2.0, rate_n_per_s=10.0)
    acts = held.watch("warning", 24.0, 500)
    assert max(act.force_n - act.from_n for act in acts) <= 1.0 + 1e-9
    assert held.force_n == pytest.approx(11.9 - unit_n / 2, abs=0.3 + unit_n / 2), "a step at once, then 10 N/s"


@pytest.mark.parametrize("unit_n", [0.0, 0.85])
def test_A8_what_has_no_effect_is_asked_for_seldom(unit_n: float) -> None:
    held = Held(unit_n=unit_n)
    held.policy.record_force(5.1 if unit_n else 5.0, T0)
    acts = held.watch("warning", 5.5, 1000)
    assert len(acts) <= (10 if unit_n else 1)
