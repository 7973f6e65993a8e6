"""Accept the peers of one endpoint, up to a limit, and keep track of them until they leave."""

from __future__ import annotations

import asyncio
import logging
import resource
import select
import socket
import struct
import time
from collections.abc import Callable
from types import TracebackType

from slipd.zmtp.endpoint import USER_ALONE, Access, bind, release
from slipd.zmtp.mechanisms import Curve, Mechanism, Null
from slipd.zmtp.peer import Peer, PeerRules
from slipd.zmtp.time_accounts import SHARE, TimeAccount, TimeAccounts
from slipd.zmtp.wire import ProtocolError

MAX_CONNECTIONS = 256
"""Connections of one endpoint: several times what a cell has."""

RESERVE = 64
"""Descriptors that connections never get: the ports, files and sockets of the daemon itself, generously."""

SHARE_OF_ONE = 0.5
"""Of the connections of an endpoint, at most, that one account gets."""

ACCEPTED_PER_WAKE = 4
"""Connections accepted before the rest of the loop has its turn."""

HANDSHAKE_S = 2.0
"""Longest handshake; then the connection is dropped, which frees its descriptor."""

KEEPALIVE_S, KEEPALIVE_PROBES = 1, 2
"""After so much silence the kernel asks the other machine for a sign of life, so often, as long each."""

UNANSWERED_MS = 3000
"""The kernel ends a TCP connection whose peer acknowledges nothing, or reads nothing, for this long."""

LINGER_S = 0.2
"""How long the last messages before a stop may take to leave; a stalled peer delays the exit by no more."""

TELL_EVERY_S = 10.0
"""Shortest time between two log lines about ended connections, so that no peer can fill the disk."""

_TOO_SLOW = "it had not introduced itself when another needed its place"
_TOO_MANY = "it has as many connections as one peer may have"
_RETRY_S = 0.1
_CREDENTIALS = struct.Struct("3i")

_log = logging.getLogger(__name__)


