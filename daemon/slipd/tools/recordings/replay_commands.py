"""``slipd replay`` prints or publishes the messages of a recording; ``slipd view`` shows them in a browser.

The page is that of the live view. The messages are kept in blocks of one second, as frames that the page can draw. Of
each topic a frame has the newest message; every change of level is kept. The first frame of a block has all topics, so
that a block can be shown without those before it. The blocks are on disk: a recording may be longer than the memory.
"""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import json
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any

from websockets.http11 import Response

from slipd.compile_kernels import compile_kernels, interruptible
from slipd.errors import UsageError
from slipd.recording.reader import EventGaps, Recording, open_recording
from slipd.recording.replay import PlaybackPace, replay
from slipd.tools.outputs import all_complete
from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError
from slipd_client.live_view import change_reasons
from slipd_client.messages import WARNING_TOPIC
from slipd_client.page.page_server import PageServer, answer, json_answer

BLOCK_NS = 1_000_000_000
FRAME_NS = 33_333_333
"""Shortest time between two frames, ns: what the live view draws."""

Show = Callable[[str, dict[str, Any]], None]
"""Prints the topic and the body of a message."""

SHOWN = ("slip", "tactile", "grasp", "motion", "gripper", "status")
"""Topics that the page draws, by their first word."""


def replay_command(path: Path, speed: float | None, *, as_json: bool, publish: str | None) -> bool:
    """Replay a recording; print changes of level, at seconds since its begin, or every message as JSON.

    Args:
        path: The recording.
        speed: Recorded seconds per second, which standard error states first; None: as fast as possible.
        as_json: Print every message, one per line.
        publish: Publish the messages too, on this endpoint; "": on that of the recorded config; None: do not.

    Returns:
        Whether the recording is complete.

    Raises:
        ConfigError: The recorded config has faults (for this version of slipd).
        SlipdError: The recording cannot be read, or the endpoint cannot be opened.
    """
    recording = open_recording(path)
    begin_ns, _ = next(recording.events(), (0, None))
    show = partial(_print_json if as_json else _print_change, begin_ns)
    with interruptible():
        messages = replay(recording, on_event=PlaybackPace(speed).wait_until) if speed else replay(recording)
        compile_kernels()
    if speed is not None:
        pace = "in real time" if speed == 1.0 else f"at {speed:g} times real time"
        print(f"slipd: replays {pace}; as fast as possible: --speed max", file=sys.stderr, flush=True)
    if publish is not None:
        asyncio.run(_publish(messages, publish or recording.settings().bus.publish or "", show, as_json=as_json))
    else:
        for topic, body in messages:
            show(topic, body)
    return all_complete([recording])


async def _publish(messages: Iterator[tuple[str, dict[str, Any]]], endpoint: str, show: Show, *, as_json: bool) -> None:
    """Publish a replay; the loop serves subscribers while a thread waits between messages.

    Args:
        messages: Topic and body of every message.
        endpoint: Where to publish; "": where a daemon of this user publishes.
        show: Prints a message too.
        as_json: Standard output has nothing but messages.
    """
    from slipd.io.access import RuntimeDirectory
    from slipd.io.publisher import Publisher
    from slipd_client.messages import encode
    from slipd_client.paths import publish_endpoint, runtime_dir

    with contextlib.ExitStack() as stack:
        if not endpoint:
            stack.enter_context(RuntimeDirectory(runtime_dir()))
        publisher = stack.enter_context(Publisher(endpoint or publish_endpoint()))
        print(f"publish: {publisher.endpoint}", file=sys.stderr if as_json else sys.stdout, flush=True)
        while (message := await asyncio.to_thread(next, messages, None)) is not None:
            publisher.publish(message[0], encode(message[1]))
            show(*message)


def _print_json(_: int, topic: str, body: dict[str, Any]) -> None:
    print(json.dumps({"topic": topic} | body, ensure_ascii=False, allow_nan=False))


def _print_change(begin_ns: int, topic: str, body: dict[str, Any]) -> None:
    if topic == WARNING_TOPIC:
        at_s = (body["t_ns"] - begin_ns) * 1e-9
        why = change_reasons(body) or "none"
        print(f"{at_s:12.3f} s  {body['finger']}: {body['previous']} → {body['level']} ({why})")


