"""Keeps account of one lease: until when it lasts, whether it is lost, and who may use it.

A lease counts as lost here earlier than the daemon ends it, never later.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any

from slipd_client.errors import LeaseInUse, LeaseLost
from slipd_client.messages.ops import URGENT_OPS, lease_rule

LEASE_MS = 200
"""Life of a lease without renewal: the daemon ends the lease of a dead program after this time."""

RENEWALS = 3
"""Renewals within the life of a lease: two may come late before it ends."""

ONE_CLIENT_EACH = "each thread or task that moves the gripper needs a client of its own"

_HELD: ContextVar[tuple[LeaseKeeper, ...]] = ContextVar("slipd_leases", default=())
"""Leases of the thread or task that reads it, of whatever client; tasks inherit those of the task that creates them."""


def check_held() -> None:
    """Do nothing while the calling thread or task holds every lease that it acquired.

    Raises:
        LeaseLost: One of them is lost.
    """
    for lease in _HELD.get():
        lease.check()


def held_until() -> float:
    """Return when a lease of the calling thread or task may be lost next, on ``time.monotonic``; infinity without one.

    That is its end, or its next renewal, which the daemon may refuse.
    """
    return time.monotonic() + min((min(each.left_s, each.period_s) for each in _HELD.get()), default=math.inf)


class LeaseKeeper:
    """One lease from its acquisition to the end of its block.

    It belongs to the thread or task that acquired it, and to the tasks that these create within the block.

    Args:
        ttl_ms: Life of the lease without renewal.
        sent_ns: When it was requested, CLOCK_MONOTONIC. The daemon counts from the arrival, so it ends the lease later.
        owner: Name of the thread or task, for errors.

    Attributes:
        sent_ns: When the newest request that the daemon confirmed was sent.
    """

    _event: Callable[[], Any] = threading.Event
    """Makes the event on which the block waits for the loss."""

    def __init__(self, ttl_ms: int, sent_ns: int, owner: str) -> None:
        self.owner = owner
        self._ended = self._event()
        self._ttl_ns = ttl_ms * 1_000_000
        self.sent_ns = sent_ns
        self._why = ""

    @property
    def lost(self) -> bool:
        """The lease has ended, or may have ended: the next call that moves the gripper raises. It stays lost."""
        if self.left_s <= 0:
            self.lose("it was not renewed in time, because this program, the daemon or the connection was stalled")
        return self._why != ""

    @property
    def why(self) -> str:
        """Why it was lost; "" while it is not."""
        return self._why if self.lost else ""

    @property
    def left_s(self) -> float:
        """Time that it lasts without a further renewal, s."""
        return (self.sent_ns + self._ttl_ns - time.monotonic_ns()) * 1e-9

    @property
    def period_s(self) -> float:
        """Time between two renewals, s."""
        return self._ttl_ns * 1e-9 / RENEWALS

    def lose(self, why: str) -> None:
        """Mark it as lost; the first reason stays."""
        self._why = self._why or why
        self._ended.set()

    def check(self) -> None:
        """Do nothing while the lease is held.

        Raises:
            LeaseLost: It is lost.
        """
        if self.lost:
            raise LeaseLost(f"the lease is lost, and the gripper keeps its force: {self._why}")

    def check_op(self, op: str) -> None:
        """Do nothing where the calling thread or task may send ``op`` on the connection that holds this lease.

        An op that keeps a grip as it is or makes it safer (``grip.hold``, ``gripper.stop``, ``lease.renew``) may come
        from any of them.

        Raises:
            LeaseInUse: The op is for the holder, and another thread or task holds the lease.
            LeaseLost: The op is for the holder, and the lease is lost.
        """
        rule = lease_rule(op)
        if rule != "anyone" and op not in URGENT_OPS and self not in _HELD.get():
            raise LeaseInUse(f"{op} was not sent: {self.owner} holds the lease of this client; {ONE_CLIENT_EACH}")
        if rule == "holder":
            self.check()

    @contextlib.contextmanager
    def entered(self) -> Iterator[None]:
        """Give the lease to the calling thread or task while the block runs."""
        _HELD.set((*_HELD.get(), self))
        try:
            yield
        finally:
            _HELD.set(tuple(held for held in _HELD.get() if held is not self))
