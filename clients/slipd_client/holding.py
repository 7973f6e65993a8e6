"""When a lease is lost, as its holder must see it: sooner than the daemon, never later. Knows no thread or loop."""

from __future__ import annotations

import time

from slipd_client.errors import LeaseLost, RequestRefused

LEASE_MS = 200
"""How long a lease lasts without renewal: so long does the daemon believe that a dead program steers."""

RENEWALS = 3
"""Renewals within one life of a lease: two may come late before it ends."""


class Holding:
    """A lease from its acquisition on.

    Args:
        ttl_ms: Its life without renewal.
        sent_ns: When it was asked for, CLOCK_MONOTONIC: the daemon counts from later, so there it ends later.
    """

    def __init__(self, ttl_ms: int, sent_ns: int) -> None:
        self._ttl_ns = ttl_ms * 1_000_000
        self._sent_ns = sent_ns
        self._why = ""

    @property
    def lost(self) -> bool:
        """It has ended, or may have: another client may hold the gripper, and the next call that moves it raises.

        What was lost once stays so.
        """
        if self.left_s <= 0:
            self.lose("it was not renewed in time: this program or the daemon stood still, or the line between them")
        return self._why != ""

    @property
    def why(self) -> str:
        """Why it was lost; "" while it is not."""
        return self._why if self.lost else ""

    @property
    def left_s(self) -> float:
        """How long it lasts without a further renewal."""
        return (self._sent_ns + self._ttl_ns - time.monotonic_ns()) * 1e-9

    @property
    def period_s(self) -> float:
        """How often to renew it."""
        return self._ttl_ns * 1e-9 / RENEWALS

    def renewed(self, sent_ns: int) -> None:
        """The daemon has confirmed a renewal that was sent then."""
        self._sent_ns = sent_ns

    def failed(self, error: Exception) -> None:
        """A renewal failed: it is lost, unless the daemon only had too many requests and may be asked again."""
        if not (isinstance(error, RequestRefused) and error.code == "busy"):
            self.lose(str(error))

    def lose(self, why: str) -> None:
        """It is lost; the first reason stays."""
        self._why = self._why or why

    def check(self) -> None:
        """Do nothing while it is held.

        Raises:
            LeaseLost: It is lost.
        """
        if self.lost:
            raise LeaseLost(f"the lease is lost: {self._why}. Nothing was sent, and the gripper keeps its force")
