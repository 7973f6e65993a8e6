"""A local socket to which other processes push readings: each message is delivered as one piece of bytes.

For labs whose own driver holds the port of a sensor.
"""

from __future__ import annotations

from slipd.events import LinkSpec
from slipd.io.transport.byte_delivery import ByteDelivery
from slipd.io.transport.link import OnBytes
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import Peer

MAX_MESSAGE_BYTES = 64 * 1024
"""Longest message accepted: five times one image of 1024 three-axis taxels in float32."""

MESSAGES_PER_WAKE = 8
"""Messages delivered before other tasks of the loop run: each is a reading, and so a verdict."""

SHARE = 0.75
"""Largest long-term share of the loop time for one sender: readings are the main work, and only this user can push."""

_RULES = PeerRules(
    kind=b"PULL", serves=frozenset({b"PUSH"}), max_bytes=MAX_MESSAGE_BYTES, messages_per_wake=MESSAGES_PER_WAKE
)


async def open_push_socket(spec: LinkSpec, on_bytes: OnBytes) -> PushConnection:
    """Bind the socket for this user only.

    Raises:
        LinkError: Its directory does not exist, another program serves it, or it cannot be bound.
    """
    return PushConnection(spec.address, on_bytes).__enter__()


class PushConnection(Listener):
    """A bound socket, which is never lost; see `slipd.io.transport.link.Connection` for the contract of each method."""

    overruns = 0
    latency = ""

    def __init__(self, endpoint: str, on_bytes: OnBytes) -> None:
        super().__init__(endpoint, _RULES, share=SHARE)
        self.identity = endpoint
        self._delivery = ByteDelivery(on_bytes)

    async def until_lost(self) -> str:
        """Wait for ever, or raise the exception of the consumer."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Refuse: programs that push do not receive."""
        del data
        return False

    def unread(self) -> bool:
        """Return False: a sender is paused on purpose while it has used up its share of the loop."""
        return False

    async def close(self) -> None:
        """Close the socket at once; unread messages are lost."""
        self.__exit__()

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        """Deliver a message, which has one frame; of a longer one, the first two are treated as messages."""
        for frame in frames:
            self._delivery.deliver(frame)
