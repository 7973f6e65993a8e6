"""Sends messages to every subscriber without ever waiting for one, and the last ones to those who come late."""

from __future__ import annotations

import time
from types import TracebackType

from slipd.bus.rate_limit import RateLimit
from slipd.zmtp.endpoint import USER_ALONE, Access
from slipd.zmtp.listener import Listener
from slipd.zmtp.peer import Peer, PeerRules
from slipd.zmtp.wire import ProtocolError

MOST_QUEUED = 1000
"""Messages kept for one slow subscriber, about a second of everything; beyond it the oldest are dropped for it, so that
all slow ones wait for the same messages, which are kept once."""

MAX_BEGINNING_BYTES = 95
"""Longest beginning of a topic that a subscription may have."""

MOST_SUBSCRIPTIONS = 64
"""Subscriptions of one connection, several times the topics there are; whoever makes more is disconnected."""

SUBSCRIPTIONS_PER_S = 200.0
"""How often one connection may subscribe or unsubscribe for long; whoever does it more often is disconnected."""

_SUBSCRIBE, _UNSUBSCRIBE = b"\x01", b"\x00"

_RULES = PeerRules(
    kind=b"XPUB",
    serves=frozenset({b"SUB", b"XSUB"}),
    max_bytes=len(b"\x09SUBSCRIBE") + MAX_BEGINNING_BYTES,  # a command since ZMTP 3.1, one byte before
    most_queued=MOST_QUEUED,
    drops_oldest=True,
)


class Publisher:
    """Publishes topic and payload as two frames; a subscription is the beginning of the topics it wants.

    A latecomer gets the last message of each topic that it subscribes to, at once and alone.

    Serves from ``with`` to its end, on the running loop.

    Args:
        endpoint: As for `slipd.zmtp.endpoint.bind`, which is called on entry and refuses a wrong one.
        access: How clients are let in, likewise.

    Attributes:
        endpoint: As clients reach it, once served.
        published: Messages sent.
    """

    def __init__(self, endpoint: str, access: Access = USER_ALONE) -> None:
        self.endpoint = endpoint
        self.published = 0
        self._last: dict[str, tuple[bytes, bytes]] = {}  # the topic silent for longest comes first
        self._wanted: dict[Peer, set[bytes]] = {}
        self._readers: dict[str, dict[Peer, None]] = {}  # who wants a topic, by topic
        self._limit = RateLimit(SUBSCRIPTIONS_PER_S)
        self._listener = Listener(
            endpoint, _RULES, self._on_message, access, on_ready=self._on_ready, on_close=self._on_close
        )

    def __enter__(self) -> Publisher:
        self._listener.__enter__()
        self.endpoint = self._listener.endpoint
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listener.__exit__(kind, error, trace)

    @property
    def subscriptions(self) -> int:
        """Number of subscriptions of all subscribers."""
        return sum(map(len, self._wanted.values()))

    def publish(self, topic: str, payload: bytes) -> None:
        """Send to every subscriber of ``topic``; never blocks, and never fails because of one."""
        message = topic.encode(), payload
        self._last.pop(topic, None)
        self._last[topic] = message
        self.published += 1
        readers = self._readers.get(topic)
        if readers is None:
            readers = self._readers[topic] = {
                peer: None for peer, wanted in self._wanted.items() if _wants(wanted, message[0])
            }
        for peer in tuple(readers):  # one that is found to be gone is taken out meanwhile
            peer.send(message)

    def _on_ready(self, peer: Peer) -> None:
        self._wanted[peer] = set()

    def _on_close(self, peer: Peer) -> None:
        del self._wanted[peer]
        for readers in self._readers.values():
            readers.pop(peer, None)

    def _on_message(self, peer: Peer, frames: list[bytes]) -> None:
        """Subscribe or unsubscribe; other messages count against the limit too."""
        if not self._limit.allows(b"%b#%d" % (peer.account.name, peer.slot), time.monotonic_ns()):
            raise ProtocolError(f"it subscribes more than {SUBSCRIPTIONS_PER_S:g} times a second")
        kind, beginning = frames[0][:1], frames[0][1:]
        if len(beginning) > MAX_BEGINNING_BYTES:
            raise ProtocolError(f"a subscription has {len(beginning)} bytes; at most {MAX_BEGINNING_BYTES} are allowed")
        wanted = self._wanted[peer]
        if kind == _UNSUBSCRIBE:
            wanted.discard(beginning)
            self._update_readers(peer, beginning)
        elif kind == _SUBSCRIBE and beginning not in wanted:
            if len(wanted) >= MOST_SUBSCRIPTIONS:
                raise ProtocolError(f"it has more than {MOST_SUBSCRIPTIONS} subscriptions")
            new = [
                message
                for message in self._last.values()
                if message[0].startswith(beginning) and not _wants(wanted, message[0])
            ]
            wanted.add(beginning)
            self._update_readers(peer, beginning)
            for message in new:
                peer.send(message)

    def _update_readers(self, peer: Peer, beginning: bytes) -> None:
        """Look again at the topics that begin so, for this peer alone: its account pays for it, not the publishing."""
        wanted = self._wanted[peer]
        for topic, readers in self._readers.items():
            name = topic.encode()
            if not name.startswith(beginning):
                continue
            if _wants(wanted, name):
                readers[peer] = None
            else:
                readers.pop(peer, None)


def _wants(wanted: set[bytes], topic: bytes) -> bool:
    return any(topic.startswith(beginning) for beginning in wanted)
