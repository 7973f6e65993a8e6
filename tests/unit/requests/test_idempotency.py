"""No request is carried out twice, whether its own client or another one sends it again."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.requests.idempotency import MOST_CLIENTS, PER_CLIENT, IdempotencyCache
from slipd.types.refusal import Refusal, RefusalError

MS = 1_000_000
T0 = 50_000_000_000
ANN, BEN = b"ann", b"ben"
REPLY = {"ok": True, "result": {"applied_n": 5.0}}


@pytest.fixture
def once() -> IdempotencyCache:
    return IdempotencyCache()


def body(name: str | int = 1, ahead_ms: int = 100, **fields: Any) -> dict[str, Any]:
    return {"v": 1, "id": name, "op": "grip.set", "deadline_ns": T0 + ahead_ms * MS, "force_n": 5.0} | fields


def seen(once: IdempotencyCache, *arguments: Any, **options: Any) -> Any:
    """The reply that is kept, or why the request is refused."""
    try:
        return once.seen(*arguments, **options)
    except RefusalError as error:
        return error.refusal


def code(found: object) -> str | None:
    return found.code if isinstance(found, Refusal) else None


def test_A2_a_repeated_request_gets_the_reply_of_the_first(once: IdempotencyCache) -> None:
    assert seen(once, ANN, body(), T0) is None
    once.keep(ANN, body(), REPLY, T0)
    for ms in (0, 50, 99):
        assert seen(once, ANN, dict(reversed(body().items())), T0 + ms * MS) == REPLY


def test_A2_a_refused_request_is_not_carried_out_later(once: IdempotencyCache) -> None:
    refused = {"ok": False, "error": {"code": "no_lease"}}
    once.keep(ANN, body(), refused, T0)
    assert seen(once, ANN, body(), T0) == refused


def test_A1_A2_a_request_past_its_deadline_stays_refused_even_when_time_goes_back(once: IdempotencyCache) -> None:
    once.keep(ANN, body(), REPLY, T0)
    assert code(seen(once, ANN, body(), T0 + 100 * MS)) == "deadline_passed"
    assert code(seen(once, ANN, body(), T0)) == "deadline_passed"
    assert code(seen(once, BEN, body(), T0)) == "deadline_passed"


def test_an_id_may_be_used_again_after_the_deadline_of_its_request(once: IdempotencyCache) -> None:
    once.keep(ANN, body(), REPLY, T0)
    assert seen(once, ANN, body(ahead_ms=300), T0 + 100 * MS) is None


@pytest.mark.parametrize("change", [{"force_n": 6.0}, {"force_n": 5}, {"op": "gripper.close"}, {"more": [1, {"a": 2}]}])
def test_A2_an_id_is_used_for_one_request_only(once: IdempotencyCache, change: dict[str, Any]) -> None:
    once.keep(ANN, body(), REPLY, T0)
    found = seen(once, ANN, body(**change), T0)
    assert isinstance(found, Refusal)
    assert (found.code, found.field) == ("repeated_id", "id")


def test_two_clients_may_use_the_same_id(once: IdempotencyCache) -> None:
    once.keep(ANN, body(), REPLY, T0)
    assert seen(once, BEN, body(force_n=6.0), T0) is None


def test_a_string_and_an_integer_are_two_ids(once: IdempotencyCache) -> None:
    once.keep(ANN, body(1), REPLY, T0)
    assert seen(once, ANN, body("1"), T0) is None


def test_A2_a_copy_by_another_client_is_refused_and_its_sender_is_still_answered(once: IdempotencyCache) -> None:
    once.keep(ANN, body(more=[True, None]), REPLY, T0)
    assert code(seen(once, BEN, body(more=[True, None]), T0)) == "replayed"
    assert seen(once, BEN, body(more=[1, None]), T0) is None
    assert seen(once, ANN, body(more=[True, None]), T0) == REPLY


@pytest.mark.parametrize("op", ["hello", "status"])
def test_requests_that_change_nothing_are_answered_anew(once: IdempotencyCache, op: str) -> None:
    asked = {"v": 1, "id": 1, "op": op}
    once.keep(ANN, asked, REPLY, T0)
    assert seen(once, ANN, asked, T0) is None
    assert seen(once, ANN, body(), T0) is None


def test_only_a_client_that_floods_is_refused(once: IdempotencyCache) -> None:
    for k in range(PER_CLIENT):
        assert seen(once, ANN, body(k), T0) is None
        once.keep(ANN, body(k), REPLY, T0)
    assert code(seen(once, ANN, body(PER_CLIENT), T0)) == "busy"
    assert seen(once, ANN, body(0), T0) == REPLY, "a full cache refuses and drops nothing"
    assert seen(once, BEN, body(PER_CLIENT), T0) is None
    assert seen(once, ANN, body(PER_CLIENT, ahead_ms=200), T0 + 100 * MS) is None


def test_beyond_the_largest_number_of_clients_only_new_ones_are_refused(once: IdempotencyCache) -> None:
    for k in range(MOST_CLIENTS):
        once.keep(b"%d" % k, body(k), REPLY, T0)
    assert code(seen(once, ANN, body(-1), T0)) == "busy"
    assert seen(once, b"0", body(-1), T0) is None
    assert seen(once, ANN, body(-1, ahead_ms=200), T0 + 100 * MS) is None


def test_requests_are_dropped_after_their_deadlines_in_any_order(once: IdempotencyCache) -> None:
    for k in range(PER_CLIENT):
        once.keep(ANN, body(k, ahead_ms=100 + 7 * k % 64), REPLY, T0)
    left = sum(seen(once, ANN, body(k, ahead_ms=100 + 7 * k % 64), T0 + 131 * MS) == REPLY for k in range(PER_CLIENT))
    assert left == 32
    assert seen(once, ANN, body("new", ahead_ms=400), T0 + 131 * MS) is None


def test_seventy_clients_within_their_rate_are_all_served(once: IdempotencyCache) -> None:
    for k in range(70):
        for request in range(2):
            once.keep(b"%d" % k, body(f"{k}.{request}", ahead_ms=500), REPLY, T0)
    assert seen(once, ANN, body(-1), T0) is None


def test_urgent_requests_pass_beyond_both_limits(once: IdempotencyCache) -> None:
    for k in range(MOST_CLIENTS):
        once.keep(b"%d" % k, body(f"{k}"), REPLY, T0)
    renewal = body("renewal", op="lease.renew")
    assert code(seen(once, ANN, renewal, T0)) == "busy"
    assert seen(once, ANN, renewal, T0, urgent=True) is None
    once.keep(ANN, renewal, REPLY, T0)
    assert seen(once, ANN, renewal, T0, urgent=True) == REPLY
    for k in range(PER_CLIENT):
        once.keep(ANN, body(k), REPLY, T0)
    assert seen(once, ANN, body("stop", op="gripper.stop"), T0, urgent=True) is None
    assert code(seen(once, BEN, renewal, T0, urgent=True)) == "replayed"
