"""Whether a listener still does its work: it accepts and greets, and it sends what waits for peers that read."""

from __future__ import annotations

import asyncio
import select
import socket

from slipd.io.zmtp.endpoint import is_tcp
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import Peer


class ListenerProgress:
    """Look at a listener from time to time.

    Args:
        listener: The listener, once it serves.
    """

    def __init__(self, listener: Listener) -> None:
        self._listener = listener
        self._accepted = listener.accepted
        self._writable: dict[Peer, int] = {}

    async def stall(self, patience_s: float) -> str:
        """Return why there was no progress since the last call; "" if there was.

        Args:
            patience_s: Longest wait for the greeting, s.
        """
        listener = self._listener
        greeted = listener.full or await greets(listener.endpoint, patience_s)
        before, self._accepted = self._accepted, listener.accepted
        if not greeted and self._accepted == before:
            return f"{listener.endpoint} greets no client"
        if unsent := self._unsent():
            return f"messages are not sent to clients that read ({unsent})"
        return ""

    def _unsent(self) -> int:
        """Return the number of peers that could be sent to at both looks, and were not between them."""
        before, self._writable = self._writable, {}
        for peer in self._listener.peers:
            if peer.waiting and _writable(peer.fileno):
                self._writable[peer] = peer.sent_bytes
        return sum(before.get(peer) == sent for peer, sent in self._writable.items())


async def greets(endpoint: str, patience_s: float) -> bool:
    """Return whether an endpoint answers a new connection, with its greeting or by ending it."""
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET if is_tcp(endpoint) else socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        visitor.setblocking(False)
        try:
            async with asyncio.timeout(patience_s):
                await loop.sock_connect(visitor, _address(endpoint))
                await loop.sock_recv(visitor, 1)
        except ConnectionError:  # it was ended, which also takes a turn of the loop
            return True
        except (TimeoutError, OSError):  # OSError: the queue of connections is full
            return False
        return True


def _address(endpoint: str) -> str | tuple[str, int]:
    if not is_tcp(endpoint):
        return endpoint.removeprefix("ipc://")
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    return host, int(port)


def _writable(fileno: int) -> bool:
    poll = select.poll()
    poll.register(fileno, select.POLLOUT)
    return any(event & select.POLLOUT for _, event in poll.poll(0))
