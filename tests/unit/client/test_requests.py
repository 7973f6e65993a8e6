"""Requests of both clients: greeting, deadlines, refusals, silence, tares, keys; replies and errors of a caller."""

from __future__ import annotations

import asyncio
import dataclasses
import json
import threading
import time
import typing
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
import zmq
from client_peers import PATIENCE_S, Daemon, refuse

from slipd_client import client_base
from slipd_client.aio import AsyncGripClient
from slipd_client.errors import (
    ConnectionClosed,
    NoAnswer,
    RequestRefused,
    TareGivenUp,
)
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.link import Steps
from slipd_client.messages import Health, MessageError, encode
from slipd_client.messages.ops import OPS
from slipd_client.messages.replies import TareResult
from slipd_client.subscriber import Subscriber

MAX_AHEAD_NS = 500_000_000
"""The furthest deadline that a daemon accepts."""

MAX_ERROR_NS = 125_000_000
"""The largest error of the daemon's clock with which a client still sends a request."""

ENVELOPE = ("v", "id", "boot", "deadline_ns", "arrived_ns")


class Awaited:
    """The asyncio client as if it blocked."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.client = AsyncGripClient(*arguments, **options)
        self._runner = asyncio.Runner()

    def __enter__(self) -> Awaited:
        self._runner.run(self.client.__aenter__())
        return self

    def __exit__(self, *failure: Any) -> None:
        self._runner.run(self.client.__aexit__(*failure))
        self._runner.close()

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.client, name)
        return (lambda *args, **fields: self._runner.run(found(*args, **fields))) if callable(found) else found


def wait_at_most(client: Any, timeout_s: float) -> None:
    getattr(client, "client", client).timeout_s = timeout_s


@pytest.fixture(params=[GripClient, Awaited], ids=["blocking", "asyncio"])
def kind(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.fixture
def client(kind: Any, daemon: Daemon) -> Iterator[Any]:
    """A client of this daemon; by its name it greets with the first request."""
    with kind(daemon.endpoint, timeout_s=PATIENCE_S) as made:
        yield made


def test_the_first_request_greets_and_each_names_version_run_and_an_id_of_its_own(
    daemon: Daemon, client: Any, kind: Any
) -> None:
    client.status()
    with kind(daemon.endpoint) as other:
        other.status()
    assert set(daemon.requests[0]) == {"v", "id", "op", "arrived_ns"}, "hello has neither boot nor deadline"
    assert [(request["op"], request["v"], request["boot"]) for request in daemon.asked] == [("status", 1, "boot-1")] * 2
    assert len({request["id"] for request in daemon.requests}) == len(daemon.requests)


@pytest.mark.parametrize("ahead_s", [0, 86_400, -86_400])
def test_deadlines_are_in_the_clock_of_the_daemon(start_daemon: Callable[..., Daemon], ahead_s: int) -> None:
    daemon = start_daemon(ahead_ns=ahead_s * 10**9)
    begin_ns = daemon.now_ns()
    with GripClient(daemon.endpoint) as client:
        client.status()
    asked = daemon.requests[-1]
    assert begin_ns < asked["deadline_ns"] < asked["arrived_ns"] + MAX_AHEAD_NS


def test_a_restart_refuses_one_request_and_the_next_greets_the_new_run(daemon: Daemon, client: Any) -> None:
    client.status()
    daemon.boot = "boot-2"
    with pytest.raises(RequestRefused, match="wrong_boot"):
        client.grip_set(5.0)
    client.status()
    assert daemon.requests[-1]["boot"] == "boot-2"
    assert daemon.ops.count("grip.set") == 1


def test_a_clock_that_is_known_no_more_is_read_again_and_the_run_is_kept(
    daemon: Daemon, client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.status()
    greetings = daemon.ops.count("hello")
    monkeypatch.setattr(client.clock, "error_ns", lambda _: MAX_ERROR_NS)
    client.status()
    monkeypatch.setattr(client.clock, "error_ns", lambda _: MAX_ERROR_NS + 1)
    daemon.boot = "boot-2"
    with pytest.raises(RequestRefused, match="wrong_boot"):
        client.status()
    assert daemon.ops[greetings:] == ["status", "status", *["hello"] * 4, "status"]
    assert daemon.requests[-1]["boot"] == "boot-1"


def test_a_refusal_carries_code_message_and_field_where_there_is_one(daemon: Daemon, client: Any) -> None:
    daemon.handlers["grip.set"] = refuse("out_of_range", "at most 40 N", "force_n")
    with pytest.raises(RequestRefused, match=r"^out_of_range: force_n: at most 40 N$") as caught:
        client.grip_set(99.0)
    assert (caught.value.code, caught.value.message, caught.value.field) == ("out_of_range", "at most 40 N", "force_n")


def test_a_number_that_is_none_never_leaves_the_client(daemon: Daemon, client: Any) -> None:
    client.hello()
    with pytest.raises(MessageError, match="not_finite: force_n"):
        client.grip_set(float("nan"))
    client.status()
    assert daemon.asked_ops == ["status"]


def test_a_request_is_neither_sent_without_a_daemon_nor_kept_for_a_later_one(
    start_daemon: Callable[..., Daemon], requests: str, kind: Any
) -> None:
    with kind(requests, timeout_s=0.05) as client:
        with pytest.raises(NoAnswer, match="nothing was sent"):
            client.grip_set(12.0)
        daemon = start_daemon()
        wait_at_most(client, PATIENCE_S)
        client.status()
    assert daemon.asked_ops == ["status"]


def test_a_silent_daemon_may_or_may_not_have_done_it_and_its_late_reply_is_not_taken_for_the_next(
    daemon: Daemon, client: Any
) -> None:
    given_up = threading.Event()

    def late(request: dict[str, Any]) -> dict[str, Any]:
        given_up.wait(PATIENCE_S)
        return {"force_n": request["force_n"]}

    daemon.handlers["grip.set"] = late
    client.hello()
    wait_at_most(client, 0.1)
    with pytest.raises(NoAnswer, match="may or may not"):
        client.grip_set(1.0)
    given_up.set()
    wait_at_most(client, PATIENCE_S)
    assert client.grip_set(2.0) == {"force_n": 2.0}
    assert daemon.ops.count("grip.set") == 2


@pytest.mark.parametrize(
    ("op", "call", "reply", "error", "why"),
    [
        *(
            ("status", GripClient.status, lambda _, data=data: data, NoAnswer, "may or may not")
            for data in (b"", b"\xc1", encode({"id": 5, "ok": True, "result": {}}))
        ),
        *(
            (
                "status",
                GripClient.status,
                lambda request, body=body: encode({"v": 1, "id": request["id"], **body}),
                RequestRefused,
                "malformed",
            )
            for body in (
                {},
                {"ok": True},
                {"ok": True, "result": 5},
                {"ok": False},
                {"ok": 1, "result": {}},
                {"ok": False, "error": []},
            )
        ),
        *(
            (
                "grip.set",
                lambda client: client.grip_set(5.0),
                lambda _, applied_n=applied_n: {"applied_n": applied_n},
                NoAnswer,
                r"carried out grip\.set.*applied_n must be",
            )
            for applied_n in ("5", True, [5.0])
        ),
        ("hello", GripClient.hello, lambda _: {"boot": "b"}, NoAnswer, "is this slipd"),
    ],
)
def test_a_reply_that_cannot_be_read_or_is_of_another_kind_is_no_success(
    daemon: Daemon,
    op: str,
    call: Callable[[GripClient], object],
    reply: Callable[[Any], Any],
    error: type[Exception],
    why: str,
) -> None:
    with GripClient(daemon.endpoint) as client:
        client.hello()
        client.timeout_s = 0.1 if why == "may or may not" else PATIENCE_S
        daemon.handlers[op] = reply
        with pytest.raises(error, match=why):
            call(client)


def test_threads_share_a_client_and_each_gets_its_own_replies(daemon: Daemon) -> None:
    daemon.handlers["echo"] = lambda request: {"told": request["told"]}
    with GripClient(daemon.endpoint) as client, ThreadPoolExecutor(4) as threads:
        heard = list(threads.map(lambda told: client.request("echo", told=told)["told"], range(400)))
    assert heard == list(range(400))


async def test_the_reply_to_a_cancelled_request_is_not_taken_for_the_next(daemon: Daemon) -> None:
    daemon.handlers["echo"] = lambda request: {"told": request["told"]}
    async with AsyncGripClient(daemon.endpoint) as client:
        await client.hello()
        for told in range(20):
            asking = asyncio.create_task(client.request("echo", told=-1))
            await asyncio.sleep(0)
            asking.cancel()
            assert await client.request("echo", told=told) == {"told": told}


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
    daemon: Daemon, client: Any, call: Callable[[Any], object], op: str, fields: dict[str, Any]
) -> None:
    call(client)
    assert {name: value for name, value in daemon.requests[-1].items() if name not in ENVELOPE} == {"op": op, **fields}


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


def test_a_tare_is_waited_for_until_it_is_taken_of_each_stream_that_was_named(daemon: Daemon, client: Any) -> None:
    looks = iter([{"busy": True, "tare_id": 1}, {"busy": True, "tare_id": 1}, {"busy": False, "tare_id": 2}])
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    daemon.handlers["tare.get"] = lambda _: next(looks)
    assert client.tare("left", 0.4) == {"busy": False, "tare_id": 2, "verified": True}
    assert [(request["op"], request.get("seconds")) for request in daemon.asked] == [
        ("tare", 0.4),
        *[("tare.get", None)] * 3,
    ]
    daemon.handlers["tare"] = lambda _: {"verified": False, "tare_id": 3, "tare_ids": {"wrench": 3, "pad": 1}}
    streams = {name: {"busy": False, "tare_id": number, "stream": name} for name, number in (("wrench", 4), ("pad", 2))}
    daemon.handlers["tare.get"] = lambda request: streams[request["stream"]]
    assert client.tare("left", "pad", 0.1)["stream"] == "pad"
    assert client.tare("left", "all") == {"finger": "left", "verified": False, "streams": streams}
    streams["pad"]["tare_id"] = 1
    with pytest.raises(RequestRefused, match="tare of left pad was given up"):
        client.tare("left", "all")


@pytest.mark.parametrize(
    ("given_up", "reason", "code", "told"),
    [
        ("a contact began", "contact", "in_contact", "a contact began"),
        ("the finger was turned", "turned", "not_ready", "the finger was turned"),
        ("the readings moved: hold still", "later_reason", "not_ready", "the readings moved: hold still"),
        ("of an older daemon", None, "not_ready", "of an older daemon"),
        (None, None, "not_ready", "tare.undo took it back"),
    ],
)
def test_a_tare_that_was_given_up_is_reported_as_what_it_was(
    daemon: Daemon, given_up: str | None, reason: str | None, code: str, told: str
) -> None:
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_id": 1}
    daemon.handlers["tare.get"] = lambda _: {
        "busy": False,
        "tare_id": 1,
        "given_up": given_up,
        "given_up_reason": reason,
    }
    with GripClient(daemon.endpoint) as client, pytest.raises(TareGivenUp) as caught:
        client.tare("left", 0.1)
    assert (caught.value.code, caught.value.reason, str(caught.value)) == (
        code,
        reason or ("" if given_up else "undone"),
        f"{code}: the tare of left was given up: {told}",
    )


def test_a_tare_without_readings_is_told(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    daemon.handlers["tare.get"] = lambda _: {"busy": True, "tare_id": 1}
    with GripClient(daemon.endpoint) as client:
        monkeypatch.setattr(
            client,
            "_now_ns",
            lambda: time.monotonic_ns() + 25 * 10**9 * daemon.ops.count("tare.get"),  # 25 s pass with each look
        )
        with pytest.raises(NoAnswer, match="too few readings"):
            client.tare("left", 0.1)
    assert daemon.ops.count("tare.get") >= 2


def test_a_client_that_was_closed_says_so(daemon: Daemon) -> None:
    client, subscriber = GripClient(daemon.endpoint), Subscriber(daemon.endpoint)
    client.disconnect()
    subscriber.close()
    for call in (client.status, subscriber.receive):
        with pytest.raises(ConnectionClosed, match=f"connection to {daemon.endpoint} was closed"):
            call()


def test_a_reply_is_its_map_and_has_its_fields_as_attributes(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = lambda _: {"applied_n": 5, "later": [1]}
    daemon.handlers["status"] = lambda _: {"version": "0.1.0", "streams": {"left.wrench": {"health": 1}}}
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_ids": {"wrench": 0}, "tare_id": 0}
    daemon.handlers["tare.get"] = lambda _: {"busy": False, "tare_id": 1, "stream": "wrench", "std": [0.1]}
    with GripClient(daemon.endpoint) as client:
        grip, again, later = client.grip_set(5.0), client.request("grip.set", force_n=5.0), client.request("later.op")
        status, tare = client.status(), client.tare("left", 0.1)
    assert (grip.applied_n, grip["applied_n"], again.applied_n, later) == (5.0, 5, 5.0, {})
    assert json.loads(json.dumps(grip)) == grip == {"applied_n": 5, "later": [1]}
    with pytest.raises(dataclasses.FrozenInstanceError):
        grip.applied_n = 7.0  # type: ignore[misc]
    assert (status.version, status.streams["left.wrench"].health, status.gripper, status["streams"]) == (
        *("0.1.0", Health.WARN, None),
        {"left.wrench": {"health": 1}},
    )
    assert (tare.verified, tare.tares["wrench"].std, tare["std"]) == (True, (0.1,), [0.1])


@pytest.mark.parametrize("op", [op for op in OPS if not op.startswith("lease.")])
def test_every_op_but_those_of_the_lease_has_a_method_that_returns_its_reply(op: str) -> None:
    returned = typing.get_type_hints(getattr(GripClient, op.replace(".", "_")), vars(client_base))["return"]
    assert returned == Steps[TareResult if op == "tare" else OPS[op].reply]
