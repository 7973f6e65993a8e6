"""Accept the peers of one endpoint, up to a limit, keep track of them until they leave, and show progress."""

from __future__ import annotations

import asyncio
import logging
import resource
import select
import socket
import struct
import time
from typing import Self

from slipd.io.zmtp.connection import Connection, PeerRules
from slipd.io.zmtp.endpoint import USER_ALONE, Access, bind, greets, is_ready, release, set_tcp_options
from slipd.io.zmtp.mechanisms import Curve, Null
from slipd.io.zmtp.peer import SHARE, Peer, TimeAccount, TimeAccounts
from slipd.io.zmtp.wire import ProtocolError

MAX_CONNECTIONS = 256
"""Most connections of one endpoint: several times the clients of a robot cell."""

RESERVE = 64
"""File descriptors reserved for the ports, files and sockets of the daemon itself, with a margin."""

SHARE_OF_ONE = 0.5
"""Largest share of the connections of an endpoint for one account."""

ACCEPTED_PER_WAKE = 4
"""Connections accepted before other tasks of the loop run."""

HANDSHAKE_S = 2.0
"""Longest handshake, s; then the connection is dropped, which frees its descriptor."""

LINGER_S = 0.1
"""Longest wait for the last messages before a stop, s; a stalled peer delays the exit by no more."""

_TOO_SLOW = "it had not completed its handshake when another connection needed its place"
_TOO_MANY = "it has the most connections that one peer may have"
_RETRY_S = 0.1
_CREDENTIALS = struct.Struct("3i")

_log = logging.getLogger(__name__)


