"""The newest message of each topic and the changes of level, as pieces of the frames that browsers get.

A piece is encoded once, and only when somebody needs it: of the hundreds of messages a second, at most one of each
topic and frame. Knows no clock or socket.
"""

from __future__ import annotations

import json
from collections import deque
from typing import Any, NamedTuple

from slipd_client.errors import MessageError
from slipd_client.messages import WARNING_TOPIC
from slipd_client.messages.reader import read

CHANGES = 200
"""Changes of level that are kept for a browser that is late, or comes later."""


class _Arrived(NamedTuple):
    """A message as received, until a browser needs it.

    Attributes:
        tick: When it arrived, in ticks.
        at_s: The same in seconds of the caller's clock.
        frames: Topic and map.
    """

    tick: int
    at_s: float
    frames: list[bytes]


class _Shown(NamedTuple):
    """A message as browsers get it.

    Attributes:
        tick: When it arrived, in ticks.
        at_s: The same in seconds of the caller's clock.
        seq: Its number.
        text: Its map as JSON.
    """

    tick: int
    at_s: float
    seq: int
    text: str


class Newest:
    """What was received last, for any number of browsers that each take what is new to them.

    Attributes:
        tick: Number of the newest tick; a browser that has seen it has seen everything.
        bad: Messages that could not be read.
        bad_reason: Why the last of them could not be.
    """

    def __init__(self) -> None:
        self.tick = 0
        self.bad = 0
        self.bad_reason = ""
        self._boot = ""
        self._arrived: dict[bytes, _Arrived] = {}
        self._shown: dict[bytes, _Shown] = {}
        self._changes: deque[tuple[int, str]] = deque(maxlen=CHANGES)

    def add(self, messages: list[list[bytes]], now_s: float) -> bool:
        """Add what has arrived since the last tick, and begin a tick where anything has; return whether it has.

        Args:
            messages: The frames of each message.
            now_s: Time on a clock that never goes back, s.
        """
        if not messages:
            return False
        self.tick += 1
        for frames in messages:
            if frames[0] == WARNING_TOPIC.encode():
                self._add_change(frames)
            else:
                self._arrived.pop(frames[0], None)  # so that they stay in the order of their arrival
                self._arrived[frames[0]] = _Arrived(self.tick, now_s, frames)
        return True

    def clear(self) -> None:
        """Forget the newest messages: nobody looks, and they grow old. The daemon sends them again."""
        self._arrived.clear()
        self._shown.clear()

    def frame(self, since: int, now_s: float) -> str:
        """Return as JSON what has arrived after the tick ``since``, up to which a browser has seen everything.

        Each topic is sent with the age of its message, s: it may have arrived long before this browser.
        """
        for topic, arrived in self._arrived.items():
            self._show(topic, arrived)
        self._arrived.clear()
        new = {json.dumps(topic.decode()): shown for topic, shown in self._shown.items() if shown.tick > since}
        topics = ",".join(f"{name}:{shown.text}" for name, shown in new.items())
        ages = ",".join(f"{name}:{max(now_s - shown.at_s, 0.0):.3f}" for name, shown in new.items())
        changes = ",".join(text for tick, text in self._changes if tick > since)
        bad = json.dumps(self.bad_reason)
        return f'{{"topics":{{{topics}}},"ages":{{{ages}}},"changes":[{changes}],"bad":{bad}}}'

    def _show(self, topic: bytes, arrived: _Arrived) -> None:
        """Decode a message; one that repeats an earlier one, as after a reconnection, changes nothing."""
        raw = self._read(arrived.frames)
        if raw is None:
            self._shown.pop(topic, None)  # what it replaces is no longer the newest
            return
        if raw["boot"] != self._boot:  # another run: what the one before it sent is over
            self._boot = raw["boot"]
            self._shown.clear()
        before = self._shown.get(topic)
        if before is None or raw["seq"] > before.seq:
            text = json.dumps(raw, separators=(",", ":"), default=bytes.hex)
            self._shown[topic] = _Shown(arrived.tick, arrived.at_s, raw["seq"], text)

    def _add_change(self, frames: list[bytes]) -> None:
        raw = self._read(frames)
        if raw is not None:
            self._changes.append((self.tick, json.dumps(raw, separators=(",", ":"), default=bytes.hex)))

    def _read(self, frames: list[bytes]) -> dict[str, Any] | None:
        try:
            return read(frames)[1]
        except MessageError as error:
            self.bad += 1
            self.bad_reason = str(error)
            return None
