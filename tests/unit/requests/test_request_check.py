"""A request that is late, foreign or malformed is refused before anyone asks what it wants."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.requests.request_check import check_request
from slipd.types.permit import RefusalError
from slipd_client.messages import ERROR_CODES
from slipd_client.messages.ops import OPS

T_NS = 81_000_000_000
GOOD = {"v": 1, "id": "a-1", "op": "grip.set", "boot": "b", "deadline_ns": T_NS + 1, "force_n": 5.0}


def refused(changes: dict[str, Any]) -> Any:
    try:
        check_request({name: value for name, value in (GOOD | changes).items() if value is not ...}, "b", T_NS)
    except RefusalError as error:
        return error.refusal
    return None


def judge(**changes: Any) -> tuple[str, str] | None:
    """Code and field of the refusal of GOOD with some fields changed, or left out (...)."""
    refusal = refused(changes)
    assert refusal is None or (refusal.code in ERROR_CODES and refusal.message)
    return refusal and (refusal.code, refusal.field)


@pytest.mark.parametrize(
    ("changes", "refusal"),
    [
        ({"v": ...}, ("unsupported_version", "v")),
        ({"v": 2}, ("unsupported_version", "v")),
        ({"v": True}, ("unsupported_version", "v")),
        ({"v": 1.0}, ("unsupported_version", "v")),
        ({"v": "1"}, ("unsupported_version", "v")),
        ({"id": ...}, ("missing_field", "id")),
        ({"id": None}, ("bad_type", "id")),
        ({"id": True}, ("bad_type", "id")),
        ({"id": 1.5}, ("bad_type", "id")),
        ({"id": {"a": 1}}, ("bad_type", "id")),
        ({"op": ...}, ("unknown_op", "op")),
        ({"op": "grip.crush"}, ("unknown_op", "op")),
        ({"op": ["grip.set"]}, ("unknown_op", "op")),
        ({"boot": ...}, ("missing_field", "boot")),
        ({"boot": "c"}, ("wrong_boot", "boot")),
        ({"boot": None}, ("wrong_boot", "boot")),
        ({"deadline_ns": ...}, ("missing_field", "deadline_ns")),
        ({"deadline_ns": float(T_NS + 1)}, ("bad_type", "deadline_ns")),
        ({"deadline_ns": True}, ("bad_type", "deadline_ns")),
        ({"deadline_ns": T_NS}, ("deadline_passed", "deadline_ns")),
        ({"deadline_ns": -1}, ("deadline_passed", "deadline_ns")),
        ({"deadline_ns": T_NS + 500_000_000}, None),
        ({"deadline_ns": T_NS + 500_000_001}, ("deadline_too_far", "deadline_ns")),
        ({"force_n": ...}, ("missing_field", "force_n")),
        ({"force_n": "5"}, ("bad_type", "force_n")),
        ({"force_n": True}, ("bad_type", "force_n")),
        ({"force_n": None}, ("bad_type", "force_n")),
        ({"force_n": [5.0]}, ("bad_type", "force_n")),
        ({"force_n": math.nan}, ("not_finite", "force_n")),
        ({"force_n": -math.inf}, ("not_finite", "force_n")),
        ({"delta_n": 1.0}, ("unknown_field", "delta_n")),
        ({"op": "lease.acquire", "force_n": ..., "ttl_ms": 100}, None),
        ({"op": "lease.acquire", "force_n": ..., "ttl_ms": 100.0}, ("bad_type", "ttl_ms")),
        ({"op": "lease.acquire", "force_n": ..., "ttl_ms": True}, ("bad_type", "ttl_ms")),
        ({"op": "gripper.open", "force_n": ..., "drop": 1}, ("bad_type", "drop")),
        ({"op": "gripper.open", "force_n": ..., "drop": True}, None),
        ({"op": "gripper.open"}, ("unknown_field", "force_n")),
        ({"op": "tare", "force_n": ..., "finger": 3}, ("bad_type", "finger")),
        ({"op": "tare", "force_n": ..., "finger": "left", "seconds": math.inf}, ("not_finite", "seconds")),
        ({"op": "gripper.close", "width_m": math.nan}, ("not_finite", "width_m")),
        ({"op": "lease.renew"}, ("unknown_field", "force_n")),
        ({}, None),
        ({"id": 7, "force_n": 5}, None),
        # who only asks needs no boot and no deadline; hello is answered whatever run it was meant for
        *(({"op": op, "boot": ..., "deadline_ns": ..., "force_n": ...}, None) for op in ("hello", "status")),
        ({"op": "hello", "boot": "another", "deadline_ns": 0, "force_n": ...}, None),
        ({"op": "status", "boot": "another", "force_n": ...}, ("wrong_boot", "boot")),
        ({"op": "status", "deadline_ns": 0, "force_n": ...}, ("deadline_passed", "deadline_ns")),
    ],
)
def test_A1_every_fault_has_its_code_and_names_its_field(
    changes: dict[str, Any], refusal: tuple[str, str] | None
) -> None:
    assert judge(**changes) == refusal


@pytest.mark.parametrize("op", sorted(set(OPS) - {"hello", "status", "motion.check"}))
def test_every_op_that_does_something_needs_boot_and_deadline(op: str) -> None:
    wrong = ({"boot": ...}, {"deadline_ns": ...}, {"boot": "old run"}, {"deadline_ns": T_NS - 1})
    assert [judge(op=op, **changes) for changes in wrong] == [
        ("missing_field", "boot"), ("missing_field", "deadline_ns"), ("wrong_boot", "boot"),
        ("deadline_passed", "deadline_ns"),
    ]  # fmt: skip


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=4,
)


@pytest.mark.uncovered
@given(st.dictionaries(st.sampled_from([*GOOD, "ttl_ms", "finger", "zz"]), PLAIN | st.sampled_from(sorted(OPS))))
def test_nothing_that_can_arrive_makes_it_fail(changes: dict[str, Any]) -> None:
    judge(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"op": "lease.acquire", "force_n": ..., "ttl_ms": "1"}, "ttl_ms must be an integer, got a string"),
        ({"op": "lease.acquire", "force_n": ..., "ttl_ms": 0.5}, "ttl_ms must be an integer, got a number"),
        ({"force_n": True}, "force_n must be a number, got a boolean"),
        ({"force_n": None}, "force_n must be a number, got nil"),
        ({"force_n": b"5"}, "force_n must be a number, got a byte string"),
        ({"op": "gripper.open", "force_n": ..., "drop": 1}, "drop must be true or false, got an integer"),
        ({"op": "tare", "force_n": ..., "finger": {}}, "finger must be a string, got a map"),
        ({"id": []}, "id must be a string or an integer, got a list"),
        ({"v": ...}, "the version of the API must be 1, but it is missing"),
        ({"v": 2}, "the version of the API must be 1, got 2"),
        ({"deadline_ns": "soon"}, "deadline_ns must be an integer, got a string"),
        ({"deadline_ns": T_NS - 250_000_000}, "deadline_ns must not have passed: it passed 250 ms ago"),
        ({"deadline_ns": T_NS + 800_000_000}, "deadline_ns must be at most 500 ms ahead, got 800 ms"),
        ({"op": "lease.renew"}, "'force_n' is an unknown field: lease.renew has no fields of its own"),
    ],
)
def test_a_refusal_says_what_would_be_right_and_what_was_found(changes: dict[str, Any], message: str) -> None:
    assert refused(changes).message == message


@pytest.mark.parametrize(
    "changes", [{"v": "\x01" * 1024}, {"op": "\x01" * 1024}, {"boot": "\x01" * 1024}, {"\x01" * 1024: 1}]
)
def test_what_a_client_sends_is_repeated_in_short(changes: dict[str, Any]) -> None:
    """A refusal that holds four characters for each one sent is longer than what a client reads."""
    assert len(refused(changes).message) < 600
