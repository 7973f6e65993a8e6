from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.errors import NoAnswer, RequestRefused
from slipd_client.messages import MessageError, encode
from slipd_client.requester import CLOCK_CHECK_NS, DEADLINE_NS, Requester

if TYPE_CHECKING:
    from conftest import Daemon

MAX_AHEAD_NS = 500_000_000
"""The furthest deadline that a daemon accepts."""


def refuse(code: str, message: str = "no", field: str | None = None) -> Callable[[Any], dict[str, Any]]:
    return lambda _: {"error": {"code": code, "message": message, "field": field}}


def test_hello_needs_neither_boot_nor_deadline(daemon: Daemon) -> None:
    with Requester(daemon.endpoint) as requester:
        assert requester.hello()["boot"] == "boot-1"
    assert set(daemon.requests[0]) == {"v", "id", "op", "arrived_ns"}


def test_the_first_request_greets_by_itself(daemon: Daemon) -> None:
    with Requester(daemon.endpoint) as requester:
        requester.status()
        requester.status()
    assert daemon.ops == ["hello", "status", "status"]


def test_every_request_names_version_run_and_an_id_of_its_own(daemon: Daemon) -> None:
    with Requester(daemon.endpoint) as first, Requester(daemon.endpoint) as second:
        for requester in (first, second, first):
            requester.status()
    asked = [request for request in daemon.requests if request["op"] == "status"]
    assert {(request["v"], request["boot"]) for request in asked} == {(1, "boot-1")}
    assert len({request["id"] for request in daemon.requests}) == len(daemon.requests)


@pytest.mark.parametrize("ahead_s", [0, 86_400, -86_400])
def test_deadlines_are_in_the_clock_of_the_daemon(start_daemon: Callable[..., Daemon], ahead_s: int) -> None:
    daemon = start_daemon(ahead_ns=ahead_s * 10**9)
    with Requester(daemon.endpoint) as requester:
        requester.status()
    asked = daemon.requests[-1]
    assert 0 < asked["deadline_ns"] - asked["arrived_ns"] < MAX_AHEAD_NS


def test_a_clock_that_drifts_is_read_again_and_the_run_is_kept(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    with Requester(daemon.endpoint) as requester:
        requester.status()
        daemon.ahead_ns = 2 * DEADLINE_NS
        daemon.boot = "boot-2"
        now_ns = time.monotonic_ns
        monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns() + CLOCK_CHECK_NS + 1)
        with pytest.raises(RequestRefused, match="wrong_boot"):
            requester.status()
        assert daemon.ops == ["hello", "status", "hello", "status"]
        assert daemon.requests[-1]["boot"] == "boot-1"


