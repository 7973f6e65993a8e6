"""Takes requests and sends replies, whatever else a client may send, and however much of it.

A client chooses the name under which ZeroMQ routes to it, and may choose that of another. So the daemon knows a client
by what it cannot choose as well: its key, or the process at the other end of an ipc connection. Who asks too often is
told so, and who does not heed it is disconnected.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Container
from types import TracebackType
from typing import Any

import zmq

from slipd.bus.rate_limit import RateLimit
from slipd.zeromq.draining import Drain
from slipd.zeromq.endpoint import USER_ALONE, Access, serving
from slipd.zeromq.gate import cut_off
from slipd_client.messages import PROTOCOL_VERSION, REQUEST_LIMITS, MessageError, decode, encode

RECEIVE_HWM = 10_000
"""Requests kept for one client, 160 MB at most. Who floods is disconnected long before; who meets the limit by being
quicker than that, and goes with a heartbeat of his own unread, may still abort ZeroMQ (`slipd.zeromq.endpoint`)."""

SEND_HWM = 100
"""Replies kept for one client that does not read them; the rest are dropped."""

PER_SECOND = 50.0
"""Requests that one client may send a second: a lease renewed, gravity told for two fingers, and room for steering."""

FRAMES_PER_WAKE, REST_S = 256, 0.002
"""A flood is read in gulps of 128 requests with rests between them: it gets a quarter of the loop at most."""

SEAL_BYTES = 33
"""By how much encryption lengthens a message (RFC 26: command name, nonce, authenticator and flags)."""

_FRAMES = 2
"""Route and request."""

_BETWEEN = b"\0"
"""Stands between what a client cannot choose and its route; the first holds none."""


class RequestServer:
    """Hands on well-formed requests and refuses everything else by itself.

    Serves from ``with`` to its end, on the running loop. Nothing that a client sends raises.

    Args:
        context: Owner of the socket; lives longer.
        endpoint: As for `slipd.zeromq.endpoint.open_server`, which says what is wrong with it on entry.
        on_request: Called with the client, to reply to, and the request's map. A client is one connection: its key
            (where keys are asked for) or else the address of its process, and the route that it chose.
        access: How clients are let in.
        requesters: Keys that may request, among those that are let in; None: all may.
        per_second: Requests that one client may send a second: a key, or a connection where no keys are asked for.

    Attributes:
        endpoint: As clients reach it, once served.
        malformed: Requests refused here because of what they are.
        busy: Requests refused because they were too many.
        unanswered: Those among them that were not even answered.
        undelivered: Replies to clients that were gone or did not read.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
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
        self._context = context
        self._on_request = on_request
        self._access = access
        self._requesters = requesters
        self._limit = RateLimit(per_second)
        self._refusals = RateLimit(per_second)
        self._cut_off = b""

    def __enter__(self) -> RequestServer:
        sealing = 0 if self._access.secret is None else SEAL_BYTES
        options: dict[int, int] = {
            zmq.MAXMSGSIZE: REQUEST_LIMITS.data_bytes + sealing,  # who sends more is disconnected
            zmq.RCVHWM: RECEIVE_HWM,
            zmq.SNDHWM: SEND_HWM,
            zmq.ROUTER_MANDATORY: 1,  # a reply that cannot be delivered is counted, not lost unseen
        }
        self._serving = serving(self._context, zmq.ROUTER, self.endpoint, options, self._access)
        self._socket, self.endpoint = self._serving.__enter__()
        self._drain = Drain(
            self._socket, self._on_message, _FRAMES, frames_per_wake=FRAMES_PER_WAKE, rest_s=REST_S, identify=True
        )
        self._drain.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._drain.stop()
        self._serving.__exit__(kind, error, trace)

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        """Send a reply; that the client is gone or does not read is counted, no error."""
        try:
            self._socket.send_multipart((client.partition(_BETWEEN)[2], encode(body)), zmq.NOBLOCK)
        except zmq.ZMQError as error:
            if error.errno not in (zmq.EHOSTUNREACH, zmq.EAGAIN):
                raise
            self.undelivered += 1
        self._drain.after_send()

    def _on_message(self, frames: list[bytes]) -> None:
        sender = self._drain.told("Peer-Address" if self._access.secret is None else "User-Id")
        client = sender + _BETWEEN + frames[0]
        account = client if self._access.secret is None else sender
        now_ns = time.monotonic_ns()
        in_time = self._limit.allows(account, now_ns)
        if not in_time:
            self.busy += 1
            if not self._refusals.allows(account, now_ns):
                self.unanswered += 1
                if client != self._cut_off:
                    self._cut_off = client
                    cut_off(self._drain.told("__fd"), self.endpoint)
                return
        if len(frames) != _FRAMES:
            self._refuse(client, MessageError("malformed", "a request is one frame, as a DEALER sends it"))
            return
        try:
            body = decode(frames[1])
        except MessageError as error:
            self._refuse(client, error)
            return
        if not in_time:
            self._reply_error(client, body.get("id"), MessageError("busy", "too many requests; ask more slowly"))
        elif self._requesters is not None and sender not in self._requesters:
            reason = "this key may read; ask with one that the daemon's bus.requesters holds"
            self._reply_error(client, body.get("id"), MessageError("read_only", reason))
        else:
            self._on_request(client, body)

    def _refuse(self, client: bytes, error: MessageError) -> None:
        self.malformed += 1
        self._reply_error(client, None, error)

    def _reply_error(self, client: bytes, number: object, error: MessageError) -> None:
        fault = {"code": error.code, "message": error.message, "field": error.field}
        known = number if type(number) in (str, int) else None
        self.reply(client, {"v": PROTOCOL_VERSION, "id": known, "ok": False, "error": fault})
