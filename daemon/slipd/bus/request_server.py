"""Takes requests and sends replies, whatever else a client may send, and however much of it.

A client chooses the name under which it is known, and may choose that of another. So the daemon knows a client by what
it cannot choose as well: its key, or the process at the other end of an ipc connection. Who asks too often is told so,
and who does not heed it is disconnected; to connect again brings no new allowance.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Container
from types import TracebackType
from typing import Any

from slipd.bus.rate_limit import RateLimit
from slipd.publish.replies import error_body
from slipd.refusal import Refusal
from slipd.requests.idempotency import URGENT_OPS
from slipd.zmtp.endpoint import USER_ALONE, Access
from slipd.zmtp.listener import Listener
from slipd.zmtp.peer import Peer, PeerRules
from slipd.zmtp.time_accounts import SHARE
from slipd.zmtp.wire import ProtocolError
from slipd_client.messages import REQUEST_LIMITS, MessageError, decode, encode

MOST_QUEUED = 100
"""Replies kept for one client that does not read them; the rest are dropped."""

PER_SECOND = 50.0
"""Requests that one client may send a second: a lease renewed, gravity told for two fingers, and room for steering."""

REQUEST_S = 100e-6
"""Upper estimate of the loop's time for one request, s."""

MOST_SHARE = 0.5
"""Largest share of the loop's time for one client, however many requests the config allows it."""

_BETWEEN = b"\0"
"""Stands between what a client cannot choose and its route; the first holds none."""

_RULES = PeerRules(
    kind=b"ROUTER",
    serves=frozenset({b"DEALER", b"REQ", b"ROUTER"}),
    max_bytes=REQUEST_LIMITS.data_bytes,  # who sends more is disconnected
    max_frames=2,  # of a REQ
    most_queued=MOST_QUEUED,
)


class RequestServer:
    """Hands on well-formed requests and refuses everything else by itself.

    Serves from ``with`` to its end, on the running loop. Nothing that a client sends raises.

    Args:
        endpoint: As for `slipd.zmtp.endpoint.bind`, which is called on entry and refuses a wrong one.
        on_request: Called with the client, to reply to, and the request's map. A client is one connection: its key
            (where keys are asked for) or else the address of its process, and the route that it chose.
        access: How clients are let in.
        requesters: Keys that may request, among those that are let in; None: all may.
        per_second: Requests that one client may send a second: a key, or a connection where no keys are asked for. A
            connection that takes the place of another of the same process goes on with what that one left.

    Attributes:
        endpoint: As clients reach it, once served.
        malformed: Requests refused here because of what they are.
        busy: Requests refused because they were too many.
        unanswered: Those of them without any answer; each ended its client's connection.
        undelivered: Replies to clients that were gone or did not read.
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
        self.endpoint = endpoint
        self.malformed = 0
        self.busy = 0
        self.unanswered = 0
        self.undelivered = 0
        self._on_request = on_request
        self._requesters = requesters
        self._clients: dict[bytes, Peer] = {}
        self._names: dict[Peer, bytes] = {}
        self._unnamed = itertools.count(1)
        self._limit = RateLimit(per_second)
        self._urgent = RateLimit(per_second)  # for what must pass where the other is used up
        self._refusals = RateLimit(per_second)
        self._listener = Listener(
            endpoint,
            _RULES,
            self._on_message,
            access,
            on_ready=self._on_ready,
            on_close=self._on_close,
            share=min(MOST_SHARE, max(SHARE, per_second * REQUEST_S)),
        )

    def __enter__(self) -> RequestServer:
        self._listener.__enter__()
        self.endpoint = self._listener.endpoint
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listener.__exit__(kind, error, trace)

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        """Send a reply; that the client is gone or does not read is counted, no error."""
        peer = self._clients.get(client)
        if peer is None or not peer.send((*_envelope(peer), encode(body))):
            self.undelivered += 1

    def _on_ready(self, peer: Peer) -> None:
        """Name a client; of two connections with the same name only the first is served."""
        route = peer.route or b"\0" + next(self._unnamed).to_bytes(4, "big")
        client = (peer.key or peer.address) + _BETWEEN + route
        known = self._clients.get(client)
        if known is not None and not known.is_gone():
            raise ProtocolError("another connection of this client has the same name")
        self._clients[client] = peer
        self._names[peer] = client

    def _on_close(self, peer: Peer) -> None:
        del self._clients[self._names.pop(peer)]

    def _on_message(self, peer: Peer, frames: list[bytes]) -> None:
        client = self._names[peer]
        try:
            body = _decode(frames, _envelope(peer))
        except MessageError as error:
            if self._in_time(peer, None):
                self.malformed += 1
            self._reply_error(client, None, error)
            return
        if not self._in_time(peer, body.get("op")):
            self._reply_error(client, body.get("id"), MessageError("busy", "too many requests; ask more slowly"))
        elif self._requesters is not None and peer.key not in self._requesters:
            reason = "this key may read; ask with one that the daemon's bus.requesters holds"
            self._reply_error(client, body.get("id"), MessageError("read_only", reason))
        else:
            self._on_request(client, body)

    def _in_time(self, peer: Peer, op: object) -> bool:
        """Return whether a client may ask this now.

        Raises:
            ProtocolError: It was told often enough that it asks too often.
        """
        account = peer.key or b"%b#%d" % (peer.account.name, peer.slot)
        now_ns = time.monotonic_ns()
        if self._limit.allows(account, now_ns):
            return True
        if isinstance(op, str) and op in URGENT_OPS and self._urgent.allows(account, now_ns):
            return True
        self.busy += 1
        if not self._refusals.allows(account, now_ns):
            self.unanswered += 1
            raise ProtocolError("it asks too often, and goes on after it was told so")
        return False

    def _reply_error(self, client: bytes, number: object, error: MessageError) -> None:
        self.reply(client, error_body(number, Refusal(error.code, error.message, error.field)))


def _envelope(peer: Peer) -> tuple[bytes, ...]:
    """Return the frames that stand before a request and its reply: a REQ puts an empty one there, and expects it."""
    return (b"",) if peer.kind == b"REQ" else ()


def _decode(frames: list[bytes], envelope: tuple[bytes, ...]) -> dict[str, Any]:
    if not frames or tuple(frames[:-1]) != envelope:
        raise MessageError("malformed", "a request is one frame, as a DEALER sends it")
    return decode(frames[-1])
