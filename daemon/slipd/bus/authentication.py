"""Decides who may connect to an endpoint that asks for keys; whatever fails in it, nobody unknown gets in.

A handler of ZeroMQ's authentication protocol (ZAP, RFC 27) of our own, because pyzmq's ends for good, silently, with
the first exception in it. ZeroMQ itself admits any key where no handler runs, unless it is told to enforce the domain;
`slipd.zeromq.endpoint` does that.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Container, Mapping
from dataclasses import dataclass

import zmq
from zmq.utils import z85

from slipd.config import Bus
from slipd.errors import LinkError
from slipd.zeromq.draining import Drain
from slipd.zeromq.endpoint import Access
from slipd_client.keys import KeyFileError, load_allowed, load_secret

READ, REQUEST = b"slipd.read", b"slipd.request"
"""Domains of the two endpoints: the authenticator knows by them which list counts."""

TELL_EVERY_S = 10.0
"""How often refusals are logged: often enough to be seen, too seldom for a stranger to fill the disk."""

_ENDPOINT = "inproc://zeromq.zap.01"
_VERSION = b"1.0"
_FRAMES = 9  # empty one of the route, version, id, domain, address, routing id, mechanism, key; and the route itself
_REST_S = 0.002

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Guard:
    """Who may do what.

    Attributes:
        publish: How the endpoint of the messages is reached.
        requests: How that of the requests is.
        keys: Those that may connect to an endpoint, by its domain; empty where no endpoint asks for keys.
        requesters: The keys that may request; None: whoever can connect may.
    """

    publish: Access
    requests: Access
    keys: Mapping[bytes, frozenset[bytes]]
    requesters: frozenset[bytes] | None


def guard(bus: Bus) -> Guard:
    """Read the keys that the config names.

    A reader's key connects to the endpoint of the requests too, where it is told that it may not request.

    Raises:
        LinkError: A key file cannot be used; the text says why.
    """
    try:
        secret = None if bus.secret_key is None else load_secret(bus.secret_key)[1]
        readers = None if bus.readers is None else load_allowed(bus.readers)
        requesters = None if bus.requesters is None else load_allowed(bus.requesters)
    except KeyFileError as error:
        raise LinkError(str(error)) from error
    allowed = {}
    if readers is not None:
        allowed[READ] = readers
    if requesters is not None:
        allowed[REQUEST] = requesters | (readers or frozenset())
    return Guard(
        Access(READ, secret if readers is not None else None, local_tcp=bus.allow_local_tcp),
        Access(REQUEST, secret if requesters is not None else None, local_tcp=bus.allow_local_tcp),
        allowed,
        requesters,
    )


class Authenticator:
    """Answers ZeroMQ's question whether a key may connect; serves from ``with`` to its end, on the running loop.

    Whatever is raised while it judges refuses that one client and is logged. An error in reading or answering reaches
    the loop's exception handler, which ends the daemon; and while nobody answers, ZeroMQ admits nobody.

    Args:
        context: Of the sockets that it guards; they are bound after it and closed before it.
        allowed: The keys (40 letters of Z85) that may connect, by domain.

    Attributes:
        admitted: Connections let in.
        refused: Connections refused.
        faults: Those among them that were refused because judging them failed.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], allowed: Mapping[bytes, Container[bytes]]) -> None:
        self.admitted = 0
        self.refused = 0
        self.faults = 0
        self._context, self._allowed = context, allowed
        self._told_s = float("-inf")

    def __enter__(self) -> Authenticator:
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.setsockopt(zmq.LINGER, 0)
        try:
            self._socket.bind(_ENDPOINT)
        except zmq.ZMQError as error:
            self._socket.close()
            raise LinkError(f"the authenticator cannot be started: {error}") from error
        self._drain = Drain(self._socket, self._on_question, max_frames=_FRAMES, rest_s=_REST_S)
        self._drain.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._drain.stop()
        self._socket.close()

    def _on_question(self, frames: list[bytes]) -> None:
        try:
            key = self._judge(frames[2:])
        except Exception:
            self.faults += 1
            key = None
            if self._may_tell():
                _log.exception("authentication failed, and the client was refused (%d so far)", self.faults)
        if key is None:
            self.refused += 1
        else:
            self.admitted += 1
        verdict = (b"400", b"key not allowed", b"") if key is None else (b"200", b"OK", key)
        self._socket.send_multipart([*frames[:2], _VERSION, *frames[3:4], *verdict, b""], zmq.NOBLOCK)
        self._drain.after_send()

    def _judge(self, question: list[bytes]) -> bytes | None:
        """The key in text, where it may connect."""
        version, _, domain, address, _, mechanism, *credentials = question
        if version != _VERSION or mechanism != b"CURVE" or len(credentials) != 1:
            return None
        key = z85.encode(credentials[0])
        if domain in self._allowed and key in self._allowed[domain]:
            return key
        if self._may_tell():
            who = key.decode(), address.decode(errors="replace")
            _log.warning("%s: key %s at %s is not allowed and was refused", domain.decode(), *who)
        return None

    def _may_tell(self) -> bool:
        now_s = time.monotonic()
        if now_s - self._told_s < TELL_EVERY_S:
            return False
        self._told_s = now_s
        return True
