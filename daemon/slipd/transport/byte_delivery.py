"""Hands bytes on until a connection ends, and knows why it ended: what connections share that callbacks read."""

from __future__ import annotations

import asyncio

from slipd.transport.link import OnBytes

READ_BYTES = 1024
"""Bytes handed on before the rest of the loop has its turn: some 30 readings of a force sensor, 1 to 2 ms of decisions.
pyserial-asyncio reads as much at once."""


class ByteDelivery:
    """From a connection to its consumer.

    Args:
        on_bytes: The consumer.
    """

    def __init__(self, on_bytes: OnBytes) -> None:
        self._on_bytes = on_bytes
        self._lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    @property
    def ended(self) -> bool:
        """Nothing is to be handed on or written any more."""
        return self._lost.done()

    def deliver(self, data: bytes) -> bool:
        """Give bytes to the consumer; False when that ended the connection.

        What the consumer raises is kept for `until_lost`: out of a callback asyncio would only log it and go on.
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
        """End, with a reason for people; only the first counts."""
        if not self._lost.done():
            self._lost.set_result(reason)

    async def until_lost(self) -> str:
        """Return the reason when the connection has ended, or raise what the consumer raised."""
        return await asyncio.shield(self._lost)  # being cancelled is not being lost