def test_a_refusal_carries_code_message_and_field(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = refuse("out_of_range", "at most 40 N", "force_n")
    with Requester(daemon.endpoint) as requester, pytest.raises(RequestRefused) as caught:
        requester.grip_set(99.0)
    refusal = caught.value
    assert (refusal.code, refusal.message, refusal.field) == ("out_of_range", "at most 40 N", "force_n")
    assert str(refusal) == "out_of_range: force_n: at most 40 N"


def test_a_refusal_without_a_field_is_told_without_one(daemon: Daemon) -> None:
    daemon.handlers["gripper.activate"] = refuse("no_lease", "acquire one", None)
    with Requester(daemon.endpoint) as requester, pytest.raises(RequestRefused, match=r"^no_lease: acquire one$"):
        requester.activate()


def test_a_number_that_is_none_never_leaves_the_client(daemon: Daemon) -> None:
    with Requester(daemon.endpoint) as requester:
        requester.hello()
        with pytest.raises(MessageError, match="not_finite: force_n"):
            requester.grip_set(float("nan"))
        requester.status()
    assert daemon.ops == ["hello", "status"]


def test_a_restart_refuses_one_request_and_the_next_greets_the_new_run(daemon: Daemon) -> None:
    with Requester(daemon.endpoint) as requester:
        requester.status()
        daemon.boot = "boot-2"
        with pytest.raises(RequestRefused, match="wrong_boot"):
            requester.grip_set(5.0)
        requester.status()
    assert daemon.requests[-1]["boot"] == "boot-2"
    assert daemon.ops.count("grip.set") == 1


def test_without_a_daemon_nothing_is_sent_and_that_is_said(requests: str) -> None:
    with Requester(requests, timeout_s=0.05) as requester, pytest.raises(NoAnswer, match="nothing was sent"):
        requester.status()


def test_a_request_is_not_kept_for_a_daemon_that_starts_later(
    start_daemon: Callable[..., Daemon], requests: str
) -> None:
    with Requester(requests, timeout_s=0.05) as requester:
        with pytest.raises(NoAnswer):
            requester.grip_set(12.0)
        daemon = start_daemon()
        requester.timeout_s = 10.0
        requester.status()
    assert daemon.ops == ["hello", "status"]


def test_a_silent_daemon_may_or_may_not_have_done_it(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = lambda _: None
    with Requester(daemon.endpoint) as requester:
        requester.hello()
        requester.timeout_s = 0.1
        with pytest.raises(NoAnswer, match="may or may not"):
            requester.grip_set(5.0)
    assert daemon.ops.count("grip.set") == 1


def test_a_late_reply_is_not_taken_for_the_next_one(daemon: Daemon) -> None:
    def late(request: dict[str, Any]) -> dict[str, Any]:
        time.sleep(0.3)
        return {"force_n": request["force_n"]}

    daemon.handlers["grip.set"] = late
    with Requester(daemon.endpoint) as requester:
        requester.hello()
        requester.timeout_s = 0.1
        with pytest.raises(NoAnswer):
            requester.grip_set(1.0)
        requester.timeout_s = 10.0
        assert requester.grip_set(2.0) == {"force_n": 2.0}


@pytest.mark.parametrize("data", [b"", b"\xc1", encode({"id": 5, "ok": True, "result": {}})])
def test_a_reply_that_is_none_is_not_believed(daemon: Daemon, data: bytes) -> None:
    daemon.handlers["status"] = lambda _: data
    with Requester(daemon.endpoint) as requester:
        requester.hello()
        requester.timeout_s = 0.1
        with pytest.raises(NoAnswer, match="may or may not"):
            requester.status()


@pytest.mark.parametrize(
    "reply",
    [{}, {"ok": True}, {"ok": True, "result": 5}, {"ok": False}, {"ok": 1, "result": {}}, {"ok": False, "error": []}],
)
def test_a_reply_with_neither_result_nor_error_is_no_success(daemon: Daemon, reply: dict[str, Any]) -> None:
    daemon.handlers["status"] = lambda request: encode({"v": 1, "id": request["id"], **reply})
    with Requester(daemon.endpoint) as requester, pytest.raises(RequestRefused, match="malformed"):
        requester.status()


def test_a_greeting_without_run_or_clock_is_no_answer(daemon: Daemon) -> None:
    daemon.handlers["hello"] = lambda _: {"boot": "b"}
    with Requester(daemon.endpoint) as requester, pytest.raises(NoAnswer, match="is this slipd"):
        requester.status()


def test_a_lease_is_given_back_at_the_end_of_the_block(daemon: Daemon) -> None:
    daemon.handlers["lease.acquire"] = lambda request: {"ttl_ms": request["ttl_ms"]}
    with Requester(daemon.endpoint) as requester, requester.lease(150) as granted:
        assert granted == {"ttl_ms": 150}
        requester.renew()
    assert daemon.ops == ["hello", "lease.acquire", "lease.renew", "lease.release"]


def test_a_lease_is_given_back_when_the_block_fails(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = refuse("no_limit")
    with Requester(daemon.endpoint) as requester, pytest.raises(RequestRefused, match="no_limit"), requester.lease():
        requester.grip_set(5.0)
    assert daemon.ops[-1] == "lease.release"


def test_a_lease_that_has_ended_by_itself_is_no_error_to_give_back(daemon: Daemon) -> None:
    daemon.handlers["lease.release"] = refuse("no_lease")
    with Requester(daemon.endpoint) as requester, requester.lease():
        pass
    assert daemon.ops[-1] == "lease.release"


def test_a_lease_that_is_refused_runs_no_block_and_releases_nothing(daemon: Daemon) -> None:
    daemon.handlers["lease.acquire"] = refuse("lease_held")
    with Requester(daemon.endpoint) as requester, pytest.raises(RequestRefused, match="lease_held"), requester.lease():
        pytest.fail("the block ran")
    assert "lease.release" not in daemon.ops


@pytest.mark.parametrize(
    ("call", "op", "fields"),
    [
        (lambda r: r.grip_set(5.0), "grip.set", {"force_n": 5.0}),
        (lambda r: r.activate(), "gripper.activate", {}),
        (lambda r: r.close(3.0), "gripper.close", {"force_n": 3.0}),
        (
            lambda r: r.close(3.0, width_m=0.02, speed_mps=0.05),
            "gripper.close",
            {"force_n": 3.0, "width_m": 0.02, "speed_mps": 0.05},
        ),
        (lambda r: r.open(), "gripper.open", {}),
        (
            lambda r: r.open(drop=True, width_m=0.08, speed_mps=0.1),
            "gripper.open",
            {"drop": True, "width_m": 0.08, "speed_mps": 0.1},
        ),
        (lambda r: r.stop(), "gripper.stop", {}),
        (lambda r: r.tare_get("left"), "tare.get", {"finger": "left"}),
        (lambda r: r.tare_undo("left"), "tare.undo", {"finger": "left"}),
        (lambda r: r.renew(), "lease.renew", {}),
        (lambda r: r.request("record.start", label="x"), "record.start", {"label": "x"}),
    ],
)
def test_each_call_sends_its_op_and_fields(
    daemon: Daemon, call: Callable[[Requester], object], op: str, fields: dict[str, Any]
) -> None:
    with Requester(daemon.endpoint) as requester:
        call(requester)
    asked = daemon.requests[-1]
    for common in ("v", "id", "boot", "deadline_ns", "arrived_ns"):
        del asked[common]
    assert asked == {"op": op, **fields}


def test_a_tare_is_waited_for_until_it_is_taken(daemon: Daemon) -> None:
    looks = iter([{"busy": True, "tare_id": 1}, {"busy": True, "tare_id": 1}, {"busy": False, "tare_id": 2}])
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    daemon.handlers["tare.get"] = lambda _: next(looks)
    with Requester(daemon.endpoint) as requester:
        assert requester.tare("left", 0.4) == {"busy": False, "tare_id": 2, "verified": True}
    assert daemon.ops == ["hello", "tare", *["tare.get"] * 3]
    assert daemon.requests[1]["seconds"] == 0.4


def test_a_tare_that_was_given_up_is_told(daemon: Daemon) -> None:
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    daemon.handlers["tare.get"] = lambda _: {"busy": False, "tare_id": 1}
    with Requester(daemon.endpoint) as requester, pytest.raises(RequestRefused, match="given up"):
        requester.tare("left", 0.1)


def test_a_tare_without_readings_is_told(daemon: Daemon) -> None:
    daemon.handlers["tare.get"] = lambda _: {"busy": True}
    with Requester(daemon.endpoint, timeout_s=0.3) as requester, pytest.raises(NoAnswer, match="too few readings"):
        requester.tare("left", 0.1)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tare_over_no_time_is_a_bad_call(requests: str, seconds: float) -> None:
    with Requester(requests) as requester, pytest.raises(ValueError, match="positive time"):
        requester.tare("left", seconds)


def test_an_endpoint_that_is_none_is_a_bad_call() -> None:
    with pytest.raises(ValueError, match="'tcp://robot'"):
        Requester("tcp://robot")
