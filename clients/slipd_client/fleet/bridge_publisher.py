"""Publishes the messages of one robot to its fleet: a Zenoh publisher for each topic, and the robot's signs of life.

Warnings have the highest priority, wait while the network is congested, and are kept for recovery. Messages of other
topics are dropped then; only the last one of each is kept. Payloads are the daemon's bytes, unchanged.
"""

from __future__ import annotations

import threading

import zenoh
from zenoh.ext import AdvancedPublisher, CacheConfig, MissDetectionConfig, declare_advanced_publisher

from slipd_client.errors import ConnectionClosed
from slipd_client.fleet.fleet_keys import BRIDGE, DAEMON, message_key, token_key
from slipd_client.messages.names import WARNING_TOPIC

KEPT_WARNINGS = 200
"""Warnings that are kept for subscribers that missed them, and for late ones: minutes of a bad grasp, and 40 kB."""

HEARTBEAT_S = 0.2
"""After a warning, its number is sent again once within this time, so that subscribers notice a lost last one."""

PRIORITIES: dict[str, zenoh.Priority] = {
    WARNING_TOPIC: zenoh.Priority.INTERACTIVE_HIGH,
    "status": zenoh.Priority.INTERACTIVE_LOW,
    "wrench": zenoh.Priority.DATA_LOW,
    "tactile": zenoh.Priority.BACKGROUND,
}
"""Priority by the first word of a topic; of every other topic it is DATA."""


class BridgePublisher:
    """The publishers and liveliness tokens of one robot.

    Args:
        session: Of Zenoh; it ends all of them when it is closed.
        fleet: Name of the fleet.
        robot: Name of the robot.
    """

    def __init__(self, session: zenoh.Session, fleet: str, robot: str) -> None:
        self._session = session
        self._names = fleet, robot
        self._lock = threading.Lock()
        self._publishers: dict[str, AdvancedPublisher] = {WARNING_TOPIC: self._declared(WARNING_TOPIC)}
        self._bridge = session.liveliness().declare_token(token_key(fleet, robot, BRIDGE))
        self._daemon: zenoh.LivelinessToken | None = None

    def put(self, topic: str, payload: bytes) -> None:
        """Publish a message.

        A warning waits while the network is congested; any other message is dropped then.

        Raises:
            CallError: ``topic`` is not a topic of the daemon.
            ConnectionClosed: The session is closed.
        """
        with self._lock:
            publisher = self._publishers.get(topic)
            if publisher is None:
                publisher = self._publishers[topic] = self._declared(topic)
        try:
            publisher.put(payload)
        except zenoh.ZError as error:
            raise ConnectionClosed(f"the Zenoh session was closed: {error}") from error

    def set_daemon_alive(self, alive: bool) -> None:
        """Declare or take back the token of the daemon."""
        if alive and self._daemon is None:
            self._daemon = self._session.liveliness().declare_token(token_key(*self._names, DAEMON))
        elif not alive and self._daemon is not None:
            self._daemon.undeclare()
            self._daemon = None

    def _declared(self, topic: str) -> AdvancedPublisher:
        warning = topic == WARNING_TOPIC
        return declare_advanced_publisher(
            self._session,
            message_key(*self._names, topic),
            encoding=zenoh.Encoding("application/msgpack"),
            congestion_control=zenoh.CongestionControl.BLOCK if warning else zenoh.CongestionControl.DROP,
            priority=PRIORITIES.get(topic.partition(".")[0], zenoh.Priority.DATA),
            express=warning,
            reliability=zenoh.Reliability.RELIABLE,
            cache=CacheConfig(max_samples=KEPT_WARNINGS if warning else 1),
            sample_miss_detection=MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=HEARTBEAT_S if warning else None
            ),
            publisher_detection=True,
        )
