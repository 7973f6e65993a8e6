"""A recording for the live view in a browser: its messages in blocks of one second, as frames that a page can draw.

Of each topic a frame has the newest message; every change of level is kept. The first frame of a block has all topics,
so that a block can be shown without those before it. The blocks are on disk: a recording may be longer than the memory.
"""

from __future__ import annotations

import gzip
import json
import os
import tempfile
from collections.abc import Iterator
from typing import Any

from slipd_client.messages import WARNING_TOPIC

BLOCK_NS = 1_000_000_000
FRAME_NS = 33_333_333
"""Shortest time between two frames, ns: what the live view draws."""

SHOWN = ("slip", "tactile", "grasp", "gripper", "status")
"""Topics that the page draws, by their first word."""

Messages = Iterator[tuple[str, dict[str, Any]]]


class RecordedBlocks:
    """The frames of a recording; one thread adds, others read what there is.

    Attributes:
        begin_ns: Time of the first message, CLOCK_MONOTONIC of the recorded run; None before it.
        changes: Every change of level so far.
        ended: Nothing more will be added.
    """

    def __init__(self) -> None:
        self.begin_ns: int | None = None
        self.changes: list[dict[str, Any]] = []
        self.ended = False
        self._fd, name = tempfile.mkstemp(prefix="slipd-view-")
        os.unlink(name)  # noqa: PTH108 - the file ends with the process
        self._places: dict[int, tuple[int, int]] = {}
        self._size = 0
        self._now_ns = 0
        self._frame_ns = 0
        self._block = 0
        self._newest: dict[str, str] = {}
        self._changed: dict[str, dict[str, Any]] = {}
        self._frame_changes: list[dict[str, Any]] = []
        self._frames: list[str] = []

    @property
    def seconds(self) -> float:
        """How much of the recording can be shown, s."""
        return 0.0 if self.begin_ns is None else (self._now_ns - self.begin_ns) * 1e-9

    def add_all(self, messages: Messages) -> None:
        """Add every message of a replay."""
        for topic, body in messages:
            self.add(topic, body)
        self.end()

    def add(self, topic: str, body: dict[str, Any]) -> None:
        """Add one message; time runs on with those of the messages, and never back."""
        t_ns: int = body["t_ns"]
        if self.begin_ns is None:
            self.begin_ns = self._now_ns = self._frame_ns = t_ns
        if t_ns - self._frame_ns >= FRAME_NS:
            self._end_frame()
            self._frame_ns = t_ns
        self._now_ns = max(self._now_ns, t_ns)
        if topic == WARNING_TOPIC:
            self.changes.append(body)
            self._frame_changes.append(body)
        elif topic.partition(".")[0] in SHOWN:
            self._changed[topic] = body

    def end(self) -> None:
        """Store what is left: the recording has ended."""
        self._end_frame()
        self._end_block()
        self.ended = True

    def block(self, number: int) -> bytes | None:
        """Return a block, a JSON list of frames compressed with gzip; None where nothing was recorded then."""
        place = self._places.get(number)
        return None if place is None else os.pread(self._fd, place[1], place[0])

    def close(self) -> None:
        """Delete the blocks; nothing can be read or added any more."""
        os.close(self._fd)

    def _end_frame(self) -> None:
        """Make a frame of what is new, in the block of its last message."""
        if self.begin_ns is None:
            return
        block = (self._now_ns - self.begin_ns) // BLOCK_NS
        if block != self._block:
            self._end_block()
            self._block = block
        new = {topic: json.dumps(body, separators=(",", ":")) for topic, body in self._changed.items()}
        self._newest |= new
        topics = new if self._frames else self._newest
        texts = ",".join(f"{json.dumps(topic)}:{text}" for topic, text in topics.items())
        changes = json.dumps(self._frame_changes, separators=(",", ":"))
        self._frames.append(f'{{"now_ns":{self._now_ns},"topics":{{{texts}}},"changes":{changes}}}')
        self._changed, self._frame_changes = {}, []

    def _end_block(self) -> None:
        """Write the block to the file, and only then say where it is."""
        if not self._frames:
            return
        data = gzip.compress(f"[{','.join(self._frames)}]".encode(), compresslevel=1)
        os.pwrite(self._fd, data, self._size)
        self._places[self._block] = (self._size, len(data))
        self._size += len(data)
        self._frames = []
