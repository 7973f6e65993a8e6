"""Sends messages to every subscriber without ever waiting for one, and the last ones to those who come late."""

from __future__ import annotations

import asyncio
import os
import time
from types import TracebackType

import zmq

from slipd.bus.rate_limit import RateLimit
from slipd.zeromq.draining import Drain
from slipd.zeromq.endpoint import USER_ALONE, Access, serving
from slipd.zeromq.gate import cut_off

SEND_HWM = 1000
"""Messages kept for one slow subscriber, about a second of everything; beyond it the newest are dropped for it."""

MAX_SUBSCRIPTION_BYTES = 96
"""Longest message taken from a subscriber, the beginning of a topic: ZeroMQ keeps 50 times as much for each."""

MAX_PROOF_BYTES = 512
"""The same where keys are asked for: some 300 bytes prove one."""

MOST_SUBSCRIPTIONS = 64
"""Subscriptions of one connection, several times the topics there are; whoever makes more is disconnected."""

SUBSCRIPTIONS_PER_S = 200.0
"""How often one connection may subscribe or unsubscribe for long; whoever does it more often is disconnected."""

RECEIVE_HWM = 100
"""Subscriptions of one connection that ZeroMQ takes before the daemon looks; the rest wait at the subscriber. More than
anybody may have; without a limit ZeroMQ goes on taking them as long as they come, and the loop stands still."""

REST_S = 0.002
"""A flood of subscriptions is read in gulps with rests between them."""

REPEAT_AFTER_S = 0.5
"""How long a latecomer waits for the next message of a topic before the last one is sent again, to all."""

_SUBSCRIBE, _UNSUBSCRIBE = b"\x01", b"\x00"

_NOW, _AND_MORE = int(zmq.NOBLOCK), int(zmq.NOBLOCK | zmq.SNDMORE)
"""Plain numbers: the enumerations cost a third of a send."""

_send_frame = zmq.backend.Socket.send
"""The binding itself: what pyzmq's own sockets wrap around it looks for options of drafts, and costs as much again."""

_NO_TOPIC = b"\xff"
"""No topic begins like this, for it is no UTF-8."""


