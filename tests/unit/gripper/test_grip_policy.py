"""A grip changes within the limits only, however often and by whomever it is asked; a fault latches."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from judging import LIMITS, ask, code
from nanoseconds import MS

from slipd.gripper.grip_policy import GripPolicy
from slipd.gripper.intent import IntentKind
from slipd.types.permit import Permit, Refusal

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


@given(force_n=st.floats())
@example(force_n=3.0)
@example(force_n=2.999)
@example(force_n=25.0)
@example(force_n=25.001)
@example(force_n=math.nan)
def test_A3_N2_only_finite_forces_between_the_limits_pass_and_none_is_clamped(force_n: float) -> None:
    """max(0, min(255, nan)) is 255 in Python: a comparison alone would let NaN grip with all there is."""
    refusal = first(GripPolicy(LIMITS, 1000), force_n)
    if 3.0 <= force_n <= 25.0:
        assert refusal is None
        return
    assert (refusal.code, refusal.field) == ("out_of_range" if math.isfinite(force_n) else "not_finite", "force_n")
    assert ("3 to 25 N" in refusal.message) == math.isfinite(force_n)
    assert code(first(GripPolicy(replace(LIMITS, max_n=None), 1000), force_n)) == "no_limit"


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
    assert f"in {wait_ms} ms" in refusal.message
    later = [code(change(policy, now_n + change_n, T0 + ms * MS)) for ms in (0, wait_ms - 1, wait_ms)]
    assert later == ["too_fast", "too_fast", None]
    assert policy.force_n == now_n, "nothing moves later by itself"


CLIENT, REFLEX = "close", "reflex"
UP = [(10.0, 0, CLIENT), (12.0, 0, CLIENT)]
UP_AND_DOWN = [*UP, (10.0, 0, CLIENT)]
BY_REFLEX = [(5.0, 0, CLIENT), (7.0, 0, REFLEX)]


@pytest.mark.parametrize(
    ("sent", "kind", "asked_n", "at_ms", "refused"),
    [
        # a held object feels no more than a step, however it is rounded
        *(([(10.0, 0, CLIENT)], CLIENT, asked_n, 10_000, "out_of_range") for asked_n in (12 + 1e-6, 8 - 1e-6, 3, 24)),
        *(([(n, 0, CLIENT)], CLIENT, to_n, 0, None) for n, to_n in ((3.1, 5.1), (4.1, 6.1), (8.3, 10.3), (10.3, 8.3))),
        # raising does not pay for lowering, nor the other way; what is in force is never too fast
        (UP, CLIENT, 10.0, 0, None),
        (UP_AND_DOWN, CLIENT, 10.5, 0, "too_fast"),
        (UP_AND_DOWN, CLIENT, 9.5, 0, "too_fast"),
        (UP_AND_DOWN, CLIENT, 10.0, 0, None),
        # a long rest allows one step and not two, an earlier time nothing more
        ([(10.0, 0, CLIENT), (12.0, 3_600_000, CLIENT)], CLIENT, 12.5, 3_600_000, "too_fast"),
        (UP, CLIENT, 14.0, -10_000, "too_fast"),
        (UP, CLIENT, 14.0, 199, "too_fast"),
        (UP, CLIENT, 14.0, 200, None),
        # the reflex does nothing where nothing is gripped, and keeps what a client asked for; a client need not
        ([], REFLEX, 5.0, 0, "not_ready"),
        (BY_REFLEX, REFLEX, 5.0, 0, None),
        (BY_REFLEX, REFLEX, 5.1, 0, None),
        (BY_REFLEX, REFLEX, 4.9, 0, "out_of_range"),
        (BY_REFLEX, CLIENT, 6.0, 0, None),
        ([*BY_REFLEX, (6.0, 0, CLIENT)], REFLEX, 5.9, 0, "out_of_range"),
        # it keeps step and rate, and shares them with the client
        ([(5.0, 0, CLIENT)], REFLEX, 7.1, 0, "out_of_range"),
        ([(5.0, 0, CLIENT), (7.0, 0, CLIENT)], REFLEX, 7.1, 0, "too_fast"),
        ([(5.0, 0, CLIENT), (7.0, 0, CLIENT)], REFLEX, 7.1, 10, None),
        ([(5.0, 0, CLIENT), (7.0, 0, CLIENT), (7.1, 10, REFLEX)], CLIENT, 7.2, 10, "too_fast"),
        # what it overspends leaves no debt
        ([(5.0, 0, CLIENT), (11.0, 0, REFLEX)], CLIENT, 12.0, 0, "too_fast"),
        ([(5.0, 0, CLIENT), (11.0, 0, REFLEX)], CLIENT, 12.0, 100, None),
        ([(5.0, 0, CLIENT), (11.0, 0, REFLEX)], CLIENT, 10.0, 0, None),
        # what is left of its budget may be used up, and is its own
        ([(5.0, 0, CLIENT), (15.5, 0, REFLEX)], REFLEX, 17.0, 1000, None),
        ([(5.0, 0, CLIENT), (15.5, 0, REFLEX)], REFLEX, 17.01, 1000, "budget_spent"),
        ([(5.0, 0, CLIENT), (15.5, 0, REFLEX)], CLIENT, 17.01, 1000, None),
    ],
)
def test_A3_A9_C4_a_force_in_force_changes_within_step_rate_and_budget(
    policy: GripPolicy,
    sent: list[tuple[float, int, str]],
    kind: IntentKind,
    asked_n: float,
    at_ms: int,
    refused: str | None,
) -> None:
    for force_n, ms, by in sent:
        policy.record_force(force_n, T0 + ms * MS, reflex=by == REFLEX)
    before_n = policy.force_n
    assert code(refusal_of(ask(policy, kind, asked_n, T0 + at_ms * MS))) == refused
    assert policy.force_n == before_n, "asking changes nothing"
    assert policy.requested_n == next((force_n for force_n, _, by in reversed(sent) if by == CLIENT), None)


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
    assert "the 12 N budget" in refusal.message
    assert change(policy, 4.0, later) is None, "it may always be lowered"
    policy.end_grasp()
    assert policy.reflex_most_n is None, "nothing is gripped"
    policy.record_force(20.0, later)
    assert policy.reflex_most_n == 25.0, "the limit, where the budget leaves more"
    assert change(policy, 22.0, later) is None, "the next grasp has a budget of its own"


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
