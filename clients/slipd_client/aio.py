"""The same subscriber, grip client and motion advisor for asyncio; cancelling one of their calls loses no message."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import zmq

from slipd_client.client_base import GripClientBase
from slipd_client.errors import ClientError
from slipd_client.lease_keeper import LEASE_MS, LeaseKeeper, check_held
from slipd_client.link import Link
from slipd_client.messages.schema.replies import MotionReply
from slipd_client.messages.schema.topics import Message
from slipd_client.motion import MotionAdvisorBase
from slipd_client.request_protocol import TIMEOUT_S, Ask, Envelope, Result, Steps
from slipd_client.subscriber import SubscriberBase

if TYPE_CHECKING:
    from slipd_client.keys import Keys


class Waker:
    """Waits for a socket to become ready for reading or writing, in the loop that runs when it is created.

    ZeroMQ's file descriptor signals each change only once. So call `check` after every use of the socket, and receive
    until nothing is left before waiting.
    """

    def __init__(self, socket: zmq.Socket[Any]) -> None:
        self._socket = socket
        self._loop = asyncio.get_running_loop()
        self._events: dict[int, asyncio.Event] = {zmq.POLLIN: asyncio.Event(), zmq.POLLOUT: asyncio.Event()}
        self._loop.add_reader(socket.FD, self.check)

    def check(self) -> None:
        """Wake every task that waits for what the socket is ready for."""
        ready = int(self._socket.getsockopt(zmq.EVENTS))
        for event, wake in self._events.items():
            if ready & event:
                wake.set()

    async def wait(self, event: int, until: float | None) -> None:
        """Wait until the socket may be ready for ``event``, or until the time ``until`` (on ``time.monotonic``).

        The caller learns which of the two happened when it uses the socket.
        """
        wake = self._events[event]
        wake.clear()
        self.check()
        end = None if until is None else self._loop.call_later(until - time.monotonic(), wake.set)
        try:
            await wake.wait()
        finally:
            if end is not None:
                end.cancel()

    def stop(self) -> None:
        """Leave the loop; call it before the socket is closed."""
        self._loop.remove_reader(self._socket.FD)


T = TypeVar("T")
InLoop = TypeVar("InLoop", bound="_InLoop")

AT_ONCE = 64
"""Messages returned one after another before the loop's other tasks get a turn: some milliseconds."""


class _InLoop:
    """What owns a connection in the loop that runs when its ``async with`` begins."""

    _link: Link
    _waker: Waker

    async def __aenter__(self: InLoop) -> InLoop:
        self._waker = Waker(self._link.socket)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._waker.stop()
        self._link.close()


class AsyncSubscriber(_InLoop, SubscriberBase):
    """Receives messages in an asyncio loop, for an ``async with``. Arguments: `SubscriberBase`.

    A message is taken from the connection in the same step that returns it. So a cancelled ``receive``, a timeout
    around it, and an iteration that is left and begun again lose nothing.
    """

    _in_a_row = 0

    async def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        return await self._receive(None if timeout_s is None else time.monotonic() + timeout_s)

    async def __aiter__(self) -> AsyncIterator[Message]:
        """Iterate over every message from now on.

        Raises:
            LeaseLost: This task runs the block of a lease, and that lease is lost: at once, also without a message.
            Silence: No message arrived for ``silence_s``. A new iteration continues to receive.
        """
        while True:
            check_held()
            message = await self._receive(self._patient_until(), by_silence=True)
            if message is None:
                self.check_silence()
            else:
                yield message

    async def _receive(self, until: float | None, by_silence: bool = False) -> Message | None:
        while True:
            self._in_a_row += 1
            if self._in_a_row > AT_ONCE:
                self._in_a_row = 0
                await asyncio.sleep(0)
            frames = self._link.take()
            if frames is not None:
                message = self._accept(frames)
                if message is not None:
                    return message
                if by_silence:
                    until = self._patient_until()
            elif until is not None and time.monotonic() >= until:
                return None
            else:
                self._in_a_row = 0
                await self._waker.wait(zmq.POLLIN, until)


