"""A local socket to which other processes push readings as a connection: each message is handed on as one piece.

For labs whose own driver holds the port of a sensor.
"""

from __future__ import annotations

from pathlib import Path

import zmq

from slipd.errors import LinkError
from slipd.pipeline.events import LinkSpec
from slipd.transport.delivery import Delivery
from slipd.transport.link import OnBytes
from slipd.zeromq.draining import Drain
from slipd.zeromq.endpoint import open_server

MAX_MESSAGE_BYTES = 64 * 1024
"""Longest message taken: over ten times one image of 1024 three-axis taxels in float32."""

MAX_WAITING = 64
"""Messages kept of a pusher that the daemon has not read: beyond it the pusher waits, or drops its own."""

MESSAGES_PER_WAKE = 8
"""Messages handed on before the rest of the loop has its turn: each is a reading, and so a decision."""


async def open_external(spec: LinkSpec, on_bytes: OnBytes) -> ExternalConnection:
    """Bind the socket, for this process and its user alone.

    Raises:
        LinkError: Its directory does not exist, another program serves there, or it cannot be bound.
    """
    scheme, _, path = spec.address.partition("://")
    folder = Path(path).parent
    if scheme == "ipc" and not folder.is_dir():
        raise LinkError(f"{spec.address}: there is no directory {folder}; make it, or name one that exists")
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    options: dict[int, int] = {zmq.MAXMSGSIZE: MAX_MESSAGE_BYTES, zmq.RCVHWM: MAX_WAITING}
    try:
        server, endpoint = open_server(context, zmq.PULL, spec.address, options)
    except LinkError:
        context.term()
        raise
    return ExternalConnection(context, server, endpoint, on_bytes)


class ExternalConnection:
    """A bound socket; see `slipd.transport.link.Connection` for what each method promises. It is never lost."""

    overruns = 0

    def __init__(
        self, context: zmq.Context[zmq.Socket[bytes]], server: zmq.Socket[bytes], endpoint: str, on_bytes: OnBytes
    ) -> None:
        self.identity = endpoint
        self._context, self._server = context, server
        self._delivery = Delivery(on_bytes)
        self._drain = Drain(server, self._take, max_frames=1, frames_per_wake=MESSAGES_PER_WAKE)
        self._drain.start()

    async def until_lost(self) -> str:
        """Raise what the consumer of the messages raised."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Refuse: who pushes does not listen."""
        del data
        return False

    async def close(self) -> None:
        """Close the socket at once; what was not read is lost."""
        self._drain.stop()
        self._context.destroy(linger=0)

    def _take(self, frames: list[bytes]) -> None:
        for frame in frames:  # a message is one frame; of longer ones the first two are judged, each by itself
            self._delivery.hand_on(frame)
