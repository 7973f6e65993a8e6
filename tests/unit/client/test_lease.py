"""A lease in its block: renewed, lost, given back."""

from __future__ import annotations

import contextlib
import contextvars
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.errors import LeaseInUse, LeaseLost, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

PATIENCE_S = 60.0


def in_threads(*works: Callable[[], object], names: list[str | None] | None = None) -> None:
    """Runs functions in threads of their own, and raises here what any of them raised."""
    faults: list[BaseException] = []

    def run(work: Callable[[], object]) -> None:
        try:
            work()
        except BaseException as fault:  # pytest.fail included
            faults.append(fault)

    named = names or [None] * len(works)
    threads = [threading.Thread(target=run, args=(work,), name=name) for work, name in zip(works, named, strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for fault in faults:
        raise fault


def moves(daemon: Daemon) -> list[str]:
    """What was asked of a daemon, but for greetings and renewals."""
    return [op for op in daemon.asked_ops if op != "lease.renew"]


def refuse(code: str, message: str = "no") -> Callable[[Any], dict[str, Any]]:
    return lambda _: {"error": {"code": code, "message": message, "field": ""}}


@pytest.mark.parametrize(
    ("refused", "code", "asked"),
    [
        ("", "", ["lease.acquire", "grip.set", "lease.release"]),
        ("grip.set", "no_limit", ["lease.acquire", "grip.set", "lease.release"]),
        ("grip.set", "no_lease", ["lease.acquire", "grip.set"]),
        ("grip.set", "wrong_boot", ["lease.acquire", "grip.set"]),
        ("lease.release", "no_lease", ["lease.acquire", "grip.set", "lease.release"]),
        ("lease.acquire", "lease_held", ["lease.acquire"]),
    ],
)
def test_a_lease_is_given_back_at_the_end_of_the_block_unless_it_was_refused_or_lost(
    daemon: Daemon, refused: str, code: str, asked: list[str]
) -> None:
    daemon.handlers[refused] = refuse(code)
    with GripClient(daemon.endpoint) as client, contextlib.ExitStack() as stack:
        if refused in ("grip.set", "lease.acquire"):
            stack.enter_context(pytest.raises(RequestRefused, match=code))
        with client.lease(59_000) as lease:
            client.grip_set(5.0)
            assert not lease.lost
    assert daemon.asked[0]["ttl_ms"] == 59_000
    assert moves(daemon) == asked


@pytest.mark.parametrize("busy", [0, 2])
def test_a_lease_renews_itself_while_the_block_runs_and_asks_a_busy_daemon_again(
    daemon: Daemon, often: int, busy: int
) -> None:
    answers = iter([{"error": {"code": "busy", "message": "ask more slowly"}}] * busy)
    daemon.handlers["lease.renew"] = lambda _: next(answers, {})
    with GripClient(daemon.endpoint) as client, client.lease(often) as lease:
        until_s = time.monotonic() + PATIENCE_S
        while daemon.ops.count("lease.renew") < 4:
            client.status()
            lease.wait(0.001)
            assert time.monotonic() < until_s
        assert (lease.lost, lease.why) == (False, "")
    assert daemon.ops[-1] == "lease.release"


def test_a_lease_that_is_refused_its_renewal_is_lost_at_once(daemon: Daemon, often: int) -> None:
    daemon.handlers["lease.renew"] = refuse("no_lease", "it has ended")
    with GripClient(daemon.endpoint) as client, client.lease(often) as lease:
        with pytest.raises(LeaseLost, match="it has ended"):
            lease.wait(PATIENCE_S)
        assert (lease.lost, lease.why) == (True, "no_lease: it has ended")
        for move in (lambda: client.grip_set(5.0), client.gripper_stop, client.fault_ack):
            with pytest.raises(LeaseLost):
                move()
        client.status()
    assert not {"grip.set", "gripper.stop", "fault.ack", "lease.release"} & set(daemon.ops)


def test_a_lease_that_was_not_renewed_in_time_is_lost_without_a_word_of_the_daemon(daemon: Daemon) -> None:
    daemon.handlers["lease.renew"] = lambda _: None
    with GripClient(daemon.endpoint) as client, client.lease(30) as lease:
        with pytest.raises(LeaseLost):
            lease.wait(PATIENCE_S)
        with pytest.raises(LeaseLost, match="keeps its force"):
            client.grip_set(5.0)


def test_an_iteration_over_messages_ends_with_the_lease_and_not_with_the_silence(
    daemon: Daemon, publisher: Publisher, often: int
) -> None:
    with (
        Subscriber(publisher.endpoint, silence_s=PATIENCE_S) as messages,
        GripClient(daemon.endpoint) as client,
        client.lease(often),
    ):
        publisher.wait_for_subscriber()
        publisher.send("slip.left", 1)
        heard = iter(messages)
        assert next(heard).seq == 1
        publisher.send("slip.left", 2)
        assert next(heard).seq == 2, "a lease that is renewed ends nothing"
        daemon.handlers["lease.renew"] = refuse("no_lease", "it has ended")
        with pytest.raises(LeaseLost, match="it has ended"):
            next(heard)
        assert messages.receive(0.0) is None, "and nothing else ended it"


def test_a_lease_of_a_thread_that_is_no_more_is_renewed_no_more(daemon: Daemon, often: int) -> None:
    with GripClient(daemon.endpoint) as client:
        lease = client.lease(often)
        owner = threading.Thread(target=lease.__enter__)
        owner.start()
        owner.join()
        until_s = time.monotonic() + PATIENCE_S
        while any(thread.name == "slipd-lease" for thread in threading.enumerate()):
            assert time.monotonic() < until_s
            time.sleep(0.001)
        lease.__exit__(None, None, None)


def test_a_connection_that_is_closed_within_the_block_loses_the_lease(daemon: Daemon, often: int) -> None:
    client = GripClient(daemon.endpoint)
    with client.lease(often) as lease:
        client.disconnect()
        with pytest.raises(LeaseLost, match="closed"):
            lease.wait(PATIENCE_S)


def test_a_lease_is_free_for_others_only_once_the_daemon_has_it_back(daemon: Daemon) -> None:
    """A release that arrived behind the next acquisition would end the lease of another thread."""
    releasing, tried, refused = threading.Event(), threading.Event(), []

    def release(_: Any) -> dict[str, Any]:
        releasing.set()
        tried.wait(PATIENCE_S)
        return {}

    def take() -> None:
        releasing.wait()
        with pytest.raises(LeaseInUse), client.lease():
            pytest.fail("the block ran")
        refused.append(True)
        tried.set()

    daemon.handlers["lease.release"] = release
    with GripClient(daemon.endpoint, timeout_s=PATIENCE_S) as client:
        other = threading.Thread(target=take)
        other.start()
        with client.lease(60_000):
            pass
        other.join()
    assert refused
    assert daemon.ops.count("lease.acquire") == 1


NEEDS_THE_LEASE = [
    lambda client: client.grip_set(5.0),
    lambda client: client.grip_adjust(0.5),
    lambda client: client.gripper_close(5.0),
    lambda client: client.gripper_open(drop=True),
    lambda client: client.gripper_activate(),
    lambda client: client.fault_ack(),
    lambda client: client.tare("left"),
    lambda client: client.tare_undo("left"),
    lambda client: client.friction_set("left", 0.9),
    lambda client: client.request("lease.acquire", ttl_ms=200),
    lambda client: client.request("lease.release"),
    lambda client: client.request("gripper.later", force_n=5.0),
]
NEEDS_NO_LEASE = [
    lambda client: client.hello(),
    lambda client: client.status(),
    lambda client: client.tare_get("left"),
    lambda client: client.gravity_set("left", (0.0, 0.0, -9.81)),
    lambda client: client.record_start(),
    lambda client: client.grip_hold(),
    lambda client: client.gripper_stop(),
    lambda client: client.request("later.op"),
]


def test_a_thread_does_not_ride_on_the_lease_of_another(daemon: Daemon) -> None:
    """What needs the lease is not sent; what needs none, and what stops the gripper, is."""

    def other() -> None:
        for call in NEEDS_THE_LEASE:
            before = len(moves(daemon))
            with pytest.raises(LeaseInUse, match="'holder' holds the lease"):
                call(client)
            assert len(moves(daemon)) == before
        for call in NEEDS_NO_LEASE:
            call(client)

    def holder() -> None:
        with client.lease(60_000):
            in_threads(other)
            for call in NEEDS_THE_LEASE[:6]:
                call(client)

    with GripClient(daemon.endpoint, timeout_s=PATIENCE_S) as client:
        in_threads(holder, names=["holder"])
        with client.lease(60_000):
            context = contextvars.copy_context()
            in_threads(lambda: context.run(client.grip_adjust, 0.25))  # a thread is lent the lease with its context
        client.friction_set("left", 0.9)  # no thread holds the lease: it is for the daemon to refuse
    assert daemon.ops.count("grip.set") == 1


def test_a_request_that_waited_for_its_turn_while_the_lease_was_lost_is_not_sent(daemon: Daemon) -> None:
    def move() -> None:
        with pytest.raises(LeaseLost, match="in the meantime"):
            client.grip_set(5.0)

    with GripClient(daemon.endpoint, timeout_s=PATIENCE_S) as client, client.lease(60_000) as lease:
        context = contextvars.copy_context()
        with client._turn:
            waiting = threading.Thread(target=context.run, args=(move,))
            waiting.start()
            time.sleep(0.05)  # it waits for its turn
            lease.lose("in the meantime")
        waiting.join()
    assert "grip.set" not in daemon.ops