class AsyncLease(LeaseKeeper):
    """A lease while its block runs. `AsyncGripClient.lease` creates it."""

    def __init__(self, ttl_ms: int, sent_ns: int, owner: str) -> None:
        super().__init__(ttl_ms, sent_ns, owner)
        self._ended = asyncio.Event()

    async def wait(self, seconds: float) -> None:
        """Let time pass while holding the lease.

        Raises:
            LeaseLost: At once when it is lost.
        """
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._ended.wait(), seconds)
        self.check()

    def lose(self, why: str) -> None:
        """Mark it as lost; the first reason stays."""
        super().lose(why)
        self._ended.set()


class AsyncGripClient(_InLoop, GripClientBase):
    """The asyncio client, for an ``async with``; methods and arguments are those of `GripClientBase`, to be awaited.

    One request at a time: several tasks may share it and wait for each other, but only the one that acquired the lease,
    and tasks that it creates within the block, move the gripper. A request that is cancelled may or may not have been
    carried out.
    """

    _turn: asyncio.Lock

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
        self._claim(lease)
        try:
            await self._run(self._protocol.lease("lease.acquire", {"ttl_ms": ttl_ms}))
            lease.note_renewal(self._protocol.lease_asked_ns)
            renewer = asyncio.create_task(self._renew(lease), name="slipd-lease")
            lease.enter()
            try:
                yield lease
            finally:
                lease.leave()
                renewer.cancel()
                await asyncio.wait([renewer])
                if not lease.lost:
                    with contextlib.suppress(ClientError):
                        await self._run(self._protocol.lease("lease.release", {}))
        finally:
            self._unclaim()

    async def _renew(self, lease: AsyncLease) -> None:
        await asyncio.sleep(lease.period_s)
        while not lease.lost:
            try:
                await self._run(self._renewal(lease))
            except ClientError as error:
                lease.note_failure(error)
            await asyncio.sleep(lease.period_s)

    async def __aenter__(self) -> AsyncGripClient:
        self._turn = asyncio.Lock()
        return await super().__aenter__()

    async def _run(self, steps: Steps[T]) -> T:
        try:
            step = next(steps)
            while True:
                if isinstance(step, Ask):
                    try:
                        result = await self._exchange(step)
                    except ClientError as error:
                        step = steps.throw(error)
                        continue
                else:
                    await asyncio.sleep(step.seconds)
                    result = {}
                step = steps.send(result)
        except StopIteration as done:
            return done.value  # type: ignore[no-any-return]

    async def _exchange(self, ask: Ask) -> Result:
        timeout_s = self.timeout_s if ask.timeout_s is None else ask.timeout_s
        async with self._turn:
            until = time.monotonic() + timeout_s
            envelope = await self._send(ask, until)
            while (frames := self._link.take()) is not None or time.monotonic() < until:
                if frames is None:
                    await self._waker.wait(zmq.POLLIN, until)
                elif (result := self._protocol.result(envelope, frames)) is not None:
                    return result
            raise self._protocol.no_reply(timeout_s)

    async def _send(self, ask: Ask, until: float) -> Envelope:
        while True:
            envelope = self._protocol.pack(ask)
            if self._link.send(envelope.data):
                return envelope
            if time.monotonic() >= until:
                raise self._protocol.no_listener()
            await self._waker.wait(zmq.POLLOUT, until)


class AsyncMotionAdvisor(MotionAdvisorBase):
    """The asyncio advisor, for an ``async with``; arguments are those of `MotionAdvisor`, and `check` is awaited."""

    def __init__(
        self,
        publish: str | None = None,
        requests: str | None = None,
        *,
        keys: Keys | None = None,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self.client = AsyncGripClient(requests, keys=keys, timeout_s=timeout_s)
        super().__init__(publish, self.client.clock, keys)

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

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._messages.close()
        await self.client.__aexit__(kind, error, trace)
