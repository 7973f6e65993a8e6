"""A lease in its block: renewed, lost, given back, and not shared; of the blocking and of the asyncio client."""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from client_peers import PATIENCE_S, Daemon, Publisher, refuse, until

from slipd_client.aio import AsyncGripClient, AsyncSubscriber
from slipd_client.errors import LeaseInUse, LeaseLost, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.lease_keeper import LeaseKeeper, held_until
from slipd_client.subscriber import Subscriber

ENDED = refuse("no_lease", "it has ended")


def in_a_thread(work: Callable[[], object]) -> None:
    """Run a function in a thread called holder_0, and raise here what it raised."""
    with ThreadPoolExecutor(thread_name_prefix="holder") as threads:
        threads.submit(work).result()


@pytest.mark.parametrize(
    ("sent_s_ago", "left_s", "why"),
    [(0, 600.0, ""), (300, 300.0, ""), (700, -100.0, "it was not renewed in time, because this program")],
)
def test_a_lease_lasts_from_when_it_was_asked_for_and_is_looked_at_before_its_end(
    sent_s_ago: int, left_s: float, why: str
) -> None:
    lease = LeaseKeeper(600_000, time.monotonic_ns() - sent_s_ago * 10**9, "me")
    assert (lease.left_s, lease.why[: len(why)], lease.lost, lease.period_s) == (
        pytest.approx(left_s, abs=50.0),
        why,
        why != "",
        200.0,
    )
    with lease.entered():
        assert held_until() - time.monotonic() == pytest.approx(min(left_s, 200.0), abs=50.0)
    assert held_until() == math.inf


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
    assert daemon.asked_ops == asked


@pytest.mark.usefixtures("often")
def test_a_lease_renews_itself_while_the_block_runs_asks_a_busy_daemon_again_and_is_lost_at_a_refusal(
    daemon: Daemon,
) -> None:
    answers = iter([refuse("busy", "ask more slowly")(None)] * 2)
    daemon.handlers["lease.renew"] = lambda _: next(answers, {})
    with GripClient(daemon.endpoint) as client, client.lease() as lease:
        until(lambda: daemon.ops.count("lease.renew") >= 4, lambda: (client.status(), lease.wait(0.001)))
        assert (lease.lost, lease.why) == (False, "")
        daemon.handlers["lease.renew"] = ENDED
        with pytest.raises(LeaseLost, match="it has ended"):
            lease.wait(PATIENCE_S)
        assert (lease.lost, lease.why) == (True, "no_lease: it has ended")
        daemon.requests.clear()
        for move in (lambda: client.grip_set(5.0), client.gripper_stop, client.fault_ack):
            with pytest.raises(LeaseLost, match="keeps its force"):
                move()
        client.status()
    assert daemon.asked_ops == ["status"], "and a lease that is lost is not given back"


@pytest.mark.parametrize(
    ("lose", "why"),
    [
        (lambda daemon, _: daemon.handlers.update({"lease.renew": lambda _: None}), "no answer|not renewed in time"),
        (lambda _, client: client.disconnect(), "closed"),
    ],
)
def test_a_lease_is_lost_without_a_word_of_the_daemon(
    daemon: Daemon, lose: Callable[[Daemon, GripClient], object], why: str
) -> None:
    with GripClient(daemon.endpoint) as client, client.lease(100) as lease:
        lose(daemon, client)
        with pytest.raises(LeaseLost, match=why):
            lease.wait(PATIENCE_S)


@pytest.mark.usefixtures("often")
def test_an_iteration_over_messages_ends_with_the_lease_and_not_with_the_silence(
    daemon: Daemon, publisher: Publisher
) -> None:
    with (
        Subscriber(publisher.endpoint, silence_s=PATIENCE_S) as messages,
        GripClient(daemon.endpoint) as client,
        client.lease(),
    ):
        publisher.wait_for(b"slip")
        heard = iter(messages)
        for seq in (1, 2):  # a lease that is renewed ends nothing
            publisher.send("slip.left", seq)
            assert next(heard).seq == seq
        daemon.handlers["lease.renew"] = ENDED
        with pytest.raises(LeaseLost, match="it has ended"):
            next(heard)
        assert messages.receive(0.0) is None, "and nothing else ended it"


