"""Receive requests and send replies; no client can disturb this, whatever it sends and however much.

A client chooses its own name, and could choose that of another client. So the daemon identifies it also by what it
cannot choose: its key, or its process on an ipc connection. A client that sends too many requests gets an error, and
one that continues is disconnected; a new connection brings no new allowance.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Container
from typing import Any

from slipd.io.rate_limit import RateLimit
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.endpoint import USER_ALONE, Access
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import SHARE, Peer
from slipd.io.zmtp.wire import ProtocolError
from slipd.publish.replies import error_body
from slipd.types.permit import Refusal
from slipd_client.messages import CHECK_LIMITS, MessageError, decode, encode, request_limits
from slipd_client.messages.ops import URGENT_OPS

MOST_QUEUED = 100
"""Replies queued for a client that does not read them; the rest are dropped."""

PER_SECOND = 50.0
"""Requests per second of one client: renewals of a lease, gravity of two fingers, and room for grip commands."""

REQUEST_S = 100e-6
"""Upper estimate of the loop time for one request, s."""

MOST_SHARE = 0.5
"""Largest share of the loop time for one client, for any number of requests that the config allows."""

_BETWEEN = b"\0"
"""Separates what a client cannot choose from its route; the former contains no such byte."""

_RULES = PeerRules(
    kind=b"ROUTER",
    serves=frozenset({b"DEALER", b"REQ", b"ROUTER"}),
    max_bytes=CHECK_LIMITS.data_bytes,  # a client that sends more is disconnected
    max_frames=2,  # from a REQ socket
    most_queued=MOST_QUEUED,
)


class RequestServer(Listener):
    """Pass on well-formed requests, and refuse everything else.

    No input of a client raises.

    Args:
        endpoint: See `slipd.io.zmtp.listener.Listener`.
        on_request: Called with the client, for the reply, and the map of the request. A client is one connection: its
            key or, without keys, the address of its process, and the route that it chose.
        access: Who may connect.
        requesters: Keys that may send requests, among those that may connect; None: all may.
        per_second: Requests per second of one client: of a key or, without keys, of a connection. A connection that
            replaces another of the same process inherits its allowance.
    """

    def __init__(
        self,
        endpoint: str,
        on_request: Callable[[bytes, dict[str, Any]], None],
        access: Access = USER_ALONE,
        *,
        requesters: Container[bytes] | None = None,
        per_second: float = PER_SECOND,
    ) -> None:
        super().__init__(endpoint, _RULES, access, min(MOST_SHARE, max(SHARE, per_second * REQUEST_S)))
        self._on_request = on_request
        self._requesters = requesters
        self._clients: dict[bytes, Peer] = {}
        self._names: dict[Peer, bytes] = {}
        self._unnamed = itertools.count(1)
        self._limit = RateLimit(per_second)
        self._urgent = RateLimit(per_second)  # for urgent requests when the other is used up
        self._refusals = RateLimit(per_second)

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        """Send a reply; that a client is gone or does not read is no error."""
        peer = self._clients.get(client)
        if peer is not None:
            peer.send((*_envelope(peer), encode(body)))

    def on_ready(self, peer: Peer) -> None:
        """Identify a client; of two connections with the same identity only the first is served."""
        route = peer.protocol.route or b"\0" + next(self._unnamed).to_bytes(4, "big")
        client = (peer.protocol.key or peer.address) + _BETWEEN + route
        known = self._clients.get(client)
        if known is not None and not known.is_gone():
            raise ProtocolError("another connection of this client has the same name")
        self._clients[client] = peer
        self._names[peer] = client

    def on_close(self, peer: Peer) -> None:
        """Forget a client."""
        del self._clients[self._names.pop(peer)]

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        """Pass on a request, or answer it with an error."""
        client = self._names[peer]
        try:
            body = _decode(frames, _envelope(peer))
        except MessageError as error:
            self._is_within_rate(peer, None)
            self._reply_error(client, error.number, error)
            return
        if not self._is_within_rate(peer, body.get("op")):
            self._reply_error(client, body.get("id"), MessageError("busy", "too many requests; send fewer per second"))
        elif self._requesters is not None and peer.protocol.key not in self._requesters:
            reason = "this key may only read; use a key from bus.requesters of the daemon"
            self._reply_error(client, body.get("id"), MessageError("read_only", reason))
        else:
            self._on_request(client, body)

    def _is_within_rate(self, peer: Peer, op: object) -> bool:
        """Return whether a client may send this request now, and count it.

        Raises:
            ProtocolError: It exceeded the rate too often.
        """
        account = peer.protocol.key or b"%b#%d" % (peer.account.name, peer.slot)
        now_ns = time.monotonic_ns()
        if self._limit.allows(account, now_ns):
            return True
        if isinstance(op, str) and op in URGENT_OPS and self._urgent.allows(account, now_ns):
            return True
        if not self._refusals.allows(account, now_ns):
            raise ProtocolError("it keeps sending too many requests after the error")
        return False

    def _reply_error(self, client: bytes, number: object, error: MessageError) -> None:
        self.reply(client, error_body(number, Refusal(error.code, error.message, error.field)))


def _envelope(peer: Peer) -> tuple[bytes, ...]:
    """Return the frames before a request and its reply: a REQ socket sends and expects an empty one."""
    return (b"",) if peer.protocol.kind == b"REQ" else ()


def _decode(frames: list[bytes], envelope: tuple[bytes, ...]) -> dict[str, Any]:
    if not frames or tuple(frames[:-1]) != envelope:
        raise MessageError("malformed", "a request must be one frame, as a DEALER socket sends it")
    return decode(frames[-1], request_limits(frames[-1]))
