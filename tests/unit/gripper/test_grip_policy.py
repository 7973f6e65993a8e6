"""A grip changes within the limits only, however often and by whomever it is asked; a fault latches."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from judging import ask, code

from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.types.permit import Permit
from slipd.types.refusal import Refusal

MS = 1_000_000
T0 = 50_000_000_000


def change(policy: GripPolicy, force_n: float, t_ns: int) -> Refusal | None:
    """Why a client may not have this force now."""
    return refusal_of(ask(policy, "close", force_n, t_ns))


def first(policy: GripPolicy, force_n: float) -> Refusal | None:
    return change(policy, force_n, T0)


def react(policy: GripPolicy, force_n: float, t_ns: int = T0) -> Refusal | None:
    """Why the reflex may not have this force."""
    return refusal_of(ask(policy, "reflex", force_n, t_ns))


def refusal_of(found: Refusal | Permit | None) -> Refusal | None:
    return found if isinstance(found, Refusal) else None


@pytest.mark.parametrize("force_n", [3.0, 10.0, 25.0])
def test_a_force_within_the_limits_may_be_asked(policy: GripPolicy, force_n: float) -> None:
    assert first(policy, force_n) is None


@pytest.mark.parametrize("force_n", [2.999, -1.0, 0.0, -0.0, 25.001, 1e300])
def test_A3_a_force_beyond_the_limits_is_refused_and_not_clamped(policy: GripPolicy, force_n: float) -> None:
    refusal = first(policy, force_n)
    assert refusal is not None
    assert (refusal.code, refusal.field) == ("out_of_range", "force_n")
    assert "3 to 25 N" in refusal.message


@pytest.mark.parametrize("force_n", [math.nan, math.inf, -math.inf])
def test_N2_a_force_that_is_no_number_is_refused(policy: GripPolicy, force_n: float) -> None:
    """max(0, min(255, nan)) is 255 in Python: a comparison alone would let NaN grip with all there is."""
    refusal = first(policy, force_n)
    assert refusal is not None
    assert (refusal.code, refusal.field) == ("not_finite", "force_n")


@given(force_n=st.floats())
def test_only_forces_between_the_limits_ever_pass(force_n: float) -> None:
    passed = first(GripPolicy(GripLimits(3.0, 25.0, 2.0, 10.0, 2.0, 12.0), 1000), force_n) is None
    assert passed == (3.0 <= force_n <= 25.0)


@given(force_n=st.floats())
def test_without_a_limit_nothing_may_be_asked(force_n: float) -> None:
    assert code(first(GripPolicy(GripLimits(0.0, None, 2.0, 10.0, 2.0, 12.0), 1000), force_n)) == "no_limit"


@pytest.mark.parametrize("force_n", [3.0, 25.0])
def test_the_first_force_of_a_grasp_meets_the_limits_alone(policy: GripPolicy, force_n: float) -> None:
    assert change(policy, force_n, T0) is None
    assert code(change(policy, 25.1, T0)) == "out_of_range"
    policy.record_force(force_n, T0)
    assert (policy.force_n, policy.requested_n) == (force_n, force_n)


@pytest.mark.parametrize("force_n", [12.0 + 1e-6, 8.0 - 1e-6, 3.0, 24.0])
def test_A3_a_held_object_feels_no_more_than_a_step(policy: GripPolicy, force_n: float) -> None:
    policy.record_force(10.0, T0)
    refusal = change(policy, force_n, T0 + 10_000 * MS)
    assert refusal is not None
    assert (refusal.code, refusal.field) == ("out_of_range", "force_n")
    assert policy.force_n == 10.0


@pytest.mark.parametrize(("from_n", "force_n"), [(3.1, 5.1), (4.1, 6.1), (8.3, 10.3), (10.3, 8.3)])
def test_a_whole_step_is_a_step_however_it_is_rounded(policy: GripPolicy, from_n: float, force_n: float) -> None:
    policy.record_force(from_n, T0)
    assert change(policy, force_n, T0) is None


@pytest.mark.parametrize("force_n", [math.nan, math.inf, -math.inf])
def test_N2_no_change_to_what_is_no_number(policy: GripPolicy, force_n: float) -> None:
    policy.record_force(5.0, T0)
    assert code(change(policy, force_n, T0)) == "not_finite"
    assert code(react(policy, force_n)) == "not_finite"
    with pytest.raises(ValueError, match="must be finite"):
        policy.record_force(force_n, T0)
    assert policy.force_n == 5.0


@pytest.mark.parametrize(("change_n", "wait_ms"), [(2.0, 200), (0.5, 50), (-2.0, 1000), (-0.5, 250)])
def test_too_fast_names_the_time_after_which_the_request_is_granted(
    policy: GripPolicy, change_n: float, wait_ms: int
) -> None:
    policy.record_force(10.0, T0)
    now_n = 10.0 + math.copysign(2.0, change_n)
    assert change(policy, now_n, T0) is None
    policy.record_force(now_n, T0)
    refusal = change(policy, now_n + change_n, T0)
    assert refusal is not None
    assert refusal.code == "too_fast"
    assert f"in {wait_ms} ms" in refusal.message
    assert code(change(policy, now_n + change_n, T0 + (wait_ms - 1) * MS)) == "too_fast"
    assert change(policy, now_n + change_n, T0 + wait_ms * MS) is None
    assert policy.force_n == now_n, "nothing moves later by itself"


def test_raising_does_not_pay_for_lowering_nor_the_other_way(policy: GripPolicy) -> None:
    policy.record_force(10.0, T0)
    policy.record_force(12.0, T0)
    assert change(policy, 10.0, T0) is None
    policy.record_force(10.0, T0)
    assert code(change(policy, 10.5, T0)) == "too_fast"
    assert code(change(policy, 9.5, T0)) == "too_fast"


def test_to_ask_for_what_is_in_force_is_never_too_fast(policy: GripPolicy) -> None:
    policy.record_force(10.0, T0)
    policy.record_force(12.0, T0)
    policy.record_force(10.0, T0)
    assert change(policy, 10.0, T0) is None


def test_long_rest_allows_one_step_and_not_two(policy: GripPolicy) -> None:
    policy.record_force(10.0, T0)
    policy.record_force(12.0, T0 + 3_600_000 * MS)
    assert code(change(policy, 12.5, T0 + 3_600_000 * MS)) == "too_fast"


def test_C4_an_earlier_time_allows_nothing_more(policy: GripPolicy) -> None:
    policy.record_force(10.0, T0)
    policy.record_force(12.0, T0)
    assert code(change(policy, 14.0, T0 - 10_000 * MS)) == "too_fast"
    assert code(change(policy, 14.0, T0 + 199 * MS)) == "too_fast"
    assert change(policy, 14.0, T0 + 200 * MS) is None


def test_A8_all_raises_of_one_grasp_together_stay_within_its_budget(policy: GripPolicy) -> None:
    policy.record_force(5.0, T0)
    for k in range(1, 13):  # raised by 2 N and lowered again, by a client and by the reflex in turn
        assert policy.reflex_most_n is not None
        policy.record_force(7.0, T0 + 2 * k * 1000 * MS, reflex=k % 2 == 0)
        policy.record_force(5.0, T0 + (2 * k + 1) * 1000 * MS, reflex=k % 2 == 0)
        if k == 11:
            assert code(change(policy, 5.1, T0 + 50_000 * MS)) == "budget_spent"
            assert react(policy, 7.0, T0 + 50_000 * MS) is None, "what clients raise is not taken from the reflex"
    later = T0 + 100_000 * MS
    assert policy.reflex_most_n == 5.0
    refusal = change(policy, 5.1, later)
    assert code(refusal) == code(react(policy, 5.1, later)) == "budget_spent"
    assert refusal is not None
    assert "the 12 N budget" in refusal.message
    assert change(policy, 4.0, later) is None, "it may always be lowered"
    policy.end_grasp()
    policy.record_force(5.0, later)
    assert change(policy, 7.0, later) is None, "the next grasp has a budget of its own"


def test_what_was_put_back_stays_spent(policy: GripPolicy) -> None:
    policy.record_force(5.0, T0)
    policy.record_force(15.0, T0, reflex=True)
    policy.record_force(17.0, T0)
    policy.restore(15.0)
    assert (policy.force_n, policy.requested_n, policy.reflex_most_n) == (15.0, 15.0, 17.0)
    policy.end_grasp()
    policy.restore(15.0)
    assert (policy.requested_n, policy.reflex_most_n) == (15.0, 17.0), "it was not let go, so it is the same grasp"
    assert policy.state(T0).budget_left_n == 10.0
    policy.restore(None)
    assert policy.force_n is policy.requested_n is None


def test_what_is_left_of_the_budget_may_be_used_up(policy: GripPolicy) -> None:
    policy.record_force(5.0, T0)
    policy.record_force(15.5, T0, reflex=True)
    later = T0 + 1000 * MS
    assert policy.reflex_most_n == 17.0
    assert react(policy, 17.0, later) is None
    assert code(react(policy, 17.01, later)) == "budget_spent"
    assert change(policy, 17.01, later) is None, "the reflex has a budget of its own"


def test_most_is_the_limit_where_the_budget_leaves_more_and_unknown_where_nothing_is_gripped(
    policy: GripPolicy,
) -> None:
    assert policy.reflex_most_n is None
    policy.record_force(20.0, T0)
    assert policy.reflex_most_n == 25.0
    unlimited = GripPolicy(GripLimits(0.0, None, 2.0, 10.0, 2.0, 12.0), 200)
    unlimited.record_force(5.0, T0)
    assert unlimited.reflex_most_n is None


def test_the_reflex_may_do_nothing_where_nothing_is_gripped(policy: GripPolicy) -> None:
    assert code(react(policy, 5.0)) == "not_ready"
    policy.record_force(5.0, T0)
    policy.end_grasp()
    assert code(react(policy, 5.0)) == "not_ready"
    assert (policy.force_n, policy.requested_n) == (None, None)


def test_the_reflex_keeps_what_the_client_asked_for_and_a_client_need_not(policy: GripPolicy) -> None:
    policy.record_force(5.0, T0)
    policy.record_force(7.0, T0, reflex=True)
    assert (policy.force_n, policy.requested_n) == (7.0, 5.0)
    assert react(policy, 5.0) is None
    assert react(policy, 5.1) is None
    assert code(react(policy, 4.9)) == "out_of_range"
    assert change(policy, 6.0, T0) is None
    policy.record_force(6.0, T0)
    assert code(react(policy, 5.9)) == "out_of_range"


def test_A9_the_reflex_keeps_step_and_rate_and_shares_them_with_the_client(policy: GripPolicy) -> None:
    policy.record_force(5.0, T0)
    assert code(react(policy, 7.1)) == "out_of_range"
    assert change(policy, 7.0, T0) is None
    policy.record_force(7.0, T0)
    assert policy.change_left_n(T0) == (2.0, 0.0)
    assert code(react(policy, 7.1)) == "too_fast"
    assert react(policy, 7.1, T0 + 10 * MS) is None
    policy.record_force(7.1, T0 + 10 * MS, reflex=True)
    assert code(change(policy, 7.2, T0 + 10 * MS)) == "too_fast"


def test_a_raise_by_the_reflex_leaves_a_client_no_allowance_and_no_debt(policy: GripPolicy) -> None:
    policy.record_force(5.0, T0)
    policy.record_force(11.0, T0, reflex=True)
    assert code(change(policy, 12.0, T0)) == "too_fast"
    assert change(policy, 12.0, T0 + 100 * MS) is None
    assert change(policy, 10.0, T0) is None


@pytest.mark.parametrize("fault", ["E-stop", "no reply", "echo differs"])
def test_A6_D4_D5_the_first_fault_is_kept_until_it_is_acknowledged(policy: GripPolicy, fault: str) -> None:
    policy.record_force(5.0, T0)
    policy.latch("")
    assert first(policy, 5.0) is None
    policy.latch(fault)
    policy.latch("what came of it")
    policy.latch("")
    refusal = first(policy, 5.0)
    assert refusal is not None
    assert refusal.code == "fault_latched"
    assert fault in refusal.message
    assert "fault.ack" in refusal.message
    assert code(react(policy, 6.0)) == "fault_latched"
    assert (policy.fault, policy.force_n) == (fault, 5.0)
    policy.acknowledge()
    assert (policy.fault, first(policy, 5.0), react(policy, 6.0)) == ("", None, None)
