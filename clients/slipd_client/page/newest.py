"""The newest message of each topic and the changes of level, as pieces of the frames that browsers get.

A piece is encoded once, and only when somebody needs it: of the hundreds of messages a second, at most one of each
topic and frame. Knows no clock or socket.
"""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass
from typing import Any

from slipd_client.errors import MessageError
from slipd_client.messages import WARNING_TOPIC
from slipd_client.messages.reader import read

CHANGES = 200
"""Changes of level that are kept for a browser that is late, or comes later."""


@dataclass(slots=True)
class _Newest:
    """The newest message of a topic: its frames until it is needed, then its text.

    Attributes:
        tick: When it arrived, in ticks.
        frames: Topic and map, as received; empty once they are decoded.
        text: Its map as JSON; "" until it is decoded, or where it cannot be.
    """

    tick: int
    frames: list[bytes]
    text: str = ""


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
        self._topics: dict[bytes, _Newest] = {}
        self._seqs: dict[bytes, int] = {}
        self._changes: deque[tuple[int, str]] = deque(maxlen=CHANGES)

    def add(self, messages: list[list[bytes]]) -> bool:
        """Add what has arrived since the last tick, and begin a tick where anything has; return whether it has."""
        if not messages:
            return False
        self.tick += 1
        for frames in messages:
            if frames[0] == WARNING_TOPIC.encode():
                self._add_change(frames)
            else:
                self._topics[frames[0]] = _Newest(self.tick, frames)
        return True

    def clear(self) -> None:
        """Forget the newest messages: nobody looks, and they grow old. The daemon sends them again."""
        self._topics.clear()
        self._seqs.clear()

    def frame(self, since: int) -> str:
        """Return as JSON what has arrived after the tick ``since``, up to which a browser has seen everything."""
        for newest in sorted(self._topics.values(), key=lambda each: each.tick):
            if newest.frames and newest.tick > since:
                self._decode(newest)
        topics = ",".join(
            f"{json.dumps(topic.decode())}:{newest.text}"
            for topic, newest in self._topics.items()
            if newest.tick > since and newest.text
        )
        changes = ",".join(text for tick, text in self._changes if tick > since)
        return f'{{"topics":{{{topics}}},"changes":[{changes}],"bad":{json.dumps(self.bad_reason)}}}'

    def _decode(self, newest: _Newest) -> None:
        """Decode a message; one that repeats an earlier one, as after a reconnection, is left out."""
        frames, newest.frames = newest.frames, []
        raw = self._read(frames)
        if raw is None:
            return
        if raw["boot"] != self._boot:  # another run: what the one before it sent is over
            self._boot = raw["boot"]
            self._seqs.clear()
            kept = {topic: each for topic, each in self._topics.items() if each.frames or each is newest}
            self._topics.clear()
            self._topics.update(kept)
        if raw["seq"] > self._seqs.get(frames[0], -1):
            self._seqs[frames[0]] = raw["seq"]
            newest.text = json.dumps(raw, separators=(",", ":"), default=bytes.hex)

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
