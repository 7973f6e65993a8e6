"""No request is carried out twice, whether its own client or another one sends it again."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from nanoseconds import MS

from slipd.requests.handlers import MOST_CLIENTS, PER_CLIENT, IdempotencyCache
from slipd.types.permit import RefusalError

T0 = 50_000_000_000
ANN, BEN = b"ann", b"ben"
REPLY = {"ok": True, "result": {"applied_n": 5.0}}


def body(name: str | int = 1, ahead_ms: int = 100, **fields: Any) -> dict[str, Any]:
    return {"v": 1, "id": name, "op": "grip.set", "deadline_ns": T0 + ahead_ms * MS, "force_n": 5.0} | fields


def seen(once: IdempotencyCache, *arguments: Any, **options: Any) -> Any:
    """The reply that is kept, or code and field of the refusal."""
    try:
        return once.seen(*arguments, **options)
    except RefusalError as error:
        return error.refusal.code, error.refusal.field


CONTENTS: list[dict[str, Any]] = [
    {},
    {"force_n": 5},
    {"force_n": True},
    {"op": "gripper.close"},
    {"more": [1, {"a": None}]},
]


@given(
    st.lists(
        st.tuples(
            st.sampled_from((ANN, BEN)),
            st.sampled_from((1, "1", 2)),
            st.sampled_from(range(len(CONTENTS))),
            st.sampled_from((40, 100, 130)),
            st.sampled_from((0, 0, 1, 39, 40, 99, -50)),
        ),
        max_size=25,
    )
)
@example([(ANN, 1, 0, 100, 0), (ANN, 1, 0, 100, 99), (BEN, 1, 0, 100, 0), (ANN, 1, 0, 100, 1), (ANN, 1, 0, 100, -50)])
@example([(ANN, 1, 0, 40, 0), (ANN, 1, 0, 100, 40), (ANN, 1, 1, 100, 0), (ANN, "1", 0, 100, 0), (BEN, 1, 1, 100, 0)])
def test_A1_A2_a_request_is_carried_out_at_most_once_in_any_course(
    sent: list[tuple[bytes, str | int, int, int, int]],
) -> None:
    """A repeated one gets its reply, a changed or copied one is refused, a late one stays late; time may go back."""
    once, now_ns, t_ns = IdempotencyCache(), 0, T0
    kept: dict[tuple[bytes, str | int], tuple[dict[str, Any], dict[str, Any], str]] = {}
    for number, (client, name, content, ahead_ms, later_ms) in enumerate(sent):
        t_ns += later_ms * MS
        now_ns = max(now_ns, t_ns)
        asked = body(name, ahead_ms, **CONTENTS[content])
        kept = {key: one for key, one in kept.items() if one[0]["deadline_ns"] > now_ns}
        mine, packed = kept.get((client, name)), repr(asked)
        expected: Any = None
        if asked["deadline_ns"] <= now_ns:
            expected = "deadline_passed", "deadline_ns"
        elif mine is not None:
            expected = mine[1] if mine[2] == packed else ("repeated_id", "id")
        elif packed in [one[2] for one in kept.values()]:
            expected = "replayed", ""
        assert seen(once, client, dict(reversed(asked.items())), t_ns) == expected
        if expected is None:
            reply = {"number": number}
            once.keep(client, asked, reply)
            kept[client, name] = asked, reply, packed


@pytest.mark.parametrize("op", ["hello", "status"])
def test_requests_that_change_nothing_are_answered_anew(op: str) -> None:
    once, asked = IdempotencyCache(), {"v": 1, "id": 1, "op": op}
    once.keep(ANN, asked, REPLY)
    assert seen(once, ANN, asked, T0) is seen(once, ANN, body(), T0) is None


def test_only_who_floods_is_refused_and_a_full_cache_drops_nothing() -> None:
    once = IdempotencyCache()
    for k in range(PER_CLIENT):
        assert seen(once, ANN, body(k, 100 + k % 2), T0) is None
        once.keep(ANN, body(k, 100 + k % 2), REPLY)
    assert seen(once, ANN, body("more"), T0) == ("busy", "")
    assert seen(once, ANN, body(0), T0) == REPLY
    assert seen(once, BEN, body("more"), T0) is None
    assert seen(once, ANN, body("more", 200), T0 + 100 * MS) is None
    assert sum(seen(once, ANN, body(k, 101), T0 + 100 * MS) == REPLY for k in range(PER_CLIENT)) == PER_CLIENT // 2


def full() -> IdempotencyCache:
    """A cache that has heard of as many clients as it may."""
    once = IdempotencyCache()
    for k in range(MOST_CLIENTS):
        once.keep(b"%d" % k, body(k), REPLY)
    return once


def test_beyond_the_largest_number_of_clients_only_new_ones_are_refused_but_not_what_is_urgent() -> None:
    once, renewal = full(), body("renewal", op="lease.renew")
    assert seen(once, ANN, renewal, T0) == ("busy", "")
    assert seen(once, b"0", body(-1), T0) is None
    assert seen(once, ANN, body(-1, 200), T0 + 100 * MS) is None
    once = full()
    assert seen(once, ANN, renewal, T0, urgent=True) is None
    once.keep(ANN, renewal, REPLY)
    assert seen(once, ANN, renewal, T0, urgent=True) == REPLY
    assert seen(once, BEN, renewal, T0, urgent=True) == ("replayed", "")
    for k in range(PER_CLIENT):
        once.keep(ANN, body(f"{k}"), REPLY)
    assert seen(once, ANN, body("stop", op="gripper.stop"), T0, urgent=True) is None
