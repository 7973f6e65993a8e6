"""Keeps track of the messages that a subscriber receives: gaps, restarts, silence. Knows no socket."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Sequence

from slipd_client.errors import CallError, MessageError, Silence, check_seconds
from slipd_client.messages import STATUS_TOPIC
from slipd_client.messages.reader import read, typed_message
from slipd_client.messages.schema.topics import TOPICS, TOPICS_OF_FINGERS, Message
from slipd_client.silence_hint import hint_for

SILENCE_S = 3.0
"""The daemon publishes ``status`` once a second: after so long without a message it is gone or cut off."""


class MessageTracker:
    """Orders each message among those before it.

    ``status`` is always received, as the daemon's sign of life where all else is quiet, but returned only to a
    subscriber that asked for it.

    Args:
        topics: Beginnings of the topics to return.
        silence_s: After so long without any message `stale` is true and `silent_at` has passed; None: never.

    Attributes:
        bad: Messages dropped because they could not be read.
        bad_reason: Why the last of them could not be read.
        prefixes: Beginnings of the topics to subscribe to.

    Raises:
        CallError: ``topics`` is not a sequence of strings, one of them begins no topic, or ``silence_s`` is not a
            positive time.
    """

    def __init__(self, topics: Sequence[str], silence_s: float | None) -> None:
        strings = isinstance(topics, Sequence) and all(isinstance(each, str) for each in topics)
        if not strings or isinstance(topics, str):
            raise CallError(f'topics must be a sequence of strings, e.g. ("slip",), got {topics!r:.60}')
        for each in topics:
            _check_beginning(each)
        if silence_s is not None:
            check_seconds("silence_s", silence_s, SILENCE_S)
        self.silence_s = silence_s
        self.bad = 0
        self.bad_reason = ""
        self._topics = tuple(topics)
        self.prefixes = self._topics if STATUS_TOPIC.startswith(self._topics) else (*self._topics, STATUS_TOPIC)
        self._boot = ""
        self._seq: dict[str, int] = {}
        self._known: set[tuple[str, str]] = set()  # topics and fingers of the messages so far
        self._last_s: float | None = None
        self._restart_pending = False
        self._since_s = time.monotonic()

    @property
    def age_s(self) -> float | None:
        """Seconds since the last message of any topic; None before the first."""
        return None if self._last_s is None else time.monotonic() - self._last_s

    @property
    def stale(self) -> bool:
        """No message for ``silence_s``, or none ever: what was received last no longer describes the present."""
        age_s = self.age_s
        return age_s is None or (self.silence_s is not None and age_s > self.silence_s)

    @property
    def silent_at(self) -> float:
        """When the silence will have lasted too long, on ``time.monotonic``; infinity: never."""
        return math.inf if self.silence_s is None else max(self._since_s, self._last_s or 0.0) + self.silence_s

    def silence(self, endpoint: str) -> Silence:
        """Return the error of a silence that lasted too long, and restart the count."""
        self._since_s = time.monotonic()
        unreadable = f"; {self.bad} could not be read, the last: {self.bad_reason}" if self.bad else ""
        return Silence(f"no message from {endpoint} for {self.silence_s} s{unreadable}. {hint_for(endpoint)}")

    def accept(self, frames: list[bytes]) -> Message | None:
        """Return the message in these frames; None for one that is unreadable, a repeat, or not asked for."""
        try:
            topic, raw = read(frames)
            seq, boot = raw["seq"], raw["boot"]
            restarted = self._boot not in ("", boot)
            last = seq - 1 if restarted else self._seq.get(topic, seq - 1)
            if seq <= last:  # after a reconnection the daemon sends the last message of each topic again
                return None
            about = topic, str(raw.get("finger"))
            # a subscriber that comes late gets the last warning of each finger, and none of those between them
            missed = seq - last - 1 if about in self._known else 0
            message = typed_message(topic, raw, missed=missed, restarted=restarted or self._restart_pending)
        except MessageError as error:
            self.bad += 1
            self.bad_reason = str(error)
            return None
        if restarted:
            self._seq.clear()
            self._known.clear()
        self._boot = boot
        self._seq[topic] = seq
        self._known.add(about)
        self._last_s = time.monotonic()
        wanted = topic.startswith(self._topics)
        self._restart_pending = message.restarted and not wanted
        return message if wanted else None


def _check_beginning(beginning: str) -> None:
    """Do nothing for the beginning of a topic; the name of its finger is not checked.

    Raises:
        CallError: No topic begins like that, so that nothing would ever arrive.
    """
    word, dot, finger = beginning.partition(".")
    if dot:
        known = word in TOPICS_OF_FINGERS and re.fullmatch("[a-z0-9]{0,32}", finger) is not None
    else:
        known = any(topic.startswith(word) for topic in TOPICS)
    if not known:
        names = ", ".join(f"{topic}.FINGER" if topic in TOPICS_OF_FINGERS else topic for topic in TOPICS)
        raise CallError(f'topics must be beginnings of {names}, or "" for everything, got {beginning!r:.60}')
