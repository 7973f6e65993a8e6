"""Publish messages without ever waiting for a subscriber; late subscribers get the last message of each topic."""

from __future__ import annotations

import time

from slipd.io.rate_limit import RateLimit
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.endpoint import USER_ALONE, Access
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import Peer
from slipd.io.zmtp.wire import ProtocolError

MOST_QUEUED = 1000
"""Messages queued for a slow subscriber, about one second of all topics. Beyond it the oldest are dropped, so that all
slow subscribers wait for the same messages, which are stored once."""

MAX_PREFIX_BYTES = 95
"""Longest topic prefix of a subscription, bytes."""

MOST_SUBSCRIPTIONS = 64
"""Most subscriptions of one connection, several times the number of topics; a client with more is disconnected."""

SUBSCRIPTIONS_PER_S = 200.0
"""Long-term rate at which one connection may subscribe or unsubscribe; a faster client is disconnected."""

_SUBSCRIBE, _UNSUBSCRIBE = b"\x01", b"\x00"

_RULES = PeerRules(
    kind=b"XPUB",
    serves=frozenset({b"SUB", b"XSUB"}),
    max_bytes=len(b"\x09SUBSCRIBE") + MAX_PREFIX_BYTES,  # a command since ZMTP 3.1, one byte before that
    most_queued=MOST_QUEUED,
    drops_oldest=True,
)


class Publisher(Listener):
    """Publish topic and payload as two frames; a subscription is a prefix of topics.

    A new subscriber gets the last message of each topic of its subscription at once, in the order of their publication;
    of a topic that several fingers share, the last message of each finger.

    Args:
        endpoint: See `slipd.io.zmtp.listener.Listener`.
        access: Who may connect.
    """

    def __init__(self, endpoint: str, access: Access = USER_ALONE) -> None:
        super().__init__(endpoint, _RULES, access)
        self._last: dict[tuple[str, str], tuple[bytes, bytes]] = {}  # what was silent for longest comes first
        self._wanted: dict[Peer, set[bytes]] = {}
        self._readers: dict[str, dict[Peer, None]] = {}  # subscribers of each topic
        self._limit = RateLimit(SUBSCRIPTIONS_PER_S)

    def publish(self, topic: str, payload: bytes, finger: str = "") -> None:
        """Send to every subscriber of ``topic``; never block, and never fail because of a subscriber.

        Args:
            topic: The topic.
            payload: The message.
            finger: What the message is about. Of a topic that several fingers share, the last message of each is kept
                for late subscribers.
        """
        message = topic.encode(), payload
        self._last.pop((topic, finger), None)
        self._last[topic, finger] = message
        readers = self._readers.get(topic)
        if readers is None:
            readers = self._readers[topic] = {
                peer: None for peer, wanted in self._wanted.items() if _wants(wanted, message[0])
            }
        for peer in tuple(readers):  # sending removes a peer that is gone
            peer.send(message)

    def on_ready(self, peer: Peer) -> None:
        """Add a subscriber."""
        self._wanted[peer] = set()

    def on_close(self, peer: Peer) -> None:
        """Remove a subscriber."""
        del self._wanted[peer]
        for readers in self._readers.values():
            readers.pop(peer, None)

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        """Subscribe or unsubscribe; other messages count against the rate limit too."""
        if not self._limit.allows(b"%b#%d" % (peer.account.name, peer.slot), time.monotonic_ns()):
            raise ProtocolError(f"it subscribes more than {SUBSCRIPTIONS_PER_S:g} times per second")
        kind, prefix = frames[0][:1], frames[0][1:]
        if len(prefix) > MAX_PREFIX_BYTES:
            raise ProtocolError(f"a subscription has {len(prefix)} bytes; at most {MAX_PREFIX_BYTES} are allowed")
        wanted = self._wanted[peer]
        if kind == _UNSUBSCRIBE:
            wanted.discard(prefix)
            self._update_readers(peer, prefix)
        elif kind == _SUBSCRIBE and prefix not in wanted:
            if len(wanted) >= MOST_SUBSCRIPTIONS:
                raise ProtocolError(f"it has more than {MOST_SUBSCRIPTIONS} subscriptions")
            new = [
                message
                for message in self._last.values()
                if message[0].startswith(prefix) and not _wants(wanted, message[0])
            ]
            wanted.add(prefix)
            self._update_readers(peer, prefix)
            for message in new:
                peer.send(message)

    def _update_readers(self, peer: Peer, prefix: bytes) -> None:
        """Update the subscribers of topics with a prefix, for this peer only, so that its account pays for the work."""
        wanted = self._wanted[peer]
        for topic, readers in self._readers.items():
            name = topic.encode()
            if not name.startswith(prefix):
                continue
            if _wants(wanted, name):
                readers[peer] = None
            else:
                readers.pop(peer, None)


def _wants(wanted: set[bytes], topic: bytes) -> bool:
    return any(topic.startswith(prefix) for prefix in wanted)
