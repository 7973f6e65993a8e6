"""Asks the daemon to act, so that nothing is ever done late, twice, or by a daemon that started later."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING

import zmq

from slipd_client.asking import TIMEOUT_S, Ask, Envelope, Result, Steps
from slipd_client.errors import ClientError, NoAnswer
from slipd_client.holding import LEASE_MS, Holding
from slipd_client.ops import Ops

if TYPE_CHECKING:
    from slipd_client.keys import Keys


class Lease(Holding):
    """A lease while its block runs. `GripClient.lease` makes it."""

    def __init__(self, ttl_ms: int, sent_ns: int) -> None:
        super().__init__(ttl_ms, sent_ns)
        self._gone = threading.Event()

    def wait(self, seconds: float) -> None:
        """Let time pass while holding it.

        Raises:
            LeaseLost: At once when it is lost.
        """
        self._gone.wait(seconds)
        self.check()

    def lose(self, why: str) -> None:
        """It is lost; the first reason stays."""
        super().lose(why)
        self._gone.set()


class GripClient(Ops[Result]):
    """The blocking client, best used in a ``with``; its methods and arguments are those of `Ops`.

    One request at a time: several threads may share it, and wait for each other.
    """

    def __init__(self, endpoint: str | None = None, *, keys: Keys | None = None, timeout_s: float = TIMEOUT_S) -> None:
        super().__init__(endpoint, keys=keys, timeout_s=timeout_s)
        self._turn = threading.Lock()  # also the memory barrier that ZeroMQ wants where a socket changes its thread

    @contextlib.contextmanager
    def lease(self, ttl_ms: int = LEASE_MS) -> Iterator[Lease]:
        """Hold the right to move the gripper while the block runs; a thread renews it in the background.

        Giving it back, or losing it, never moves anything. A lease whose program dies ends within ``ttl_ms``, as does
        one whose thread is no more; a program that hangs within the block keeps it.
        """
        sent_ns = self._may_acquire()
        self.request("lease.acquire", ttl_ms=ttl_ms)
        lease = self._holding = Lease(ttl_ms, sent_ns)
        ended = threading.Event()
        work = (lease, ended, threading.current_thread())
        renewer = threading.Thread(target=self._renew, args=work, name="slipd-lease", daemon=True)
        renewer.start()
        try:
            yield lease
        finally:
            ended.set()
            renewer.join()
            self._holding = None
            if not lease.lost:
                with contextlib.suppress(ClientError):
                    self.request("lease.release")

    def _renew(self, lease: Lease, ended: threading.Event, owner: threading.Thread) -> None:
        while not ended.wait(lease.period_s) and owner.is_alive() and not lease.lost:
            sent_ns = time.monotonic_ns()
            try:
                self._run(self._renewal(lease))
            except (ClientError, zmq.ZMQError) as error:  # ZMQError: the connection was closed within the block
                lease.failed(error)
            else:
                lease.renewed(sent_ns)

    def disconnect(self) -> None:
        """Close the connection; a second call does nothing. A lease ends with it, and the gripper keeps its force."""
        if self._holding is not None:
            self._holding.lose("the connection was closed")
        with self._turn:
            self._link.close()

    def __enter__(self) -> GripClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.disconnect()

    def _run(self, steps: Steps) -> Result:
        try:
            step = next(steps)
            while True:
                if isinstance(step, Ask):
                    try:
                        result = self._exchange(step)
                    except ClientError as error:
                        step = steps.throw(error)
                        continue
                else:
                    time.sleep(step.seconds)
                    result = {}
                step = steps.send(result)
        except StopIteration as done:
            return done.value  # type: ignore[no-any-return]

    def _exchange(self, ask: Ask) -> Result:
        timeout_s = self.timeout_s if ask.timeout_s is None else ask.timeout_s
        until = time.monotonic() + timeout_s
        if not self._turn.acquire(timeout=timeout_s):
            raise NoAnswer("another thread still waits for its reply; nothing was sent")
        try:
            envelope = self._send(ask, until)
            while (frames := self._link.receive(until)) is not None:
                if (result := self._asking.result(envelope, frames)) is not None:
                    return result
            raise self._asking.unanswered(timeout_s)
        finally:
            self._turn.release()

    def _send(self, ask: Ask, until: float) -> Envelope:
        while True:
            envelope = self._asking.pack(ask)
            try:
                self._link.socket.send(envelope.data, zmq.NOBLOCK)
            except zmq.Again:
                if not self._link.wait_writable(until):
                    raise self._asking.unheard() from None
            else:
                return envelope