def view_recording(path: Path, listen: ListenAddress) -> None:
    """Serve the page of a recording until Ctrl-C, and print its address.

    The recording is replayed beside that; what is replayed so far can be shown.

    Raises:
        RecordingError: The file cannot be read.
        ConfigError: The recorded config has faults for this version of slipd.
        UsageError: The page cannot be served at this address.
    """
    recording = open_recording(path)
    with interruptible():
        view = RecordingView(recording)
        compile_kernels()
    settings: dict[str, object] = {"live": False, "source": str(path), "buttons": False}
    try:
        asyncio.run(_serve(PageServer(listen, settings, on_data=view.answer), view))
    except CallError as error:
        raise UsageError(str(error)) from error


async def _serve(server: PageServer, view: RecordingView) -> None:
    async with server.serving() as url:
        print(f"view: {url}", flush=True)
        view.start()
        await asyncio.Event().wait()


class RecordingView:
    """Replays a recording in a thread, and answers the page's requests for it."""

    def __init__(self, recording: Recording) -> None:
        self.blocks = RecordedBlocks()
        self._recording = recording
        self._gaps = EventGaps()
        self._messages = replay(recording, on_event=self._gaps.add)
        self._failure = ""

    def start(self) -> None:
        """Begin to replay; the thread ends with the program."""
        threading.Thread(target=self.replay, name="replay", daemon=True).start()

    def replay(self) -> None:
        """Replay the whole recording."""
        try:
            for topic, body in self._messages:
                self.blocks.add(topic, body)
        except Exception as error:
            self._failure = f"the replay ended early: {error}"
            raise
        finally:
            self.blocks.end()

    def answer(self, path: str) -> Response | None:
        """Answer ``/data/recording/N``, what there is and the changes of level from the N-th, or ``/data/block/N``.

        Gaps are begin and end of each time of which nothing is known, CLOCK_MONOTONIC, ns. A block without messages, or
        that is not replayed yet, is null.
        """
        _, _, kind, number = path.split("/") if path.count("/") == 3 else ("", "", "", "")
        if not number.isdecimal():
            return None
        if kind == "recording":
            return json_answer(self._state(int(number)))
        if kind != "block":
            return None
        data = self.blocks.block(int(number))
        return json_answer(None) if data is None else answer(HTTPStatus.OK, data, "application/json", "gzip")

    def _state(self, known: int) -> dict[str, object]:
        blocks = self.blocks
        ended = blocks.ended
        return {
            "begin_ns": blocks.begin_ns,
            "seconds": blocks.seconds,
            "ended": ended,
            "changes": blocks.changes[known:],
            "gaps": [[round(gap.begin_s * 1e9), round(gap.end_s * 1e9)] for gap in self._gaps.found],
            "fault": self._failure or self._recording.missing if ended else "",
        }


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
        self._now_ns = 0
        self._frame_ns = 0
        self._block = 0
        self._newest: dict[str, dict[str, Any]] = {}
        self._changed: dict[str, dict[str, Any]] = {}
        self._frame_changes: list[dict[str, Any]] = []
        self._frames: list[dict[str, Any]] = []

    @property
    def seconds(self) -> float:
        """How much of the recording can be shown, s."""
        return 0.0 if self.begin_ns is None else (self._now_ns - self.begin_ns) * 1e-9

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

    def _end_frame(self) -> None:
        """Make a frame of what is new, in the block of its last message."""
        if self.begin_ns is None:
            return
        block = (self._now_ns - self.begin_ns) // BLOCK_NS
        if block != self._block:
            self._end_block()
            self._block = block
        self._newest |= self._changed
        topics = self._changed if self._frames else dict(self._newest)
        self._frames.append({"now_ns": self._now_ns, "topics": topics, "changes": self._frame_changes})
        self._changed, self._frame_changes = {}, []

    def _end_block(self) -> None:
        """Write the block to the file, and only then record its place."""
        if not self._frames:
            return
        data = gzip.compress(json.dumps(self._frames, separators=(",", ":")).encode(), compresslevel=1)
        begin = os.fstat(self._fd).st_size
        os.pwrite(self._fd, data, begin)
        self._places[self._block] = (begin, len(data))
        self._frames = []
