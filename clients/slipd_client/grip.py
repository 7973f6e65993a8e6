"""The blocking client for requests: nothing is ever carried out late, twice, or by a daemon that started later."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

from slipd_client.client_base import GripClientBase
from slipd_client.errors import ClientError, NoAnswer
from slipd_client.lease_keeper import LEASE_MS, LeaseKeeper
from slipd_client.request_protocol import TIMEOUT_S, Ask, Envelope, Result, Steps

if TYPE_CHECKING:
    from slipd_client.keys import Keys

T = TypeVar("T")


class Lease(LeaseKeeper):
    """A lease while its block runs. `GripClient.lease` creates it."""

    def __init__(self, ttl_ms: int, sent_ns: int, owner: str) -> None:
        super().__init__(ttl_ms, sent_ns, owner)
        self._ended = threading.Event()

    def wait(self, seconds: float) -> None:
        """Let time pass while holding the lease.

        Raises:
            LeaseLost: At once when it is lost.
        """
        self._ended.wait(seconds)
        self.check()

    def lose(self, why: str) -> None:
        """Mark it as lost; the first reason stays."""
        super().lose(why)
        self._ended.set()


class GripClient(GripClientBase):
    """The blocking client, best used in a ``with`` statement; methods and arguments are those of `GripClientBase`.

    One request at a time: several threads may share it and wait for each other, but only the one that acquired the
    lease moves the gripper.
    """

    def __init__(self, endpoint: str | None = None, *, keys: Keys | None = None, timeout_s: float = TIMEOUT_S) -> None:
        super().__init__(endpoint, keys=keys, timeout_s=timeout_s)
        self._turn = threading.Lock()  # also the memory barrier that ZeroMQ needs where a socket changes its thread

    @contextlib.contextmanager
    def lease(self, ttl_ms: int = LEASE_MS) -> Iterator[Lease]:
        """Hold the right to move the gripper while the block runs; a thread renews it in the background.

        Neither giving the lease back nor losing it moves anything. The lease of a program that dies ends within
        ``ttl_ms``, as does that of a thread that has ended; a program that hangs within the block keeps it.

        Raises:
            LeaseInUse: This client has a lease already, of this thread or another one.
        """
        lease = Lease(ttl_ms, time.monotonic_ns(), f"thread {threading.current_thread().name!r}")
        self._claim(lease)
        try:
            self._run(self._protocol.lease("lease.acquire", {"ttl_ms": ttl_ms}))
            lease.note_renewal(self._protocol.lease_asked_ns)
            ended = threading.Event()
            work = (lease, ended, threading.current_thread())
            renewer = threading.Thread(target=self._renew, args=work, name="slipd-lease", daemon=True)
            renewer.start()
            lease.enter()
            try:
                yield lease
            finally:
                lease.leave()
                ended.set()
                renewer.join()
                if not lease.lost:
                    with contextlib.suppress(ClientError):
                        self._run(self._protocol.lease("lease.release", {}))
        finally:
            self._unclaim()

    def _renew(self, lease: Lease, ended: threading.Event, owner: threading.Thread) -> None:
        while not ended.wait(lease.period_s) and owner.is_alive() and not lease.lost:
            try:
                self._run(self._renewal(lease))
            except ClientError as error:
                lease.note_failure(error)

    def disconnect(self) -> None:
        """Close the connection; a second call does nothing. A lease ends with it, and the gripper keeps its force."""
        if self._lease is not None:
            self._lease.lose("the connection was closed")
        with self._turn:
            self._link.close()

    def __enter__(self) -> GripClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.disconnect()

    def _run(self, steps: Steps[T]) -> T:
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
                if (result := self._protocol.result(envelope, frames)) is not None:
                    return result
            raise self._protocol.no_reply(timeout_s)
        finally:
            self._turn.release()

    def _send(self, ask: Ask, until: float) -> Envelope:
        while True:
            envelope = self._protocol.pack(ask)
            if self._link.send(envelope.data):
                return envelope
            if not self._link.wait_writable(until):
                raise self._protocol.no_listener()
