"""The same subscriber and grip client for asyncio; cancelling a call of theirs loses no message."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Coroutine
from types import TracebackType
from typing import Any

import zmq

from slipd_client.asking import Ask, Envelope, Result, Steps
from slipd_client.bell import Bell
from slipd_client.errors import ClientError
from slipd_client.holding import LEASE_MS, Holding
from slipd_client.messages.typed import Message
from slipd_client.ops import Ops
from slipd_client.subscriber import SubscriberBase

AT_ONCE = 64
"""Messages handed out one after another before the loop's other tasks have their turn: some milliseconds."""


class AsyncSubscriber(SubscriberBase):
    """Receives messages in an asyncio loop, for an ``async with``. Arguments: `SubscriberBase`.

    A message is taken from the connection in the very step that hands it out. So a cancelled ``receive``, a timeout
    around it, and an iteration that is left and begun anew lose nothing.
    """

    _bell: Bell
    _in_a_row = 0

    async def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        return await self._receive(None if timeout_s is None else time.monotonic() + timeout_s)

    async def __aiter__(self) -> AsyncIterator[Message]:
        """Every message from now on.

        Raises:
            Silence: Nothing was heard for ``silence_s``. Iterating anew goes on listening.
        """
        while True:
            message = await self._receive(self._hearing.silent_at, by_silence=True)
            if message is None:
                raise self._hearing.silence(self.endpoint)
            yield message

    async def _receive(self, until: float | None, by_silence: bool = False) -> Message | None:
        while True:
            self._in_a_row += 1
            if self._in_a_row > AT_ONCE:
                self._in_a_row = 0
                await asyncio.sleep(0)
            frames = self._link.take()
            if frames is not None:
                message = self._hearing.take(frames)
                if message is not None:
                    return message
                if by_silence:
                    until = self._hearing.silent_at
            elif until is not None and time.monotonic() >= until:
                return None
            else:
                self._in_a_row = 0
                await self._bell.wait(zmq.POLLIN, until)

    async def __aenter__(self) -> AsyncSubscriber:
        self._bell = Bell(self._link.socket)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bell.stop()
        self._link.close()


class AsyncLease(Holding):
    """A lease while its block runs. `AsyncGripClient.lease` makes it."""

    def __init__(self, ttl_ms: int, sent_ns: int) -> None:
        super().__init__(ttl_ms, sent_ns)
        self._gone = asyncio.Event()

    async def wait(self, seconds: float) -> None:
        """Let time pass while holding it.

        Raises:
            LeaseLost: At once when it is lost.
        """
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._gone.wait(), seconds)
        self.check()

    def lose(self, why: str) -> None:
        """It is lost; the first reason stays."""
        super().lose(why)
        self._gone.set()


class AsyncGripClient(Ops[Coroutine[Any, Any, Result]]):
    """The asyncio client, for an ``async with``; its methods and arguments are those of `Ops`, and are awaited.

    One request at a time: several tasks may share it, and wait for each other. A request that is cancelled may or may
    not have been done.
    """

    _bell: Bell
    _turn: asyncio.Lock

    @contextlib.asynccontextmanager
    async def lease(self, ttl_ms: int = LEASE_MS) -> AsyncIterator[AsyncLease]:
        """Hold the right to move the gripper while the block runs; a task renews it in the background.

        Giving it back, or losing it, never moves anything. A lease whose program dies ends within ``ttl_ms``, and so
        does that of a loop which some task blocks for as long.
        """
        sent_ns = self._may_acquire()
        await self.request("lease.acquire", ttl_ms=ttl_ms)
        lease = self._holding = AsyncLease(ttl_ms, sent_ns)
        renewer = asyncio.create_task(self._renew(lease), name="slipd-lease")
        try:
            yield lease
        finally:
            self._holding = None
            renewer.cancel()
            await asyncio.wait([renewer])
            if not lease.lost:
                with contextlib.suppress(ClientError):
                    await self.request("lease.release")

    async def _renew(self, lease: AsyncLease) -> None:
        while True:
            await asyncio.sleep(lease.period_s)
            if lease.lost:
                return
            sent_ns = time.monotonic_ns()
            try:
                await self._run(self._renewal(lease))
            except ClientError as error:
                lease.failed(error)
            else:
                lease.renewed(sent_ns)

    async def __aenter__(self) -> AsyncGripClient:
        self._bell = Bell(self._link.socket)
        self._turn = asyncio.Lock()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bell.stop()
        self._link.close()

    async def _run(self, steps: Steps) -> Result:
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
                    await self._bell.wait(zmq.POLLIN, until)
                elif (result := self._asking.result(envelope, frames)) is not None:
                    return result
            raise self._asking.unanswered(timeout_s)

    async def _send(self, ask: Ask, until: float) -> Envelope:
        while True:
            envelope = self._asking.pack(ask)
            try:
                self._link.socket.send(envelope.data, zmq.NOBLOCK)
            except zmq.Again:
                if time.monotonic() >= until:
                    raise self._asking.unheard() from None
                await self._bell.wait(zmq.POLLOUT, until)
            else:
                return envelope
