"""Keys of a fleet: those of every message and of every liveliness token. Pure."""

from __future__ import annotations

import re

from slipd_client.errors import CallError

MOST_NAME = 64
"""Longest name of a fleet or a robot, characters."""

BRIDGE, DAEMON = "bridge", "daemon"
"""Last words of the two liveliness tokens of a robot: its bridge runs; the daemon behind it publishes."""

_NAME = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_.-]{{0,{MOST_NAME - 1}}}")
_TOPIC = re.compile(r"[a-z0-9_]+(\.[a-z0-9_]+)?")


def check_name(what: str, name: str) -> str:
    """Return the name of a fleet or a robot.

    Raises:
        CallError: It has characters that a key must not have, such as ``*``, ``$``, ``#``, ``?`` and ``/``.
    """
    if not _NAME.fullmatch(name):
        raise CallError(
            f"{what} must be 1 to {MOST_NAME} of the characters A-Z a-z 0-9 _ . - and begin with a letter or digit, "
            f"got {name!r:.80}"
        )
    return name


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
    if len(parts) != 3 or parts[0] != fleet or not _NAME.fullmatch(parts[1]):
        return None
    return parts[1], parts[2]
