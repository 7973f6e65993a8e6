"""The same subscriber, grip client and motion advisor for asyncio; cancelling one of their calls loses no message."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Sequence
from typing import TypeVar

import zmq

from slipd_client.client_base import GripClientBase
from slipd_client.lease_keeper import LEASE_MS, LeaseKeeper
from slipd_client.link import Link, Steps
from slipd_client.messages.replies import MotionReply
from slipd_client.messages.topics import Message
from slipd_client.motion import MotionAdvisorBase
from slipd_client.subscriber import SubscriberBase

T = TypeVar("T")
InLoop = TypeVar("InLoop", bound="_InLoop")

AT_ONCE = 64
"""Messages returned one after another before the loop's other tasks get a turn: some milliseconds."""


class _InLoop:
    """Owns a connection in the loop that runs when its ``async with`` begins.

    A message is taken from the connection in the same step that returns it, so that a cancelled call loses none.
    """

    _link: Link
    _changed: asyncio.Event
    """Set when the state of the socket may have changed."""
    _in_a_row = 0

    async def __aenter__(self: InLoop) -> InLoop:
        self._changed = asyncio.Event()
        asyncio.get_running_loop().add_reader(self._link.socket.FD, self._note_change)
        return self

    async def __aexit__(self, *failure: object) -> None:
        asyncio.get_running_loop().remove_reader(self._link.socket.FD)
        self._link.close()

    def _ready_for(self) -> int:
        """Return the events for which the socket is ready; until then its file descriptor remains readable."""
        return int(self._link.socket.getsockopt(zmq.EVENTS))

    def _note_change(self) -> None:
        self._ready_for()
        self._changed.set()

    async def _wait(self, event: int, until: float | None) -> None:
        """Wait until the socket may be ready for ``event``, or until the time ``until`` (on ``time.monotonic``).

        The caller learns which of the two happened when it uses the socket. ZeroMQ's file descriptor signals each
        change only once, and use of the socket may take the signal away: so the state is looked at first.
        """
        self._changed.clear()
        if self._ready_for() & event:
            return
        loop = asyncio.get_running_loop()
        end = None if until is None else loop.call_later(until - time.monotonic(), self._changed.set)
        try:
            await self._changed.wait()
        finally:
            if end is not None:
                end.cancel()

    def _run(self, steps: Steps[T]) -> Steps[T]:
        """Return steps, for the caller to await."""
        return steps

    async def _frames(self, until: float | None) -> list[bytes] | None:
        self._in_a_row += 1
        if self._in_a_row > AT_ONCE:
            self._in_a_row = 0
            await asyncio.sleep(0)
        while (frames := self._link.receive_now()) is None and (until is None or time.monotonic() < until):
            self._in_a_row = 0
            await self._wait(zmq.POLLIN, until)
        return frames

    async def _writable(self, until: float) -> bool:
        if time.monotonic() >= until:
            return False
        await self._wait(zmq.POLLOUT, until)
        return True


class AsyncSubscriber(_InLoop, SubscriberBase):
    """Receives messages in an asyncio loop, for an ``async with``. Arguments: `SubscriberBase`.

    A cancelled ``receive``, a timeout around it, and an iteration that is left and begun again lose nothing.
    """

    async def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        return await self._received(timeout_s)

    async def __aiter__(self) -> AsyncIterator[Message]:
        """Iterate over every message from now on.

        Raises:
            LeaseLost: This task runs the block of a lease, and that lease is lost: at once, also without a message.
            Silence: No message arrived for ``silence_s``. A new iteration continues to receive.
        """
        while True:
            yield await self._awaited()


class AsyncLease(LeaseKeeper):
    """A lease while its block runs. `AsyncGripClient.lease` creates it."""

    _event = asyncio.Event

    async def wait(self, seconds: float) -> None:
        """Let time pass while holding the lease.

        Raises:
            LeaseLost: At once when it is lost.
        """
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._ended.wait(), seconds)
        self.check()


class AsyncGripClient(_InLoop, GripClientBase):
    """The asyncio client, for an ``async with``; methods and arguments are those of `GripClientBase`, to be awaited.

    One request at a time: several tasks may share it and wait for each other, but only the one that acquired the lease,
    and tasks that it creates within the block, move the gripper. A request that is cancelled may or may not have been
    carried out.
    """

    _lock = asyncio.Lock

    @contextlib.asynccontextmanager
    async def lease(self, ttl_ms: int = LEASE_MS) -> AsyncIterator[AsyncLease]:
        """Hold the right to move the gripper while the block runs; a task renews it in the background.

        Neither giving the lease back nor losing it moves anything. The lease of a program that dies ends within
        ``ttl_ms``, as does that of a loop that some task blocks for as long.

        Raises:
            LeaseInUse: This client has a lease already, of this task or another one.
        """
        task = asyncio.current_task()
        lease = AsyncLease(ttl_ms, time.monotonic_ns(), f"task {task.get_name()!r}" if task else "a callback")
        with self._claimed(lease):
            await self._acquire(lease, ttl_ms)
            renewer = asyncio.create_task(self._renew(lease), name="slipd-lease")
            try:
                with lease.entered():
                    yield lease
            finally:
                renewer.cancel()
                await asyncio.wait([renewer])
                await self._give_back(lease)

    async def _renew(self, lease: AsyncLease) -> None:
        await asyncio.sleep(lease.period_s)
        while not lease.lost:
            await self._renew_once(lease)
            await asyncio.sleep(lease.period_s)

    async def _take_turn(self, timeout_s: float) -> float:
        await self._turn.acquire()
        return time.monotonic() + timeout_s

    async def _sleep(self, seconds: float) -> None:
        await asyncio.sleep(seconds)


class AsyncMotionAdvisor(MotionAdvisorBase):
    """The asyncio advisor, for an ``async with``; arguments are those of `MotionAdvisor`, and `check` is awaited."""

    _kind = AsyncGripClient
    client: AsyncGripClient

    async def check(
        self,
        trajectory: Sequence[Sequence[float]] | None = None,
        acceleration_mps2: Sequence[float] | None = None,
    ) -> MotionReply:
        """Return whether the grip holds a motion; as `MotionAdvisor.check`."""
        return await self.client.motion_check(trajectory, acceleration_mps2)

    async def __aenter__(self) -> AsyncMotionAdvisor:
        await self.client.__aenter__()
        return self

    async def __aexit__(self, *failure: object) -> None:
        self._messages.close()
        await self.client.__aexit__(*failure)
