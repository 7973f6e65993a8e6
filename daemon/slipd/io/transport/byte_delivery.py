"""Deliver bytes to a consumer until the connection ends, and keep the reason: shared by all connections."""

from __future__ import annotations

import asyncio
import select

from slipd.io.transport.link import OnBytes

READ_BYTES = 1024
"""Bytes delivered before other tasks of the loop run: about 30 readings of a force sensor, or 1 to 2 ms of processing.
pyserial-asyncio reads as many at once."""


def is_readable(fileno: int) -> bool:
    """Return whether a descriptor has bytes to read."""
    poll = select.poll()
    poll.register(fileno, select.POLLIN)
    return any(event & select.POLLIN for _, event in poll.poll(0))


class ByteDelivery:
    """Deliver the bytes of one connection to its consumer.

    Args:
        on_bytes: The consumer.
    """

    def __init__(self, on_bytes: OnBytes) -> None:
        self._on_bytes = on_bytes
        self._lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    @property
    def ended(self) -> bool:
        """Whether the connection has ended."""
        return self._lost.done()

    def deliver(self, data: bytes) -> bool:
        """Pass bytes to the consumer; return False if the connection has ended, or ends with this.

        An exception of the consumer is raised by `until_lost`: asyncio would only log it if this callback raised it.
        """
        if self._lost.done():
            return False
        try:
            self._on_bytes(data)
        except Exception as error:
            self._lost.set_exception(error)
            return False
        return True

    def lose(self, reason: str) -> None:
        """End the connection with a reason for people; only the first call counts."""
        if not self._lost.done():
            self._lost.set_result(reason)

    async def until_lost(self) -> str:
        """Wait for the end of the connection and return the reason, or raise the exception of the consumer."""
        return await asyncio.shield(self._lost)  # cancelling the caller must not cancel the future