def raise_descriptor_limit() -> None:
    """Raise the limit of open files to the hard limit; the soft one is meant for programs that use select()."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:  # if they are equal, a service may be forbidden to set them
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def most_connections() -> int:
    """Return how many connections one endpoint may have under the present limit of file descriptors.

    This is a quarter of the descriptors beyond the reserve: there are two endpoints, and half stays free.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(1, min(MAX_CONNECTIONS, (limit - RESERVE) // 4))


class Listener:
    """Serve one endpoint on the running loop, for the duration of ``with``; subclasses say what a peer may do.

    Args:
        endpoint: See `slipd.io.zmtp.endpoint.bind`, which is called on entry and raises LinkError.
        rules: Limits for each peer.
        access: Who may connect.
        share: Long-term share of the loop time for one account.

    Attributes:
        endpoint: Endpoint for clients, once served.
        peers: Peers that completed their handshake.
        accepted: Number of connections accepted.
        refused: Number of connections that this side ended, for any reason.
    """

    def __init__(self, endpoint: str, rules: PeerRules, access: Access = USER_ALONE, share: float = SHARE) -> None:
        self.endpoint = endpoint
        self.peers: dict[Peer, None] = {}
        self.accepted = 0
        self.refused = 0
        self._rules, self._access = rules, access
        self._accounts = TimeAccounts(share)
        self._pacing = TimeAccount(b"", share)
        self._pending: dict[Peer, asyncio.TimerHandle] = {}
        self._accepted_before = 0
        self._unsent: dict[Peer, int] = {}

    def on_ready(self, peer: Peer) -> None:
        """Handle a peer after its handshake; a `ProtocolError` ends the connection."""

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        """Handle a message; a `ProtocolError` ends the connection."""

    def on_close(self, peer: Peer) -> None:
        """Handle the end of a peer that was ready."""

    def __enter__(self) -> Self:
        self._loop = asyncio.get_running_loop()
        self._socket, self.endpoint = bind(self.endpoint, self._access)
        self._most = most_connections()
        self._most_of_one = max(1, int(self._most * SHARE_OF_ONE))
        self._over = False
        self._listen()
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self._stop_listening()
        release(self._socket, self.endpoint)
        _flush(list(self.peers))
        for peer in [*self.peers, *self._pending]:
            peer.close()

    @property
    def full(self) -> bool:
        """Whether new connections must wait, because peers that completed their handshake have all places."""
        return len(self.peers) >= self._most

    async def stall(self, patience_s: float) -> str:
        """Return why there was no progress since the last call; "" if there was.

        Progress is a new connection that is greeted, and messages that are sent to peers that read.

        Args:
            patience_s: Longest wait for the greeting, s.
        """
        greeted = self.full or await greets(self.endpoint, patience_s)
        before, self._accepted_before = self._accepted_before, self.accepted
        if not greeted and self.accepted == before:
            return f"{self.endpoint} greets no client"
        unsent_before = self._unsent
        self._unsent = {
            peer: peer.sent_bytes
            for peer in self.peers
            if peer.protocol.waiting and is_ready(peer.fileno, select.POLLOUT)
        }
        stalled = sum(unsent_before.get(peer) == sent for peer, sent in self._unsent.items())
        return f"{self.endpoint} does not send to clients that read ({stalled})" if stalled else ""

    def _listen(self) -> None:
        if not self._over and not self.full:
            self._loop.add_reader(self._socket, self._accept)

    def _stop_listening(self) -> None:
        self._loop.remove_reader(self._socket)

    def _accept(self) -> None:
        """Accept some waiting connections, if there are places and time for them."""
        begin_s = time.monotonic()
        if not self._pacing.has_time(begin_s):
            self._stop_listening()
            self._pacing.wait(self._listen)
            return
        try:
            for _ in range(ACCEPTED_PER_WAKE):
                if self.full:
                    self._stop_listening()
                    return
                connection, address = self._socket.accept()
                self._welcome(connection, address)
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError:  # no descriptor is left
            self._stop_listening()
            self._loop.call_later(_RETRY_S, self._listen)
        finally:
            self._pacing.charge(time.monotonic() - begin_s)

    def _welcome(self, connection: socket.socket, address: object) -> None:
        self.accepted += 1
        connection.setblocking(False)
        if isinstance(address, tuple):
            set_tcp_options(connection)
            name = str(address[0]).encode()
        else:
            process, user, group = _CREDENTIALS.unpack(
                connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            )
            name = b":%d:%d:%d" % (user, group, process)
        account = self._accounts.of(name)
        if not self._make_room(account):
            connection.close()
            self._log_end(name, _TOO_MANY)
            return
        kind, secret = self._rules.kind, self._access.secret
        mechanism = Null(kind) if secret is None else Curve(kind, secret, self._access.keys)
        protocol, wake = Connection(mechanism, self._rules), self._rules.messages_per_wake
        peer = Peer(connection, name, account, protocol, wake, self._admit, self.on_message, self._forget)
        if not peer.closed:
            self._pending[peer] = self._loop.call_later(HANDSHAKE_S, peer.close, "the handshake took too long")

    def _make_room(self, account: TimeAccount) -> bool:
        """End the oldest connection without a complete handshake if a new one needs its place.

        So connections that never send anything keep nobody out.

        Args:
            account: Account of the new connection; if it has all of its places, the oldest of its own ends.

        Returns:
            Whether there is a place.
        """
        if len(account.slots) >= self._most_of_one:
            oldest = next((peer for peer in self._pending if peer.account is account), None)
        elif len(self.peers) + len(self._pending) >= self._most:
            oldest = next(iter(self._pending), None)
        else:
            return True
        if oldest is not None:
            oldest.close(_TOO_SLOW)
        return oldest is not None

    def _admit(self, peer: Peer) -> None:
        if peer.protocol.key:
            account = self._accounts.of(peer.protocol.key)
            if len(account.slots) >= self._most_of_one:
                raise ProtocolError(_TOO_MANY)
            peer.move(account)
        self.on_ready(peer)
        self._pending.pop(peer).cancel()
        self.peers[peer] = None

    def _forget(self, peer: Peer) -> None:
        if peer in self._pending:
            self._pending.pop(peer).cancel()
        if peer.reason:
            self._log_end(peer.protocol.key or peer.address, peer.reason)
        if peer in self.peers:
            del self.peers[peer]
            self.on_close(peer)
        self._listen()

    def _log_end(self, name: bytes, reason: str) -> None:
        """Log why a connection was ended; the log limits how often."""
        self.refused += 1
        who = name.decode(errors="replace")
        _log.warning("%s: connection of %s ended: %s (%d so far)", self.endpoint, who, reason, self.refused)


def _flush(peers: list[Peer]) -> None:
    """Send queued messages to the peers, for at most LINGER_S."""
    until_s = time.monotonic() + LINGER_S
    while (waiting := {peer.fileno: peer for peer in peers if peer.protocol.waiting and not peer.closed}) and (
        left_s := until_s - time.monotonic()
    ) > 0.0:
        poll = select.poll()
        for descriptor in waiting:
            poll.register(descriptor, select.POLLOUT)
        for descriptor, _ in poll.poll(1e3 * left_s):
            waiting[descriptor].flush()
