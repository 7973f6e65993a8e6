"""Receives warnings, ``status`` and signs of life of a fleet over Zenoh, and updates a `FleetState` with them.

What arrives waits in queues of Zenoh's own threads until it is taken. Callbacks into Python would each wait for the
interpreter: a view that computes for a moment would hold up the network of a thousand robots.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable
from typing import Generic, TypeVar

import zenoh
from zenoh.ext import AdvancedSubscriber, HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from slipd_client.fleet.fleet_state import FleetState
from slipd_client.fleet.zenoh_session import split_key
from slipd_client.messages.names import STATUS_TOPIC, WARNING_TOPIC
from slipd_client.messages.schema.topics import Message

Item = TypeVar("Item")


class FairQueue(Generic[Item]):
    """Items of any number of peers, taken from each in turn.

    Args:
        share: Most items of one peer that wait; the oldest gives way to a further one.
        most_peers: Most peers with a share of their own; further ones share that of the peer "".
    """

    def __init__(self, share: int, most_peers: int) -> None:
        self._share, self._most_peers = share, most_peers
        self._waiting: dict[str, deque[Item]] = {}

    def __bool__(self) -> bool:
        """Return whether anything waits."""
        return bool(self._waiting)

    def add(self, peer: str, item: Item) -> bool:
        """Let an item wait; return whether an older one of the same peer gave way."""
        if peer not in self._waiting and len(self._waiting) >= self._most_peers:
            peer = ""
        items = self._waiting.setdefault(peer, deque(maxlen=self._share))
        full = len(items) == self._share
        items.append(item)
        return full

    def take(self) -> Item:
        """Return the oldest item of the peer whose turn it is; there must be one."""
        peer = next(iter(self._waiting))
        items = self._waiting.pop(peer)
        item = items.popleft()
        if items:
            self._waiting[peer] = items
        return item


WARNINGS_QUEUED = 400_000
"""Length of the queue of warnings: the kept ones of two thousand robots. While it is full, the network waits."""

STATUSES_QUEUED = 20_000
"""Length of the queue of ``status``: two of each of ten thousand robots. When it is full, the oldest are dropped."""

TOKENS_QUEUED = 100_000

WORK_S = 0.1
"""Longest time for which messages are sorted, and then read, before the caller may draw."""

PEER_SHARE = 20_000
"""Messages of one session that may wait: the kept warnings of a hundred robots. The oldest give way."""

MOST_PEERS = 10_000
"""Sessions with a share of their own."""

POLL_S = 0.02
"""How often the queues are looked at while they are empty."""


class FleetListener:
    """Subscribes to a fleet.

    A listener that joins late receives the last ``status`` and the kept warnings of every robot. It asks again for a
    warning that was lost on the way.

    Args:
        session: Of Zenoh; it ends the subscriptions when it is closed.
        fleet: Name of the fleet.
        expected: See `FleetState`.

    Attributes:
        state: The state of the robots as of the last `take`.
    """

    def __init__(self, session: zenoh.Session, fleet: str, expected: Iterable[str] = ()) -> None:
        self.state = FleetState(expected)
        self._fleet = fleet
        self._waiting: FairQueue[tuple[str, str, bytes, float, str]] = FairQueue(PEER_SHARE, MOST_PEERS)
        history = HistoryConfig(detect_late_publishers=True)
        recovery = RecoveryConfig(periodic_queries=None, heartbeat=True)
        tokens: zenoh.handlers.FifoChannel[zenoh.Sample] = zenoh.handlers.FifoChannel(TOKENS_QUEUED)
        warnings: zenoh.handlers.FifoChannel[zenoh.Sample] = zenoh.handlers.FifoChannel(WARNINGS_QUEUED)
        statuses: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(STATUSES_QUEUED)
        self._tokens = session.liveliness().declare_subscriber(f"{fleet}/*/*", tokens, history=True)
        self._messages: tuple[AdvancedSubscriber[zenoh.Handler[zenoh.Sample]], ...] = (
            declare_advanced_subscriber(
                session, f"{fleet}/*/{WARNING_TOPIC}", warnings, history=history, recovery=recovery
            ),
            declare_advanced_subscriber(session, f"{fleet}/*/{STATUS_TOPIC}", statuses, history=history),
        )

    def take(self, wait_s: float) -> list[Message]:
        """Update the state with what has arrived, and return the messages.

        Args:
            wait_s: How long to wait for the first arrival.
        """
        until_s = time.monotonic() + wait_s
        while True:
            messages, arrived = self._take_now(time.monotonic())
            left_s = until_s - time.monotonic()
            if arrived or left_s <= 0:
                return messages
            time.sleep(min(POLL_S, left_s))

    def _take_now(self, now_s: float) -> tuple[list[Message], bool]:
        """Update the state for a limited time; return the messages, and whether anything arrived."""
        arrived = False
        until_s = time.monotonic() + WORK_S
        while time.monotonic() < until_s and (token := self._tokens.try_recv()) is not None:
            arrived = True
            if (found := split_key(str(token.key_expr), self._fleet)) is not None:
                self.state.take_token(*found, alive=token.kind == zenoh.SampleKind.PUT)
        for subscriber in self._messages:
            self._sort(subscriber, now_s, time.monotonic() + WORK_S / len(self._messages))
        messages: list[Message] = []
        until_s = time.monotonic() + WORK_S
        while self._waiting and time.monotonic() < until_s:
            arrived = True
            if (message := self.state.take_message(*self._waiting.take())) is not None:
                messages.append(message)
        return messages, arrived

    def _sort(self, subscriber: AdvancedSubscriber[zenoh.Handler[zenoh.Sample]], now_s: float, until_s: float) -> None:
        """Sort what has arrived by the session that it names as its source; reading it would take far longer."""
        while time.monotonic() < until_s and (sample := subscriber.try_recv()) is not None:
            found = split_key(str(sample.key_expr), self._fleet)
            if found is not None and sample.kind == zenoh.SampleKind.PUT:
                source = sample.source_info
                peer = "" if source is None else str(source.source_id.zid)
                self.state.unread += self._waiting.add(peer, (*found, sample.payload.to_bytes(), now_s, peer))
