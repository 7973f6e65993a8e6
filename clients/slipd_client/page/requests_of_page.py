"""Carries out what people request on the page: the zero of a finger, and small changes of the grip force.

A request is that of any client of the daemon, and the daemon judges it by its rules. The page can ask for nothing else.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, TypedDict

from slipd_client.aio import AsyncGripClient
from slipd_client.errors import RequestRefused, SlipdClientError
from slipd_client.grip import GripClient

if TYPE_CHECKING:
    from slipd_client.keys import Keys

ADJUST_N = 1.0
"""Change of the grip force on one pad by one press of a button, N."""


class Reply(TypedDict):
    """What became of a request, for people.

    Attributes:
        ok: It was carried out.
        text: What was done; or the daemon's own words where it refused.
    """

    ok: bool
    text: str


def refused(text: str) -> Reply:
    """Return the reply to a request that was not carried out."""
    return {"ok": False, "text": text}


class PageRequests:
    """Sends the requests of the page to one daemon, each with a connection of its own.

    Args:
        endpoint: Where the daemon accepts requests; its default endpoint when None.
        keys: Keys of this client, for a daemon across a network; None on this machine.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint.
    """

    def __init__(self, endpoint: str | None, keys: Keys | None = None) -> None:
        self._endpoint = endpoint
        self._keys = keys
        GripClient(endpoint, keys=keys).disconnect()  # a wrong endpoint is an error now, not at the first request

    async def permission(self) -> str:
        """Return why the daemon accepts no request of this client; "" if it may accept some."""
        try:
            async with AsyncGripClient(self._endpoint, keys=self._keys) as client:
                await client.hello()
        except RequestRefused as refusal:
            return str(refusal)
        except SlipdClientError:
            return ""  # no daemon now: a request will say so
        return ""

    async def carry_out(self, text: str) -> Reply:
        """Carry out one request of a page, ``{"do": "tare", "finger": …}`` or ``{"do": "adjust", "delta_n": …}``."""
        try:
            asked = json.loads(text)
            kind, finger, delta_n = asked.get("do"), asked.get("finger"), asked.get("delta_n")
        except (ValueError, AttributeError, RecursionError):  # no JSON, no object, or thousands of "["
            return refused("the page sent no request that is understood")
        try:
            async with AsyncGripClient(self._endpoint, keys=self._keys) as client:
                if kind == "tare" and isinstance(finger, str):
                    return await _tare(client, finger)
                if kind == "adjust" and delta_n in (-ADJUST_N, ADJUST_N):
                    return await _adjust(client, delta_n)
        except SlipdClientError as error:
            return refused(str(error))
        return refused(f"the page may take a tare, and change the grip force by {ADJUST_N:g} N")


async def _tare(client: AsyncGripClient, finger: str) -> Reply:
    result = await client.tare(finger)
    sure = "" if result.verified else "; the daemon does not know whether anything touched the finger"
    taken = ", ".join(f"{stream} (tare {tare.tare_id})" for stream, tare in result.tares.items())
    return {"ok": True, "text": f"{finger}: zero taken of {taken}{sure}"}


async def _adjust(client: AsyncGripClient, delta_n: float) -> Reply:
    async with client.lease():
        result = await client.grip_adjust(delta_n)
    force = "an unknown force" if result.applied_n is None else f"{result.applied_n:.1f} N on each pad"
    return {"ok": True, "text": f"grip force {delta_n:+g} N: the gripper was sent {force}"}
