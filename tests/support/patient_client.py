"""A client for tests with a real daemon on a busy machine: what the daemon refused as too late is asked again."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

from daemon_peers import PATIENCE_S

from slipd_client.aio import AsyncGripClient, AsyncLease
from slipd_client.errors import LeaseLost, RequestRefused
from slipd_client.request_protocol import Ask, Result

T = TypeVar("T")


class PatientClient(AsyncGripClient):
    """The asyncio client; all else is refused, and raised, as it is by the daemon."""

    def __init__(self, endpoint: str) -> None:
        super().__init__(endpoint, timeout_s=PATIENCE_S)

    async def _exchange(self, ask: Ask) -> Result:
        async with asyncio.timeout(PATIENCE_S):
            while True:
                try:
                    return await super()._exchange(ask)
                except RequestRefused as refusal:
                    if refusal.code != "deadline_passed":
                        raise

    async def holding(self, work: Callable[[AsyncLease], Awaitable[T]]) -> T:
        """Return the result of work under a lease, which begins again where a stall of the machine ended the lease."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                try:
                    async with self.lease() as lease:
                        return await work(lease)
                except LeaseLost:
                    continue
                except RequestRefused as refusal:
                    if refusal.code != "no_lease":
                        raise
