"""Who holds the lease of the gripper, and for how long; its end moves nothing."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from judging import code
from nanoseconds import MS

from slipd.gripper.grip_policy import GripPolicy
from slipd.gripper.lease import Lease

T0 = 50_000_000_000
ANN, BEN = b"ann", b"ben"


def test_A4_A5_C4_a_lease_excludes_others_lapses_once_and_is_not_revived_by_a_late_loop(policy: GripPolicy) -> None:
    policy.lease.acquire(ANN, 200, T0)
    refusal = policy.lease.acquire(BEN, 200, T0 + 50 * MS)
    assert code(refusal) == "lease_held"
    assert "150 ms" in str(refusal)
    assert not policy.lease.lapsed(T0 + 200 * MS - 1)
    policy.record_force(5.0, T0 + 250 * MS)  # whatever tells the policy the time
    assert code(policy.lease.renew(ANN, T0 + 100 * MS)) == "no_lease"
    assert [policy.lease.lapsed(T0 + 200 * MS) for _ in range(2)] == [True, False]
    assert policy.force_n == 5.0, "its end moves nothing"
    assert policy.lease.acquire(BEN, 200, T0 + 100 * MS) is None
    assert policy.lease.holder(T0 + 449 * MS) == BEN, "one that is given late lives from now"


@given(
    steps=st.lists(
        st.tuples(
            st.sampled_from(("acquire", "renew", "release", "end", "wait")),
            st.sampled_from((ANN, BEN)),
            st.integers(-1, 300),
        ),
        max_size=40,
    )
)
@example(steps=[("acquire", ANN, 0), ("acquire", ANN, 1), ("wait", ANN, 1)])
@example(steps=[("acquire", ANN, 200), ("wait", ANN, 199), ("wait", ANN, 1)])
@example(steps=[("acquire", ANN, 200), ("wait", ANN, 150), ("renew", ANN, 0), ("wait", ANN, 199), ("wait", ANN, 1)])
@example(steps=[("acquire", ANN, 250), ("acquire", ANN, 100), ("wait", ANN, 100), ("acquire", BEN, 200)])
def test_a_lease_follows_its_rules_in_any_course(steps: list[tuple[str, bytes, int]]) -> None:
    """One holder at a time, out of range is refused, a renewal begins the same time anew, an end lapses once."""
    lease = Lease(250)
    t_ns, held_by, until_ns, ttl_ns, lapses = T0, None, 0, 0, False
    for step, client, amount in steps:
        if step == "wait":
            t_ns += max(amount, 0) * MS
        elif step == "end":
            lease.end()
            held_by, lapses = None, lapses or held_by is not None
        elif step == "acquire":
            granted = 0 < amount <= 250 and held_by in (None, client)
            wanted = None if granted else "lease_held" if 0 < amount <= 250 else "out_of_range"
            assert code(lease.acquire(client, amount, t_ns)) == wanted
            if granted:
                held_by, ttl_ns = client, amount * MS
                until_ns = t_ns + ttl_ns
        else:
            found = (lease.renew if step == "renew" else lease.release)(client, t_ns)
            assert code(found) == (None if held_by == client else "no_lease")
            if held_by == client:
                held_by, until_ns = client if step == "renew" else None, t_ns + ttl_ns
        if held_by is not None and t_ns >= until_ns:
            held_by, lapses = None, True
        assert (lease.deadline_ns <= t_ns) == lapses
        assert (lease.lapsed(t_ns), lease.lapsed(t_ns)) == (lapses, False)
        lapses = False
        assert lease.holder(t_ns) == held_by
        left_s = None if held_by is None else pytest.approx((until_ns - t_ns) * 1e-9)
        assert lease.expires_in_s(t_ns) == left_s
        assert [who for who in (ANN, BEN) if lease.check(who, t_ns) is None] == [who for who in (held_by,) if who]