def raise_descriptor_limit() -> None:
    """Let this process open as many files as its hard limit says; the soft one is for programs that use select()."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:  # where it is the same, a service may be forbidden to ask
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def most_connections() -> int:
    """Return how many connections one endpoint may have under the limit of descriptors in force.

    A quarter of what the reserve leaves: there are two endpoints, and as much again is left for whatever else comes.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(1, min(MAX_CONNECTIONS, (limit - RESERVE) // 4))


class Listener:
    """Serves one endpoint from ``with`` to its end, on the running loop.

    Args:
        endpoint: As for `slipd.zmtp.endpoint.bind`, which is called on entry and refuses a wrong one.
        rules: Limits for each peer.
        on_message: Called with each message and its peer.
        access: Who may connect.
        on_ready: Called with a peer that introduced itself; a `ProtocolError` that it raises ends the connection.
        on_close: Called with a peer that had introduced itself and is gone.
        share: Of the loop's time that one account gets for long.

    Attributes:
        endpoint: As clients reach it, once served.
        peers: Those that introduced themselves.
        refused: Connections ended by this side, for any reason.
    """

    def __init__(
        self,
        endpoint: str,
        rules: PeerRules,
        on_message: Callable[[Peer, list[bytes]], None],
        access: Access = USER_ALONE,
        *,
        on_ready: Callable[[Peer], None] = lambda _: None,
        on_close: Callable[[Peer], None] = lambda _: None,
        share: float = SHARE,
    ) -> None:
        self.endpoint = endpoint
        self.peers: dict[Peer, None] = {}
        self.refused = 0
        self._rules, self._access = rules, access
        self._on_message, self._on_ready, self._on_close = on_message, on_ready, on_close
        self._accounts = TimeAccounts(share)
        self._pending: dict[Peer, asyncio.TimerHandle] = {}
        self._accepting = False
        self._pacing = TimeAccount(b"", share)
        self._told_s = float("-inf")

    def __enter__(self) -> Listener:
        self._loop = asyncio.get_running_loop()
        self._socket, self.endpoint = bind(self.endpoint, self._access)
        self._most = most_connections()
        self._most_of_one = max(1, int(self._most * SHARE_OF_ONE))
        self._over = False
        self._listen()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over = True
        self._deafen()
        release(self._socket, self.endpoint)
        _flush(list(self.peers))
        for peer in [*self.peers, *self._pending]:
            peer.close()

    @property
    def full(self) -> bool:
        """Whether new connections are kept out: peers that introduced themselves have every place."""
        return len(self.peers) >= self._most

    def _listen(self) -> None:
        if not self._accepting and not self._over and not self.full:
            self._accepting = True
            self._loop.add_reader(self._socket, self._accept)

    def _deafen(self) -> None:
        if self._accepting:
            self._accepting = False
            self._loop.remove_reader(self._socket)

    def _accept(self) -> None:
        """Take some of those that wait, where there is a place for them, and a share of the time."""
        begin_s = time.monotonic()
        if not self._pacing.has_time(begin_s):
            self._deafen()
            self._pacing.wait(self._listen)
            return
        try:
            for _ in range(ACCEPTED_PER_WAKE):
                if self.full:
                    self._deafen()
                    return
                connection, address = self._socket.accept()
                self._welcome(connection, address)
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError:  # no descriptor is left
            self._deafen()
            self._loop.call_later(_RETRY_S, self._listen)
        finally:
            self._pacing.charge(time.monotonic() - begin_s)

    def _welcome(self, connection: socket.socket, address: object) -> None:
        connection.setblocking(False)
        if isinstance(address, tuple):
            _set_tcp_options(connection)
            name = str(address[0]).encode()
        else:
            process, user, group = _CREDENTIALS.unpack(
                connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            )
            name = b":%d:%d:%d" % (user, group, process)
        account = self._accounts.of(name)
        if not self._make_room(account):
            connection.close()
            self._tell(name, _TOO_MANY)
            return
        peer = Peer(
            connection, name, account, self._mechanism(), self._rules, self._admit, self._on_message, self._forget
        )
        if not peer.closed:
            self._pending[peer] = self._loop.call_later(HANDSHAKE_S, peer.close, "the handshake took too long")

    def _make_room(self, account: TimeAccount) -> bool:
        """End the oldest connection that has not introduced itself where a new one needs its place.

        So whoever connects and never says a word keeps nobody out.

        Args:
            account: Of the new connection; where it has all of its places, the oldest of its own ends.

        Returns:
            Whether there is a place.
        """
        if account.connections >= self._most_of_one:
            oldest = next((peer for peer in self._pending if peer.account is account), None)
        elif len(self.peers) + len(self._pending) >= self._most:
            oldest = next(iter(self._pending), None)
        else:
            return True
        if oldest is not None:
            oldest.close(_TOO_SLOW)
        return oldest is not None

    def _mechanism(self) -> Mechanism:
        secret = self._access.secret
        if secret is None:
            return Null(self._rules.kind)
        return Curve(self._rules.kind, secret, self._access.admits)

    def _admit(self, peer: Peer) -> None:
        if peer.key:
            account = self._accounts.of(peer.key)
            if account.connections >= self._most_of_one:
                raise ProtocolError(_TOO_MANY)
            peer.move(account)
        self._on_ready(peer)
        self._pending.pop(peer).cancel()
        self.peers[peer] = None

    def _forget(self, peer: Peer) -> None:
        timer = self._pending.pop(peer, None)
        if timer is not None:
            timer.cancel()
        if peer.reason:
            self._tell(peer.key or peer.address, peer.reason)
        if self.peers.pop(peer, peer) is None:
            self._on_close(peer)
        self._listen()

    def _tell(self, name: bytes, reason: str) -> None:
        """Log why a connection was ended, at a limited rate."""
        self.refused += 1
        now_s = time.monotonic()
        if now_s - self._told_s >= TELL_EVERY_S:
            self._told_s = now_s
            who = name.decode(errors="replace")
            _log.warning("%s: connection of %s ended: %s (%d so far)", self.endpoint, who, reason, self.refused)


def _set_tcp_options(connection: socket.socket) -> None:
    for option, value in (
        (socket.TCP_NODELAY, 1),
        (socket.TCP_KEEPIDLE, KEEPALIVE_S),
        (socket.TCP_KEEPINTVL, KEEPALIVE_S),
        (socket.TCP_KEEPCNT, KEEPALIVE_PROBES),
        (socket.TCP_USER_TIMEOUT, UNANSWERED_MS),
    ):
        connection.setsockopt(socket.IPPROTO_TCP, option, value)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)


def _flush(peers: list[Peer]) -> None:
    """Send the peers what waits for them, for a moment at the end."""
    until_s = time.monotonic() + LINGER_S
    while (waiting := {peer.fileno: peer for peer in peers if peer.waiting and not peer.closed}) and (
        left_s := until_s - time.monotonic()
    ) > 0.0:
        poll = select.poll()
        for descriptor in waiting:
            poll.register(descriptor, select.POLLOUT)
        for descriptor, _ in poll.poll(1e3 * left_s):
            waiting[descriptor].flush()
