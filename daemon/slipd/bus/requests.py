"""Takes requests and sends replies, whatever else a client may send."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any

import zmq

from slipd.zeromq.draining import Drain
from slipd.zeromq.endpoint import open_server
from slipd_client.messages import PROTOCOL_VERSION, REQUEST_LIMITS, MessageError, decode, encode

RECEIVE_HWM = 100
"""Requests kept for one client; with their size this bounds what a flood may occupy to 1.6 MB a client."""

SEND_HWM = 100
"""Replies kept for one client that does not read them; the rest are dropped."""

_FRAMES = 2
"""Identity and request."""


class RequestServer:
    """Hands on well-formed requests and refuses everything else by itself.

    Serves from ``with`` to its end, on the running loop. Nothing that a client sends raises.

    Args:
        context: Owner of the socket; lives longer.
        endpoint: As for `slipd.zeromq.endpoint.open_server`, which says what is wrong with it on entry.
        on_request: Called with the client's identity, to reply to, and the request's map.

    Attributes:
        endpoint: As clients reach it, once served.
        malformed: Requests refused here.
        undelivered: Replies to clients that were gone or did not read.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        endpoint: str,
        on_request: Callable[[bytes, dict[str, Any]], None],
    ) -> None:
        self.endpoint = endpoint
        self.malformed = 0
        self.undelivered = 0
        self._context = context
        self._on_request = on_request

    def __enter__(self) -> RequestServer:
        options: dict[int, int] = {
            zmq.MAXMSGSIZE: REQUEST_LIMITS.data_bytes,  # who sends more is disconnected
            zmq.RCVHWM: RECEIVE_HWM,
            zmq.SNDHWM: SEND_HWM,
            zmq.ROUTER_MANDATORY: 1,  # a reply that cannot be delivered is counted, not lost unseen
        }
        self._socket, self.endpoint = open_server(self._context, zmq.ROUTER, self.endpoint, options)
        self._drain = Drain(self._socket, self._on_message, max_frames=_FRAMES)
        self._drain.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._drain.stop()
        self._socket.close()

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        """Send a reply; that the client is gone or does not read is counted, no error."""
        try:
            self._socket.send_multipart((client, encode(body)), zmq.NOBLOCK)
        except zmq.ZMQError as error:
            if error.errno not in (zmq.EHOSTUNREACH, zmq.EAGAIN):
                raise
            self.undelivered += 1
        self._drain.after_send()

    def _on_message(self, frames: list[bytes]) -> None:
        if len(frames) != _FRAMES:
            self._refuse(frames[0], MessageError("malformed", "a request is one frame, as a DEALER sends it"))
            return
        try:
            body = decode(frames[1])
        except MessageError as error:
            self._refuse(frames[0], error)
        else:
            self._on_request(frames[0], body)

    def _refuse(self, client: bytes, error: MessageError) -> None:
        self.malformed += 1
        fault = {"code": error.code, "message": error.message, "field": error.field}
        self.reply(client, {"v": PROTOCOL_VERSION, "id": None, "ok": False, "error": fault})