class Publisher:
    """Publishes topic and payload as two frames; a subscription is the beginning of the topics it wants.

    A latecomer gets the last message of each topic it subscribes to. ZeroMQ can address one message a subscription to
    the latecomer alone; that is the topic silent for longest. Of the others it gets the next message as everybody
    does, or, where none comes within REPEAT_AFTER_S, the last one is sent again to all, who know it by its number.

    Serves from ``with`` to its end, on the running loop.

    Args:
        context: Owner of the socket; lives longer.
        endpoint: As for `slipd.zeromq.endpoint.open_server`, which says what is wrong with it on entry.
        access: How clients are let in, likewise.

    Attributes:
        endpoint: As clients reach it, once served.
        published: Messages sent.
        repeated: Messages sent again to all.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], endpoint: str, access: Access = USER_ALONE) -> None:
        self.endpoint = endpoint
        self._access = access
        self.published = 0
        self.repeated = 0
        self._context = context
        self._last: dict[bytes, bytes] = {}  # topic → payload; the topic silent for longest comes first
        self._owed: set[bytes] = set()
        self._counts: dict[bytes, tuple[bytes, int]] = {}  # descriptor → the connection under it, its subscriptions
        self._limit = RateLimit(SUBSCRIPTIONS_PER_S)
        self._cut_off = b""
        self._repeating: asyncio.TimerHandle | None = None

    def __enter__(self) -> Publisher:
        self._loop = asyncio.get_running_loop()
        options: dict[int, int] = {
            zmq.XPUB_MANUAL: 1,
            zmq.SNDHWM: SEND_HWM,
            zmq.MAXMSGSIZE: MAX_SUBSCRIPTION_BYTES if self._access.secret is None else MAX_PROOF_BYTES,
            zmq.RCVHWM: RECEIVE_HWM,
        }
        self._serving = serving(self._context, zmq.XPUB, self.endpoint, options, self._access)
        self._socket, self.endpoint = self._serving.__enter__()
        self._drain = Drain(self._socket, self._on_subscription, max_frames=1, rest_s=REST_S, identify=True)
        self._drain.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._repeating is not None:
            self._repeating.cancel()
        self._drain.stop()
        self._serving.__exit__(kind, error, trace)

    def publish(self, topic: str, payload: bytes) -> None:
        """Send to every subscriber of ``topic``; never blocks, and never fails because of one."""
        name = topic.encode()
        self._send(name, payload)
        self._last.pop(name, None)
        self._last[name] = payload
        self._owed.discard(name)
        self.published += 1

    def look(self) -> None:
        """Hear of subscriptions whose wake-up a message used up; to be called every few milliseconds.

        Looking after each message would cost as much as to send it.
        """
        self._drain.after_send()

    def _send(self, topic: bytes, payload: bytes) -> None:
        _send_frame(self._socket, topic, _AND_MORE)
        _send_frame(self._socket, payload, _NOW)

    def _on_subscription(self, frames: list[bytes]) -> None:
        """Apply a subscription to whoever sent it, which ZeroMQ knows only until it hears of anyone leaving."""
        kind, beginning = frames[0][:1], frames[0][1:]
        if not self._bounded(kind):
            return
        if kind == _UNSUBSCRIBE:
            self._socket.setsockopt(zmq.UNSUBSCRIBE, beginning)
        elif kind == _SUBSCRIBE and self._sender_is_known():
            self._socket.setsockopt(zmq.SUBSCRIBE, beginning)
            self._welcome([topic for topic in self._last if topic.startswith(beginning)])

    def _bounded(self, kind: bytes) -> bool:
        """Count what a connection sent, and disconnect it where that is too much."""
        descriptor = self._drain.told("__fd")
        if not descriptor:
            return True  # ZeroMQ's own, for one that left
        try:
            connection = b"%d" % os.fstat(int(descriptor)).st_ino  # unlike its descriptor, not used again
        except OSError:  # it has left since
            return False
        before, count = self._counts.get(descriptor, (connection, 0))
        count = (count if before == connection else 0) + (1 if kind == _SUBSCRIBE else -1)
        self._counts[descriptor] = connection, max(0, count)
        if count <= MOST_SUBSCRIPTIONS and self._limit.allows(connection, time.monotonic_ns()):
            return True
        if connection != self._cut_off:
            self._cut_off = connection
            cut_off(descriptor, self.endpoint)
        return False

    def _welcome(self, topics: list[bytes]) -> None:
        self._socket.getsockopt(zmq.EVENTS)  # hears of those that left, so that the send below need not
        if topics and self._sender_is_known():
            self._socket.setsockopt(zmq.XPUB_MANUAL_LAST_VALUE, 1)  # the next message is for the sender alone
            topic = topics.pop(0)
            self._send(topic, self._last[topic])
            self._socket.setsockopt(zmq.XPUB_MANUAL_LAST_VALUE, 0)
            self._socket.setsockopt(zmq.XPUB_MANUAL, 1)  # the line above ended this too
        self._owed.update(topics)
        if self._owed and self._repeating is None:
            self._repeating = self._loop.call_later(REPEAT_AFTER_S, self._repeat)

    def _sender_is_known(self) -> bool:
        """Whether ZeroMQ can still address the sender of the last subscription; else it takes all for it."""
        before = self._socket.getsockopt(zmq.TOPICS_COUNT)
        self._socket.setsockopt(zmq.SUBSCRIBE, _NO_TOPIC)
        known = self._socket.getsockopt(zmq.TOPICS_COUNT) != before
        self._socket.setsockopt(zmq.UNSUBSCRIBE, _NO_TOPIC)
        return known

    def _repeat(self) -> None:
        self._repeating = None
        for topic in self._owed:
            self._send(topic, self._last[topic])
            self.repeated += 1
        self._owed.clear()
        self._drain.after_send()
