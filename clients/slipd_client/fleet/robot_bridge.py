"""``slipctl serve fleet``: the messages of this robot for its fleet, over Zenoh, until interrupted.

The bridge has two connections to the daemon. Warnings have one to themselves, which a thread of its own reads: other
messages neither delay them nor push them out of a queue. Neither connection carries requests.

Warnings have the highest priority, wait while the network is congested, and are kept for recovery. Messages of other
topics are dropped then; only the last one of each is kept. Payloads are the daemon's bytes, unchanged.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import threading
import time

import zenoh
import zmq
from zenoh.ext import AdvancedPublisher, CacheConfig, MissDetectionConfig, declare_advanced_publisher

from slipd_client.errors import ConnectionClosed
from slipd_client.fleet.fleet_network import TOPIC, Reach, configuration, described, message_key, opened
from slipd_client.fleet.fleet_state import BRIDGE, DAEMON
from slipd_client.keys import Keys
from slipd_client.link import Link
from slipd_client.messages.names import STATUS_TOPIC, WARNING_TOPIC
from slipd_client.paths import hint_for, publish_endpoint
from slipd_client.topic_limit import TopicLimit

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
    """The publishers and liveliness tokens of one robot. Each topic is published by one thread alone.

    Args:
        session: Of Zenoh; it ends all of them when it is closed.
        fleet: Name of the fleet.
        robot: Name of the robot.
    """

    def __init__(self, session: zenoh.Session, fleet: str, robot: str) -> None:
        self._session = session
        self._names = fleet, robot
        self._publishers: dict[str, AdvancedPublisher] = {WARNING_TOPIC: self._declared(WARNING_TOPIC)}
        self._bridge = session.liveliness().declare_token(message_key(fleet, robot, BRIDGE))
        self._daemon: zenoh.LivelinessToken | None = None

    def put(self, topic: str, payload: bytes) -> None:
        """Publish a message.

        A warning waits while the network is congested; any other message is dropped then.

        Raises:
            CallError: ``topic`` is not a topic of the daemon.
            ConnectionClosed: The session is closed.
        """
        if topic not in self._publishers:
            self._publishers[topic] = self._declared(topic)
        try:
            self._publishers[topic].put(payload)
        except zenoh.ZError as error:
            raise ConnectionClosed(f"the Zenoh session was closed: {error}") from error

    def set_daemon_alive(self, alive: bool) -> None:
        """Declare or take back the token of the daemon."""
        if alive and self._daemon is None:
            self._daemon = self._session.liveliness().declare_token(message_key(*self._names, DAEMON))
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


SILENCE_S = 1.5
"""Time without a message after which the fleet learns that the daemon is silent, s: 1.5 periods of ``status``."""

WAKE_S = 0.2
"""Longest time until the thread of the warnings notices the end, s."""

END_S = 1.0
"""Longest wait at the end for a warning that the network has not accepted yet, s."""

WARNINGS_QUEUED = 10_000
"""Warnings that wait in this process while the network is congested."""

MOST_TAKEN = 1000
"""Most messages of the other topics that are read at once; only the newest of each topic is published."""


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command.

    Raises:
        CallError: An endpoint is wrong, or Zenoh cannot start.
    """
    zenoh.try_init_log_from_env()  # RUST_LOG=zenoh=warn: why a router turns this bridge away
    endpoint = publish_endpoint() if chosen.publish is None else chosen.publish
    reach = Reach(chosen.connect, chosen.listen, chosen.zenoh_config)
    with (
        contextlib.closing(Link(zmq.SUB, endpoint, keys, {zmq.RCVHWM: WARNINGS_QUEUED})) as warnings,
        contextlib.closing(Link(zmq.SUB, endpoint, keys)) as others,
        opened(configuration(reach, "peer"), described(reach)) as session,
    ):
        publisher = BridgePublisher(session, chosen.fleet, chosen.robot)
        print(f"fleet: {chosen.fleet}/{chosen.robot} at {described(reach)}", flush=True)
        Bridge(warnings, others, publisher, chosen.rate, chosen.topics).serve()


class Bridge:
    """Publishes the messages that arrive over two connections to the daemon.

    Args:
        warnings: Connection for warnings.
        others: Connection for everything else.
        publisher: Publishes them.
        rate_hz: Most messages per second of each topic but ``warning``; None: all.
        topics: First words of the topics to publish besides ``warning`` and ``status``; None: all.
    """

    def __init__(
        self,
        warnings: Link,
        others: Link,
        publisher: BridgePublisher,
        rate_hz: float | None,
        topics: list[str] | None,
    ) -> None:
        self._warnings, self._others = warnings, others
        self._publisher = publisher
        self._limit = TopicLimit(rate_hz)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve_warnings, name="warnings", daemon=True)
        self._silent = False
        self._warnings.socket.setsockopt(zmq.SUBSCRIBE, WARNING_TOPIC.encode())
        for word in [""] if topics is None else sorted({*topics, STATUS_TOPIC} - {WARNING_TOPIC}):
            self._others.socket.setsockopt(zmq.SUBSCRIBE, word.encode())

    def serve(self) -> None:
        """Forward messages until interrupted.

        Raises:
            ConnectionClosed: The Zenoh session was closed.
        """
        try:
            self._thread.start()
            heard_s = time.monotonic()
            while self._thread.is_alive():
                due_s = self._limit.due_s()
                until_s = time.monotonic() + WAKE_S
                frames = self._others.receive(until_s if due_s is None else min(due_s, until_s))
                now_s = time.monotonic()
                if frames is not None:
                    heard_s = now_s
                    self._silent = False
                    self._publisher.set_daemon_alive(True)
                    for each in (frames, *self._others.newest(MOST_TAKEN)):
                        self._forward(each, now_s)
                for topic, payload in self._limit.due(now_s):
                    self._publisher.put(topic, payload)
                if now_s - heard_s >= SILENCE_S and not self._silent:
                    self._report_silence()
        finally:
            self._ended.set()
            if self._thread.ident is not None:
                self._thread.join(END_S)
        raise ConnectionClosed("the Zenoh session was closed")

    def _forward(self, frames: list[bytes], now_s: float) -> None:
        """Publish a message of any topic but ``warning`` that fits into a key, unless its topic comes too often."""
        topic = frames[0].decode("ascii", "replace")
        if len(frames) != 2 or topic == WARNING_TOPIC or not TOPIC.fullmatch(topic):
            return
        if self._limit.passes(topic, frames[1], now_s):
            self._publisher.put(topic, frames[1])

    def _serve_warnings(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while not self._ended.is_set():
                frames = self._warnings.receive(time.monotonic() + WAKE_S)
                if frames is not None and len(frames) == 2:
                    self._publisher.put(WARNING_TOPIC, frames[1])

    def _report_silence(self) -> None:
        self._silent = True
        self._publisher.set_daemon_alive(False)
        where = self._others.endpoint
        print(f"slipctl: no message from {where} for {SILENCE_S:g} s. {hint_for(where)}", file=sys.stderr, flush=True)
