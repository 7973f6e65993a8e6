"""Who holds the lease of the gripper, and for how long; its end moves nothing."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from judging import code

from slipd.gripper.grip_policy import GripLimits, GripPolicy

MS = 1_000_000
T0 = 50_000_000_000
ANN, BEN = b"ann", b"ben"


def test_nobody_holds_the_lease_at_the_beginning(policy: GripPolicy) -> None:
    assert policy.lease.holder(T0) is None
    assert policy.lease.expires_in_s(T0) is None
    assert code(policy.lease.check(ANN, T0)) == "no_lease"
    assert code(policy.lease.renew(ANN, T0)) == "no_lease"
    assert code(policy.lease.release(ANN, T0)) == "no_lease"


def test_a_lease_lives_until_its_very_last_nanosecond(policy: GripPolicy) -> None:
    assert policy.lease.acquire(ANN, 200, T0) is None
    end = T0 + 200 * MS
    assert policy.lease.check(ANN, end - 1) is None
    assert policy.lease.expires_in_s(end - 1) == pytest.approx(1e-9)
    assert code(policy.lease.check(ANN, end)) == "no_lease"
    assert policy.lease.expires_in_s(end) is None
    assert policy.lease.acquire(BEN, 200, end) is None


def test_A4_another_client_is_refused_while_the_lease_lives(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    refusal = policy.lease.acquire(BEN, 200, T0 + 50 * MS)
    assert code(refusal) == "lease_held"
    assert refusal is not None
    assert "150 ms" in refusal.message
    assert code(policy.lease.check(BEN, T0 + 50 * MS)) == "no_lease"
    assert code(policy.lease.release(BEN, T0 + 50 * MS)) == "no_lease"
    assert policy.lease.holder(T0 + 50 * MS) == ANN


def test_a_renewal_begins_the_same_time_anew(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    assert policy.lease.renew(ANN, T0 + 150 * MS) is None
    assert policy.lease.holder(T0 + 350 * MS - 1) == ANN
    assert policy.lease.holder(T0 + 350 * MS) is None


def test_a_lease_that_has_ended_cannot_be_renewed(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    assert code(policy.lease.renew(ANN, T0 + 200 * MS)) == "no_lease"


def test_the_holder_may_ask_again_for_another_time(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 1000, T0)
    assert policy.lease.acquire(ANN, 100, T0) is None
    assert policy.lease.holder(T0 + 100 * MS) is None


def test_a_released_lease_is_free_at_once(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 1000, T0)
    assert policy.lease.release(ANN, T0 + 1) is None
    assert policy.lease.acquire(BEN, 1000, T0 + 1) is None


def test_an_ended_lease_has_no_holder(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 1000, T0)
    policy.lease.end()
    assert policy.lease.holder(T0) is None
    assert policy.lease.lapsed(T0), "it was taken away, not given back"


def test_A5_the_end_of_a_dead_clients_lease_is_reported_once_and_moves_nothing(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    policy.record_force(5.0, T0)
    assert not policy.lease.lapsed(T0 + 200 * MS - 1)
    assert policy.lease.lapsed(T0 + 200 * MS)
    assert not policy.lease.lapsed(T0 + 201 * MS)
    assert policy.force_n == 5.0


def test_a_lease_that_was_given_back_has_not_lapsed(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    policy.lease.release(ANN, T0 + 100 * MS)
    assert not policy.lease.lapsed(T0 + 300 * MS)


def test_a_lease_without_a_holder_cannot_lapse(policy: GripPolicy) -> None:
    policy.lease.end()
    assert not policy.lease.lapsed(T0)


def test_C4_a_late_loop_does_not_revive_a_lease(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    policy.record_force(5.0, T0 + 250 * MS)  # whatever tells the policy the time
    assert code(policy.lease.renew(ANN, T0 + 100 * MS)) == "no_lease"
    assert policy.lease.acquire(BEN, 200, T0 + 100 * MS) is None
    assert policy.lease.holder(T0 + 449 * MS) == BEN, "and one that is given late lives from now"


@pytest.mark.parametrize("ttl_ms", [0, -1, 1001, 10**9])
def test_a_lease_out_of_range_is_refused_and_not_shortened(policy: GripPolicy, ttl_ms: int) -> None:
    refusal = policy.lease.acquire(ANN, ttl_ms, T0)
    assert code(refusal) == "out_of_range"
    assert refusal is not None
    assert refusal.field == "ttl_ms"
    assert policy.lease.holder(T0) is None


@given(
    steps=st.lists(
        st.tuples(
            st.sampled_from(("acquire", "renew", "release", "end", "wait")),
            st.sampled_from((ANN, BEN)),
            st.integers(1, 300),
        ),
        max_size=40,
    )
)
def test_two_clients_never_hold_the_lease_at_once(steps: list[tuple[str, bytes, int]]) -> None:
    policy = GripPolicy(GripLimits(3.0, 25.0, 2.0, 10.0, 2.0, 12.0), max_lease_ms=250)
    t_ns, held_by, until_ns, ttl_ns = T0, None, 0, 0
    for step, client, amount in steps:
        if t_ns >= until_ns:
            held_by = None
        if step == "wait":
            t_ns += amount * MS
            continue
        if step == "end":
            policy.lease.end()
            held_by = None
        elif step == "acquire":
            granted = amount <= 250 and held_by in (None, client)
            assert (policy.lease.acquire(client, amount, t_ns) is None) == granted
            if granted:
                held_by, ttl_ns = client, amount * MS
                until_ns = t_ns + ttl_ns
        else:
            done = (policy.lease.renew if step == "renew" else policy.lease.release)(client, t_ns) is None
            assert done == (held_by == client)
            if done:
                until_ns = t_ns + ttl_ns
                held_by = client if step == "renew" else None
        holders = [c for c in (ANN, BEN) if policy.lease.check(c, t_ns) is None]
        assert holders == ([held_by] if held_by is not None else [])