@pytest.mark.usefixtures("often")
def test_a_lease_of_a_thread_that_is_no_more_is_renewed_no_more(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        lease = client.lease()
        in_a_thread(lease.__enter__)
        until(lambda: "slipd-lease" not in {thread.name for thread in threading.enumerate()})
        lease.__exit__(None, None, None)


def test_a_lease_is_free_for_others_only_once_the_daemon_has_it_back(daemon: Daemon) -> None:
    """A release that arrived behind the next acquisition would end the lease of another thread."""
    releasing, tried = threading.Event(), threading.Event()

    def release(_: Any) -> dict[str, Any]:
        releasing.set()
        tried.wait(PATIENCE_S)
        return {}

    def take() -> None:
        releasing.wait()
        with pytest.raises(LeaseInUse), client.lease():
            pytest.fail("the block ran")
        tried.set()

    daemon.handlers["lease.release"] = release
    with GripClient(daemon.endpoint) as client, ThreadPoolExecutor() as threads:
        with client.lease():
            other = threads.submit(take)
        other.result()
    assert daemon.asked_ops == ["lease.acquire", "lease.release"]


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
            with pytest.raises(LeaseInUse, match="'holder_0' holds the lease"):
                call(client)
        assert daemon.asked_ops == ["lease.acquire"]
        for call in NEEDS_NO_LEASE:
            call(client)

    def holder() -> None:
        with client.lease():
            in_a_thread(other)
            for call in NEEDS_THE_LEASE[:6]:
                call(client)

    with GripClient(daemon.endpoint) as client:
        in_a_thread(holder)
        with client.lease():
            context = contextvars.copy_context()
            in_a_thread(lambda: context.run(client.grip_adjust, 0.25))  # a thread is lent the lease with its context
        client.friction_set("left", 0.9)  # no thread holds the lease: it is for the daemon to refuse
    assert daemon.ops.count("grip.set") == 1


def test_a_request_that_waited_for_its_turn_while_the_lease_was_lost_is_not_sent(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client, client.lease() as lease, ThreadPoolExecutor() as threads:
        context = contextvars.copy_context()
        with client._turn:
            waiting = threads.submit(context.run, client.grip_set, 5.0)
            time.sleep(0.05)  # it waits for its turn
            lease.lose("in the meantime")
        with pytest.raises(LeaseLost, match="in the meantime"):
            waiting.result()
    assert daemon.asked_ops == ["lease.acquire"]


@pytest.mark.usefixtures("often")
async def test_an_asyncio_lease_renews_itself_and_an_iteration_ends_with_it(
    daemon: Daemon, publisher: Publisher
) -> None:
    async with (
        AsyncSubscriber(publisher.endpoint, silence_s=PATIENCE_S) as messages,
        AsyncGripClient(daemon.endpoint) as client,
        client.lease() as lease,
    ):
        async with asyncio.timeout(PATIENCE_S):
            while daemon.ops.count("lease.renew") < 3:
                await client.grip_set(5.0)
                await lease.wait(0.001)
        daemon.handlers["lease.renew"] = ENDED
        with pytest.raises(LeaseLost, match="it has ended"):
            await anext(aiter(messages))


async def test_a_lease_is_given_back_when_its_task_is_cancelled(daemon: Daemon) -> None:
    async def steer() -> None:
        async with client.lease():
            asyncio.current_task().cancel()
            await asyncio.sleep(PATIENCE_S)

    async with AsyncGripClient(daemon.endpoint) as client:
        with pytest.raises(asyncio.CancelledError):
            await steer()
    assert daemon.ops[-1] == "lease.release"


async def test_tasks_do_not_ride_on_the_lease_of_another_and_its_own_tasks_do(daemon: Daemon) -> None:
    async def other() -> None:
        for refused in (client.grip_set(9.0), client.tare("left"), client.lease().__aenter__()):
            with pytest.raises(LeaseInUse, match="task 'holder' holds"):
                await refused
        await client.gravity_set("left", (0.0, 0.0, -9.81))
        await client.gripper_stop()

    asyncio.current_task().set_name("holder")
    async with AsyncGripClient(daemon.endpoint) as client:
        async with client.lease():
            await asyncio.create_task(other(), context=contextvars.Context())  # as of a task that does not hold it
            await asyncio.gather(client.grip_set(5.0), client.grip_adjust(0.5))
            await asyncio.create_task(client.gripper_close(5.0))
        async with client.lease():
            await client.grip_set(6.0)
    assert daemon.asked_ops == [
        *("lease.acquire", "gravity.set", "gripper.stop", "grip.set", "grip.adjust", "gripper.close", "lease.release"),
        *("lease.acquire", "grip.set", "lease.release"),
    ]
