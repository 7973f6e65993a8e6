"""``slipctl serve fleet``: the messages of this robot's daemon for its fleet, until interrupted.

The bridge has two connections to the daemon. Warnings have one to themselves, which a thread of its own reads: other
messages neither delay them nor push them out of a queue. Neither connection carries requests.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import threading
import time
from typing import TYPE_CHECKING

import zenoh
import zmq

from slipd_client.errors import CallError, ConnectionClosed
from slipd_client.fleet.bridge_publisher import BridgePublisher
from slipd_client.fleet.topic_limit import TopicLimit
from slipd_client.fleet.zenoh_session import Reach, configuration, described, opened
from slipd_client.link import Link
from slipd_client.messages.names import STATUS_TOPIC, WARNING_TOPIC
from slipd_client.paths import hint_for, publish_endpoint

if TYPE_CHECKING:
    from slipd_client.keys import Keys

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
    config = configuration(reach, "peer")
    warnings = Link(zmq.SUB, endpoint, keys, {zmq.RCVHWM: WARNINGS_QUEUED})
    others = Link(zmq.SUB, endpoint, keys)
    try:
        with opened(config, described(reach)) as session:
            publisher = BridgePublisher(session, chosen.fleet, chosen.robot)
            print(f"fleet: {chosen.fleet}/{chosen.robot} at {described(reach)}", flush=True)
            bridge = Bridge(warnings, others, publisher, chosen.rate)
            bridge.subscribe(chosen.topics)
            bridge.serve()
    finally:
        warnings.close()
        others.close()


class Bridge:
    """Publishes the messages that arrive over two connections to the daemon.

    Args:
        warnings: Connection for warnings.
        others: Connection for everything else.
        publisher: Publishes them.
        rate_hz: Most messages per second of each topic but ``warning``; None: all.
    """

    def __init__(self, warnings: Link, others: Link, publisher: BridgePublisher, rate_hz: float | None) -> None:
        self._warnings, self._others = warnings, others
        self._publisher = publisher
        self._limit = TopicLimit(rate_hz)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve_warnings, name="warnings", daemon=True)
        self._silent = False
        self._left_out_told = False

    def subscribe(self, topics: list[str] | None) -> None:
        """Subscribe to the topics that begin with these words, or to all; to ``warning`` and ``status`` always."""
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
                    self._put(topic, payload)
                if now_s - heard_s >= SILENCE_S and not self._silent:
                    self._report_silence()
        finally:
            self._ended.set()
            if self._thread.ident is not None:
                self._thread.join(END_S)
        raise ConnectionClosed("the Zenoh session was closed")

    def _forward(self, frames: list[bytes], now_s: float) -> None:
        """Publish a message of any topic but ``warning``, unless its topic comes too often."""
        topic = frames[0].decode("ascii", "replace")
        if len(frames) != 2 or topic == WARNING_TOPIC:
            return
        if self._limit.passes(topic, frames[1], now_s):
            self._put(topic, frames[1])

    def _put(self, topic: str, payload: bytes) -> None:
        """Publish a message; leave out one whose topic does not fit into a key, and say so once."""
        try:
            self._publisher.put(topic, payload)
        except CallError as error:
            if not self._left_out_told:
                print(f"slipctl: left out: {error}", file=sys.stderr, flush=True)
            self._left_out_told = True

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
