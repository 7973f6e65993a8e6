"""Hears a fleet over Zenoh: warnings, ``status`` and signs of life of every robot, put into a `FleetState`.

Zenoh calls back in threads of its own. They only queue what arrives; whoever owns the state takes it from there.
"""

from __future__ import annotations

import queue
import time
from typing import NamedTuple

import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from slipd_client.fleet.fleet_keys import split_key
from slipd_client.fleet.fleet_state import FleetState
from slipd_client.messages.names import STATUS_TOPIC, WARNING_TOPIC
from slipd_client.messages.schema.topics import Message

MOST_QUEUED = 100_000
"""Messages that wait to be taken: some seconds of a thousand robots. Those beyond are dropped, and counted."""


class Arrived(NamedTuple):
    """What arrived.

    Attributes:
        robot: Name of the robot.
        what: A topic, or which token.
        payload: Bytes of the message; None for a token.
        alive: The token was declared, and not ended.
        t_s: Time of the arrival, on ``time.monotonic``.
    """

    robot: str
    what: str
    payload: bytes | None
    alive: bool
    t_s: float


class FleetListener:
    """Subscribes to a fleet.

    Late joiners receive the last ``status`` and the kept warnings of every robot. A warning that was lost on the way is
    asked for again.

    Args:
        session: Of Zenoh; it ends the subscriptions when it is closed.
        fleet: Name of the fleet.

    Attributes:
        state: The state of the robots, by what `take` has taken.
        dropped: What arrived while too much waited.
    """

    def __init__(self, session: zenoh.Session, fleet: str) -> None:
        self.state = FleetState()
        self.dropped = 0
        self._fleet = fleet
        self._queue: queue.SimpleQueue[Arrived] = queue.SimpleQueue()
        history = HistoryConfig(detect_late_publishers=True)
        recovery = RecoveryConfig(periodic_queries=None, heartbeat=True)
        self._declared = (
            session.liveliness().declare_subscriber(f"{fleet}/*/*", self._on_token, history=True),
            declare_advanced_subscriber(
                session, f"{fleet}/*/{WARNING_TOPIC}", self._on_message, history=history, recovery=recovery
            ),
            declare_advanced_subscriber(session, f"{fleet}/*/{STATUS_TOPIC}", self._on_message, history=history),
        )

    def take(self, wait_s: float) -> list[Message]:
        """Put what has arrived into the state, and return the messages of it.

        Args:
            wait_s: How long to wait for the first arrival.
        """
        messages: list[Message] = []
        try:
            arrived = self._queue.get(timeout=wait_s) if wait_s > 0 else self._queue.get_nowait()
            while True:
                if (message := self._apply(arrived)) is not None:
                    messages.append(message)
                arrived = self._queue.get_nowait()
        except queue.Empty:
            return messages

    def _apply(self, arrived: Arrived) -> Message | None:
        if arrived.payload is None:
            self.state.token(arrived.robot, arrived.what, alive=arrived.alive)
            return None
        return self.state.message(arrived.robot, arrived.what, arrived.payload, arrived.t_s)

    def _on_message(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._put(sample, sample.payload.to_bytes())

    def _on_token(self, sample: zenoh.Sample) -> None:
        self._put(sample, None)

    def _put(self, sample: zenoh.Sample, payload: bytes | None) -> None:
        found = split_key(str(sample.key_expr), self._fleet)
        if found is None:
            return
        if payload is not None and self._queue.qsize() >= MOST_QUEUED:
            self.dropped += 1
            return
        alive = sample.kind == zenoh.SampleKind.PUT
        self._queue.put(Arrived(*found, payload, alive, time.monotonic()))
