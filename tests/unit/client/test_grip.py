"""Requests of a client and what the daemon hears of them: greeting, deadlines, refusals, silence, keys."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
import zmq

from slipd_client.errors import NoAnswer, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.messages import MessageError, encode

if TYPE_CHECKING:
    from conftest import Daemon

PATIENCE_S = 60.0

MAX_AHEAD_NS = 500_000_000
"""The furthest deadline that a daemon accepts."""


def refuse(code: str, message: str = "no", field: str | None = None) -> Callable[[Any], dict[str, Any]]:
    return lambda _: {"error": {"code": code, "message": message, "field": field}}


def test_hello_needs_neither_boot_nor_deadline(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        assert client.hello()["boot"] == "boot-1"
    assert set(daemon.requests[0]) == {"v", "id", "op", "arrived_ns"}


def test_the_first_request_greets_by_itself(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        client.status()
        client.status()
    assert daemon.ops[0] == "hello"
    assert daemon.asked_ops == ["status", "status"]


def test_every_request_names_version_run_and_an_id_of_its_own(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as first, GripClient(daemon.endpoint) as second:
        for client in (first, second, first):
            client.status()
    asked = [request for request in daemon.requests if request["op"] == "status"]
    assert {(request["v"], request["boot"]) for request in asked} == {(1, "boot-1")}
    assert len({request["id"] for request in daemon.requests}) == len(daemon.requests)


@pytest.mark.parametrize("ahead_s", [0, 86_400, -86_400])
def test_deadlines_are_in_the_clock_of_the_daemon(start_daemon: Callable[..., Daemon], ahead_s: int) -> None:
    daemon = start_daemon(ahead_ns=ahead_s * 10**9)
    begin_ns = daemon.now_ns()
    with GripClient(daemon.endpoint) as client:
        client.status()
    asked = daemon.requests[-1]
    assert begin_ns < asked["deadline_ns"] < asked["arrived_ns"] + MAX_AHEAD_NS


def test_a_clock_that_is_known_no_more_is_read_again_and_the_run_is_kept(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    with GripClient(daemon.endpoint) as client:
        client.status()
        monkeypatch.setattr(client.clock, "error_ns", lambda _: MAX_AHEAD_NS)
        daemon.boot = "boot-2"
        with pytest.raises(RequestRefused, match="wrong_boot"):
            client.status()
    assert set(daemon.ops[1 + daemon.ops.index("status") : -1]) == {"hello"}
    assert daemon.requests[-1]["boot"] == "boot-1"


def test_a_refusal_carries_code_message_and_field(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = refuse("out_of_range", "at most 40 N", "force_n")
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused) as caught:
        client.grip_set(99.0)
    refusal = caught.value
    assert (refusal.code, refusal.message, refusal.field) == ("out_of_range", "at most 40 N", "force_n")
    assert str(refusal) == "out_of_range: force_n: at most 40 N"


def test_a_refusal_without_a_field_is_told_without_one(daemon: Daemon) -> None:
    daemon.handlers["gripper.activate"] = refuse("no_lease", "acquire one", None)
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match=r"no_lease: acquire one$"):
        client.gripper_activate()


def test_a_number_that_is_none_never_leaves_the_client(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        client.hello()
        with pytest.raises(MessageError, match="not_finite: force_n"):
            client.grip_set(float("nan"))
        client.status()
    assert daemon.asked_ops == ["status"]


def test_a_restart_refuses_one_request_and_the_next_greets_the_new_run(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        client.status()
        daemon.boot = "boot-2"
        with pytest.raises(RequestRefused, match="wrong_boot"):
            client.grip_set(5.0)
        client.status()
    assert daemon.requests[-1]["boot"] == "boot-2"
    assert daemon.ops.count("grip.set") == 1


def test_without_a_daemon_nothing_is_sent_and_that_is_said(requests: str) -> None:
    with GripClient(requests, timeout_s=0.05) as client, pytest.raises(NoAnswer, match="nothing was sent"):
        client.status()


def test_a_request_is_not_kept_for_a_daemon_that_starts_later(
    start_daemon: Callable[..., Daemon], requests: str
) -> None:
    with GripClient(requests, timeout_s=0.05) as client:
        with pytest.raises(NoAnswer):
            client.grip_set(12.0)
        daemon = start_daemon()
        client.timeout_s = 10.0
        client.status()
    assert daemon.asked_ops == ["status"]


def test_a_silent_daemon_may_or_may_not_have_done_it(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = lambda _: None
    with GripClient(daemon.endpoint) as client:
        client.hello()
        client.timeout_s = 0.1
        with pytest.raises(NoAnswer, match="may or may not"):
            client.grip_set(5.0)
    assert daemon.ops.count("grip.set") == 1


def test_a_late_reply_is_not_taken_for_the_next_one(daemon: Daemon) -> None:
    given_up = threading.Event()

    def late(request: dict[str, Any]) -> dict[str, Any]:
        given_up.wait(PATIENCE_S)
        return {"force_n": request["force_n"]}

    daemon.handlers["grip.set"] = late
    with GripClient(daemon.endpoint) as client:
        client.hello()
        client.timeout_s = 0.1
        with pytest.raises(NoAnswer):
            client.grip_set(1.0)
        given_up.set()
        client.timeout_s = PATIENCE_S
        assert client.grip_set(2.0) == {"force_n": 2.0}


@pytest.mark.parametrize("data", [b"", b"\xc1", encode({"id": 5, "ok": True, "result": {}})])
def test_a_reply_that_is_none_is_not_believed(daemon: Daemon, data: bytes) -> None:
    daemon.handlers["status"] = lambda _: data
    with GripClient(daemon.endpoint) as client:
        client.hello()
        client.timeout_s = 0.1
        with pytest.raises(NoAnswer, match="may or may not"):
            client.status()


@pytest.mark.parametrize(
    "reply",
    [{}, {"ok": True}, {"ok": True, "result": 5}, {"ok": False}, {"ok": 1, "result": {}}, {"ok": False, "error": []}],
)
def test_a_reply_with_neither_result_nor_error_is_no_success(daemon: Daemon, reply: dict[str, Any]) -> None:
    daemon.handlers["status"] = lambda request: encode({"v": 1, "id": request["id"], **reply})
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match="malformed"):
        client.status()


def test_a_greeting_without_run_or_clock_is_no_answer(daemon: Daemon) -> None:
    daemon.handlers["hello"] = lambda _: {"boot": "b"}
    with GripClient(daemon.endpoint) as client, pytest.raises(NoAnswer, match="is this slipd"):
        client.status()


def test_threads_share_a_client_and_each_gets_its_own_replies(daemon: Daemon) -> None:
    daemon.handlers["echo"] = lambda request: {"told": request["told"]}
    heard: list[tuple[int, int]] = []
    with GripClient(daemon.endpoint, timeout_s=PATIENCE_S) as client:

        def ask(number: int) -> None:
            heard.extend((told, client.request("echo", told=told)["told"]) for told in range(number, 400, 4))

        threads = [threading.Thread(target=ask, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(heard) == 400
    assert all(told == echoed for told, echoed in heard)


@pytest.mark.parametrize(
    ("call", "op", "fields"),
    [
        (lambda c: c.status(), "status", {}),
        (lambda c: c.grip_set(5.0), "grip.set", {"force_n": 5.0}),
        (lambda c: c.grip_adjust(-0.5), "grip.adjust", {"delta_n": -0.5}),
        (lambda c: c.grip_hold(), "grip.hold", {}),
        (lambda c: c.gripper_activate(), "gripper.activate", {}),
        (lambda c: c.gripper_activate(drop=True), "gripper.activate", {"drop": True}),
        (lambda c: c.gripper_close(3.0), "gripper.close", {"force_n": 3.0}),
        (
            lambda c: c.gripper_close(3.0, width_m=0.02, speed_mps=0.05),
            "gripper.close",
            {"force_n": 3.0, "width_m": 0.02, "speed_mps": 0.05},
        ),
        (lambda c: c.gripper_open(), "gripper.open", {}),
        (
            lambda c: c.gripper_open(drop=True, width_m=0.08, speed_mps=0.1),
            "gripper.open",
            {"drop": True, "width_m": 0.08, "speed_mps": 0.1},
        ),
        (lambda c: c.gripper_stop(), "gripper.stop", {}),
        (lambda c: c.fault_ack(), "fault.ack", {}),
        (lambda c: c.tare_get("left"), "tare.get", {"finger": "left"}),
        (lambda c: c.tare_undo("left"), "tare.undo", {"finger": "left"}),
        (lambda c: c.tare_get("left", "pad"), "tare.get", {"finger": "left", "stream": "pad"}),
        (lambda c: c.tare_undo("left", "pad"), "tare.undo", {"finger": "left", "stream": "pad"}),
        (
            lambda c: c.gravity_set("left", (0.0, 0.0, -9.81)),
            "gravity.set",
            {"finger": "left", "gravity_mps2": [0.0, 0.0, -9.81]},
        ),
        (lambda c: c.object_set("mug"), "object.set", {"name": "mug"}),
        (lambda c: c.object_set(None), "object.set", {"name": None}),
        (lambda c: c.friction_set("left", 0.5), "friction.set", {"finger": "left", "mu_s": 0.5}),
        (lambda c: c.friction_set("left", 0.5, 0.4), "friction.set", {"finger": "left", "mu_s": 0.5, "mu_d": 0.4}),
        (lambda c: c.record_start(), "record.start", {}),
        (lambda c: c.record_stop(), "record.stop", {}),
        (lambda c: c.request("later.op", label="x", other=None), "later.op", {"label": "x"}),
    ],
)
def test_each_call_sends_its_op_and_fields(
    daemon: Daemon, call: Callable[[GripClient], object], op: str, fields: dict[str, Any]
) -> None:
    with GripClient(daemon.endpoint) as client:
        call(client)
    asked = daemon.requests[-1]
    for common in ("v", "id", "boot", "deadline_ns", "arrived_ns"):
        del asked[common]
    assert asked == {"op": op, **fields}


def test_a_client_with_keys_is_answered_by_the_daemon_that_it_trusts_and_by_no_other(
    start_daemon: Callable[..., Daemon],
) -> None:
    (server, secret), own, other = (zmq.curve_keypair() for _ in range(3))
    daemon = start_daemon(secret=secret)
    with GripClient(daemon.endpoint, keys=Keys(*own, server), timeout_s=PATIENCE_S) as client:
        assert client.hello()["boot"] == "boot-1"
    with (
        GripClient(daemon.endpoint, keys=Keys(*own, other[0]), timeout_s=0.3) as client,
        pytest.raises(NoAnswer, match="nothing was sent"),
    ):
        client.hello()


def test_across_a_network_silence_may_be_for_want_of_a_key() -> None:
    with GripClient("tcp://127.0.0.1:9", timeout_s=0.01) as client, pytest.raises(NoAnswer, match="keys right"):
        client.status()


def test_a_request_that_waits_too_long_for_its_turn_is_not_sent(daemon: Daemon) -> None:
    with (
        GripClient(daemon.endpoint, timeout_s=0.01) as client,
        client._turn,
        pytest.raises(NoAnswer, match="another thread"),
    ):
        client.status()
    assert daemon.ops == []


def test_an_endpoint_that_is_none_is_a_bad_call() -> None:
    with pytest.raises(ValueError, match="'tcp://robot'"):
        GripClient("tcp://robot")
