"""Zenoh for a fleet: the keys of messages and liveliness tokens, and sessions.

Discovery is off, and a peer that vanishes is noticed within a second.
"""

from __future__ import annotations

import json
import math
import re
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

from slipd_client.arguments import FLEET_NAME
from slipd_client.errors import CallError, ClientError

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


_TOPIC = re.compile(r"[a-z0-9_]+(\.[a-z0-9_]+)?")
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
    if not _TOPIC.fullmatch(topic):
        raise CallError(f"topic must be a word, or two joined by a dot, got {topic!r:.80}")
    return f"{fleet}/{robot}/{topic}"


def split_key(key: str, fleet: str) -> tuple[str, str] | None:
    """Return robot and last part of a key of this fleet; None for any other key."""
    parts = key.split("/")
    if len(parts) != 3 or parts[0] != fleet or not FLEET_NAME.fullmatch(parts[1]):
        return None
    return parts[1], parts[2]
