"""The network of a fleet, Zenoh: the keys of messages and liveliness tokens, sessions, and who listens to a fleet.

Discovery is off, and a peer that vanishes is noticed within a second.

What arrives waits in queues of Zenoh's own threads until it is taken. Callbacks into Python would each wait for the
interpreter: a view that computes for a moment would hold up the network of a thousand robots.
"""

from __future__ import annotations

import json
import math
import re
import sys
import time
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import zenoh
from zenoh.ext import AdvancedSubscriber, HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from slipd_client.arguments import FLEET_NAME
from slipd_client.errors import CallError, ClientError
from slipd_client.fleet.fleet_state import FleetState
from slipd_client.messages.names import STATUS_TOPIC, WARNING_TOPIC
from slipd_client.messages.topics import Message

LEASE_MS = 1000
"""The other end drops a connection that is silent for so long, and with it the tokens of this process. Keep-alives are
sent four times as often."""

QUERY_MS = 2000
"""How long a subscriber waits for the last values of a robot that does not answer: meanwhile it delivers nothing."""

MOST_SESSIONS = 10_000
"""Connections that a router of this process accepts; Zenoh's own default is 1000."""

RETRY_S = 1.0
"""Time between two attempts to reach a router, before the first connection."""

_SETTINGS: dict[str, Any] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/link/tx/lease": LEASE_MS,
    "transport/unicast/max_sessions": MOST_SESSIONS,
    "transport/shared_memory/enabled": False,
    "queries_default_timeout": QUERY_MS,
    "connect/timeout_ms": {"router": -1, "peer": -1, "client": 0},
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
}
"""Settings that hold where no configuration file is given."""


TOPIC = re.compile(r"[a-z0-9_]+(\.[a-z0-9_]+)?")
"""Topic of the daemon, which is the last part of a key."""

_PLACE = re.compile(r"\s+at /\S+\.rs:\d+\.?")


class Reach(NamedTuple):
    """Which other processes a session reaches.

    Attributes:
        connect: Endpoints to connect to.
        listen: Endpoints to accept connections on.
        file: Configuration of Zenoh; None: the settings of this module.
    """

    connect: list[str]
    listen: list[str]
    file: Path | None = None


def configuration(reach: Reach, listening_mode: str) -> zenoh.Config:
    """Return the configuration of a session.

    Args:
        reach: Which processes it reaches.
        listening_mode: Zenoh's mode of a session that listens, "router" or "peer"; one that only connects is a client.

    Raises:
        CallError: No endpoint and no file is given, or Zenoh does not accept one of them.
    """
    if not (reach.connect or reach.listen or reach.file):
        raise CallError("give --connect ENDPOINT, --listen ENDPOINT or --zenoh-config FILE: there is no discovery")
    if reach.file is None:
        config = zenoh.Config()
        settings = _SETTINGS | {"mode": listening_mode if reach.listen else "client"}
    else:
        settings = {}
        try:
            config = zenoh.Config.from_file(str(reach.file))
        except zenoh.ZError as error:
            raise CallError(f"{reach.file}: not a configuration of Zenoh: {_why(error)}") from error
    if reach.connect:
        settings["connect/endpoints"] = reach.connect
    if reach.listen:
        settings["listen/endpoints"] = reach.listen
    for key, value in settings.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise CallError(f"Zenoh does not accept {key} {json.dumps(value)}: {_why(error)}") from error
    return config


def opened(config: zenoh.Config, where: str, wait_s: float = math.inf) -> zenoh.Session:
    """Return a session, once it is connected.

    Args:
        config: Its configuration.
        where: What it connects to or listens on, for messages.
        wait_s: Longest wait for a router; by default as long as it takes.

    Raises:
        CallError: It cannot listen.
        ClientError: No router was there for ``wait_s``.
    """
    reported = False
    until_s = time.monotonic() + wait_s
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if config.get_json("mode").strip('"') != "client":
                raise CallError(f"Zenoh cannot start at {where}: {_why(error)}") from error
            if not reported:
                print(f"slipctl: no Zenoh router at {where} yet; trying again", file=sys.stderr, flush=True)
            reported = True
            if time.monotonic() >= until_s:
                raise ClientError(f"no Zenoh router at {where} for {wait_s:g} s: is it running?") from error
        time.sleep(RETRY_S)


def described(reach: Reach) -> str:
    """Return the endpoints of a session for people."""
    return ", ".join([*reach.connect, *reach.listen]) or str(reach.file)


def _why(error: zenoh.ZError) -> str:
    """Return the text of an error without the places in the source code of Zenoh."""
    return _PLACE.sub("", str(error))


def message_key(fleet: str, robot: str, topic: str) -> str:
    """Return the key of the messages of a topic, e.g. ``plant/arm3/slip.left``, or of a liveliness token.

    Raises:
        CallError: The topic is not one of the daemon, or does not fit into one part of a key.
    """
    if not TOPIC.fullmatch(topic):
        raise CallError(f"topic must be a word, or two joined by a dot, got {topic!r:.80}")
    return f"{fleet}/{robot}/{topic}"


def split_key(key: str, fleet: str) -> tuple[str, str] | None:
    """Return robot and last part of a key of this fleet; None for any other key."""
    parts = key.split("/")
    if len(parts) != 3 or parts[0] != fleet or not re.fullmatch(FLEET_NAME, parts[1]):
        return None
    return parts[1], parts[2]


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

    def pop(self) -> Item:
        """Remove and return the oldest item of the peer whose turn it is; there must be one."""
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
        state: The state of the robots as of the last `receive`.
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

    def receive(self, wait_s: float) -> list[Message]:
        """Update the state with what has arrived, and return the messages.

        Args:
            wait_s: How long to wait for the first arrival.
        """
        until_s = time.monotonic() + wait_s
        while True:
            messages, arrived = self._receive_now(time.monotonic())
            left_s = until_s - time.monotonic()
            if arrived or left_s <= 0:
                return messages
            time.sleep(min(POLL_S, left_s))

    def _receive_now(self, now_s: float) -> tuple[list[Message], bool]:
        """Update the state for a limited time; return the messages, and whether anything arrived."""
        arrived = False
        until_s = time.monotonic() + WORK_S
        while time.monotonic() < until_s and (token := self._tokens.try_recv()) is not None:
            arrived = True
            if (found := split_key(str(token.key_expr), self._fleet)) is not None:
                self.state.add_token(*found, alive=token.kind == zenoh.SampleKind.PUT)
        for subscriber in self._messages:
            self._sort(subscriber, now_s, time.monotonic() + WORK_S / len(self._messages))
        messages: list[Message] = []
        until_s = time.monotonic() + WORK_S
        while self._waiting and time.monotonic() < until_s:
            arrived = True
            if (message := self.state.add_message(*self._waiting.pop())) is not None:
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
