"""The blocking client for requests: nothing is ever carried out late, twice, or by a daemon that started later."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

from slipd_client.client_base import GripClientBase
from slipd_client.errors import NoAnswer
from slipd_client.lease_keeper import LEASE_MS, LeaseKeeper
from slipd_client.link import Blocking


class Lease(LeaseKeeper):
    """A lease while its block runs. `GripClient.lease` creates it."""

    def wait(self, seconds: float) -> None:
        """Let time pass while holding the lease.

        Raises:
            LeaseLost: At once when it is lost.
        """
        self._ended.wait(seconds)
        self.check()


class GripClient(Blocking, GripClientBase):
    """The blocking client, best used in a ``with`` statement; methods and arguments are those of `GripClientBase`.

    One request at a time: several threads may share it and wait for each other, but only the one that acquired the
    lease moves the gripper.
    """

    _lock = threading.Lock  # also the memory barrier that ZeroMQ needs where a socket changes its thread

    @contextlib.contextmanager
    def lease(self, ttl_ms: int = LEASE_MS) -> Iterator[Lease]:
        """Hold the right to move the gripper while the block runs; a thread renews it in the background.

        Neither giving the lease back nor losing it moves anything. The lease of a program that dies ends within
        ``ttl_ms``, as does that of a thread that has ended; a program that hangs within the block keeps it.

        Raises:
            LeaseInUse: This client has a lease already, of this thread or another one.
        """
        lease = Lease(ttl_ms, time.monotonic_ns(), f"thread {threading.current_thread().name!r}")
        with self._claimed(lease):
            self._run(self._acquire(lease, ttl_ms))
            ended = threading.Event()
            work = (lease, ended, threading.current_thread())
            renewer = threading.Thread(target=self._renew, args=work, name="slipd-lease", daemon=True)
            renewer.start()
            try:
                with lease.entered():
                    yield lease
            finally:
                ended.set()
                renewer.join()
                self._run(self._give_back(lease))

    def _renew(self, lease: Lease, ended: threading.Event, owner: threading.Thread) -> None:
        while not ended.wait(lease.period_s) and owner.is_alive() and not lease.lost:
            self._run(self._renew_once(lease))

    def disconnect(self) -> None:
        """Close the connection; a second call does nothing. A lease ends with it, and the gripper keeps its force."""
        if self._lease is not None:
            self._lease.lose("the connection was closed")
        with self._turn:
            self._link.close()

    close = disconnect

    async def _take_turn(self, timeout_s: float) -> float:
        until = time.monotonic() + timeout_s
        if not self._turn.acquire(timeout=timeout_s):
            raise NoAnswer("the reply to another request of this client has not come yet; nothing was sent")
        return until

    async def _sleep(self, seconds: float) -> None:
        time.sleep(seconds)  # noqa: ASYNC251 - it blocks, as every wait of this client
