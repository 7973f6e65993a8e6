"""A local socket to which other processes push readings as a connection: each message is handed on as one piece.

For labs whose own driver holds the port of a sensor.
"""

from __future__ import annotations

from pathlib import Path

from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.transport.byte_delivery import ByteDelivery
from slipd.transport.link import OnBytes
from slipd.zmtp.listener import Listener
from slipd.zmtp.peer import Peer, PeerRules

MAX_MESSAGE_BYTES = 64 * 1024
"""Longest message taken: over ten times one image of 1024 three-axis taxels in float32."""

MESSAGES_PER_WAKE = 8
"""Messages handed on before the rest of the loop has its turn: each is a reading, and so a decision."""

SHARE = 0.75
"""Of the loop's time that one pusher gets for long: readings are the main work, and only its own user pushes them."""

_RULES = PeerRules(
    kind=b"PULL", serves=frozenset({b"PUSH"}), max_bytes=MAX_MESSAGE_BYTES, messages_per_wake=MESSAGES_PER_WAKE
)


async def open_push_socket(spec: LinkSpec, on_bytes: OnBytes) -> PushConnection:
    """Bind the socket, for this process and its user alone.

    Raises:
        LinkError: Its directory does not exist, another program serves there, or it cannot be bound.
    """
    scheme, _, path = spec.address.partition("://")
    folder = Path(path).parent
    if scheme == "ipc" and not folder.is_dir():
        raise LinkError(f"{spec.address}: there is no directory {folder}; make it, or name one that exists")
    return PushConnection(spec.address, on_bytes)


class PushConnection:
    """A bound socket; see `slipd.transport.link.Connection` for what each method promises. It is never lost."""

    overruns = 0

    def __init__(self, endpoint: str, on_bytes: OnBytes) -> None:
        self._delivery = ByteDelivery(on_bytes)
        self._listener = Listener(endpoint, _RULES, self._take, share=SHARE)
        self._listener.__enter__()
        self.identity = self._listener.endpoint

    async def until_lost(self) -> str:
        """Raise what the consumer of the messages raised."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Refuse: who pushes does not listen."""
        del data
        return False

    async def close(self) -> None:
        """Close the socket at once; what was not read is lost."""
        self._listener.__exit__(None, None, None)

    def _take(self, _: Peer, frames: list[bytes]) -> None:
        for frame in frames:  # a message is one frame; of longer ones the first two are judged, each by itself
            self._delivery.deliver(frame)
