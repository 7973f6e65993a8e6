"""Receives warnings, ``status`` and signs of life of a fleet over Zenoh, and updates a `FleetState` with them.

What arrives waits in queues of Zenoh's own threads until it is taken. Callbacks into Python would each wait for the
interpreter: a view that computes for a moment would hold up the network of a thousand robots.
"""

from __future__ import annotations

import time

import zenoh
from zenoh.ext import AdvancedSubscriber, HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from slipd_client.fleet.fleet_keys import split_key
from slipd_client.fleet.fleet_state import FleetState
from slipd_client.messages.names import STATUS_TOPIC, WARNING_TOPIC
from slipd_client.messages.schema.topics import Message

WARNINGS_QUEUED = 400_000
"""Length of the queue of warnings: the kept ones of two thousand robots. While it is full, the network waits."""

STATUSES_QUEUED = 20_000
"""Length of the queue of ``status``: two of each of ten thousand robots. When it is full, the oldest are dropped."""

TOKENS_QUEUED = 100_000

POLL_S = 0.02
"""How often the queues are looked at while they are empty."""


class FleetListener:
    """Subscribes to a fleet.

    A listener that joins late receives the last ``status`` and the kept warnings of every robot. It asks again for a
    warning that was lost on the way.

    Args:
        session: Of Zenoh; it ends the subscriptions when it is closed.
        fleet: Name of the fleet.

    Attributes:
        state: The state of the robots as of the last `take`.
    """

    def __init__(self, session: zenoh.Session, fleet: str) -> None:
        self.state = FleetState()
        self._fleet = fleet
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
        """Update the state with what has arrived; return the messages, and whether anything arrived."""
        messages: list[Message] = []
        arrived = False
        while (sample := self._tokens.try_recv()) is not None:
            arrived = True
            if (found := split_key(str(sample.key_expr), self._fleet)) is not None:
                self.state.take_token(*found, alive=sample.kind == zenoh.SampleKind.PUT)
        for subscriber in self._messages:
            while (sample := subscriber.try_recv()) is not None:
                arrived = True
                found = split_key(str(sample.key_expr), self._fleet)
                if found is None or sample.kind != zenoh.SampleKind.PUT:
                    continue
                if (message := self.state.take_message(*found, sample.payload.to_bytes(), now_s)) is not None:
                    messages.append(message)
        return messages, arrived
