from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.aio import AsyncGripClient, AsyncSubscriber
from slipd_client.errors import LeaseInUse, LeaseLost, NoAnswer

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

PATIENCE_S = 60.0


async def joined(publisher: Publisher) -> None:
    await asyncio.to_thread(publisher.wait_for_subscriber)


async def test_the_sign_of_life_ends_a_silence_but_is_not_handed_out(publisher: Publisher) -> None:
    async with AsyncSubscriber(publisher.endpoint, ("warning",), silence_s=PATIENCE_S) as subscriber:
        await joined(publisher)
        await joined(publisher)
        for seq in range(3):
            publisher.send("status", seq)
        publisher.send("warning", 1)
        assert (await anext(aiter(subscriber))).topic == "warning"


async def test_no_message_is_lost_by_cancelled_receives(publisher: Publisher) -> None:
    """Every wait is cancelled or runs out in the midst of a stream; all messages come, in order, once."""
    count, heard = 1500, []
    async with AsyncSubscriber(publisher.endpoint) as subscriber:
        await joined(publisher)

        async def send() -> None:
            for seq in range(count):
                publisher.send("slip.left", seq)
                if seq % 3 == 0:
                    await asyncio.sleep(0.0005)

        sender = asyncio.create_task(send())
        async with asyncio.timeout(PATIENCE_S * 3):
            while len(heard) < count:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(0.0007):
                        while True:
                            message = await subscriber.receive()
                            assert message is not None
                            heard.append((message.seq, message.missed))
        await sender
    assert heard == [(seq, 0) for seq in range(count)]


async def test_a_late_reply_and_one_to_a_cancelled_request_are_not_taken_for_the_next(daemon: Daemon) -> None:
    daemon.handlers["silent"] = lambda _: None
    daemon.handlers["echo"] = lambda request: {"told": request["told"]}
    async with AsyncGripClient(daemon.endpoint) as client:
        await client.hello()
        with pytest.raises(NoAnswer, match="may or may not"):
            await client._run(client._protocol.lease("silent", {}, 0.05))
        for told in range(20):
            asking = asyncio.create_task(client.request("echo", told=-1))
            await asyncio.sleep(0)
            asking.cancel()
            assert await client.request("echo", told=told) == {"told": told}


async def test_a_lease_renews_itself_and_is_given_back(daemon: Daemon, often: int) -> None:
    async with AsyncGripClient(daemon.endpoint) as client, client.lease(often) as lease:
        async with asyncio.timeout(PATIENCE_S):
            while daemon.ops.count("lease.renew") < 3:
                await client.grip_set(5.0)
                await lease.wait(0.001)
        assert not lease.lost
    assert daemon.ops[-1] == "lease.release"


async def test_an_iteration_ends_with_the_lease(daemon: Daemon, publisher: Publisher, often: int) -> None:
    daemon.handlers["lease.renew"] = lambda _: {"error": {"code": "no_lease", "message": "it has ended"}}
    async with (
        AsyncSubscriber(publisher.endpoint, silence_s=PATIENCE_S) as messages,
        AsyncGripClient(daemon.endpoint) as client,
        client.lease(often),
    ):
        with pytest.raises(LeaseLost, match="it has ended"):
            await anext(aiter(messages))


async def test_a_lease_of_a_loop_that_stood_still_is_lost(daemon: Daemon) -> None:
    async with AsyncGripClient(daemon.endpoint) as client, client.lease(50) as lease:
        await asyncio.to_thread(lambda: None)
        lease._sent_ns -= 50_000_000
        with pytest.raises(LeaseLost, match="was stalled"):
            await client.grip_set(5.0)


async def test_a_lease_is_given_back_when_its_task_is_cancelled(daemon: Daemon, often: int) -> None:
    held = asyncio.Event()

    async def steer(client: Any) -> None:
        async with client.lease(often):
            held.set()
            await asyncio.sleep(PATIENCE_S)

    async with AsyncGripClient(daemon.endpoint) as client:
        task = asyncio.create_task(steer(client))
        await held.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert daemon.ops[-1] == "lease.release"


async def test_tasks_cannot_take_each_others_lease(daemon: Daemon, often: int) -> None:
    outcomes: list[str] = []

    async def hold(client: AsyncGripClient) -> None:
        try:
            async with client.lease(often) as lease:
                await asyncio.sleep(0.05)
                await client.grip_set(5.0)
                assert not lease.lost
                outcomes.append("held")
        except LeaseInUse:
            outcomes.append("refused")

    async with AsyncGripClient(daemon.endpoint) as client:
        await asyncio.gather(*(hold(client) for _ in range(8)))
        assert sorted(outcomes) == ["held"] + ["refused"] * 7
        assert daemon.ops.count("lease.acquire") == daemon.ops.count("lease.release") == 1
        async with client.lease(often):
            await client.grip_set(6.0)


async def test_a_task_does_not_ride_on_the_lease_of_another_and_its_own_tasks_do(daemon: Daemon, often: int) -> None:
    held, told = asyncio.Event(), asyncio.Event()

    async def hold(client: AsyncGripClient) -> None:
        async with client.lease(often):
            held.set()
            await told.wait()
            await asyncio.gather(client.grip_set(5.0), client.grip_adjust(0.5))
            await asyncio.wait_for(asyncio.create_task(client.gripper_close(5.0)), PATIENCE_S)

    async with AsyncGripClient(daemon.endpoint) as client:
        holder = asyncio.create_task(hold(client), name="holder")
        await held.wait()
        with pytest.raises(LeaseInUse, match="task 'holder' holds the lease"):
            await client.grip_set(9.0)
        with pytest.raises(LeaseInUse):
            await client.tare("left")
        await client.gravity_set("left", (0.0, 0.0, -9.81))
        await client.gripper_stop()
        assert not {"grip.set", "tare"} & set(daemon.ops)
        told.set()
        await holder
    assert [op for op in daemon.ops if op.startswith("grip")] == [
        *("gripper.stop", "grip.set", "grip.adjust", "gripper.close")
    ]
