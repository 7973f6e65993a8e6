"""Receives a daemon's messages while at least one browser looks, and gives each browser the newest state.

A browser asks for the next frame when it has drawn the last: a slow one gets fewer frames, and delays no other.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections import deque
from collections.abc import Coroutine, Iterator
from typing import Any, NamedTuple

import zmq
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from slipd_client.errors import MessageError
from slipd_client.keys import Keys
from slipd_client.link import Link
from slipd_client.messages import WARNING_TOPIC
from slipd_client.messages.codec import read
from slipd_client.page.requests_of_page import EmulatedHand, PageRequests, Reply, refused

CHANGES = 200
"""Changes of level that are kept for a browser that is late, or comes later."""


class _Shown(NamedTuple):
    """A message for browsers.

    Attributes:
        tick: When it arrived, in ticks.
        at_s: The same in seconds of the caller's clock.
        raw: Its map.
    """

    tick: int
    at_s: float
    raw: dict[str, Any]


class Newest:
    """What was received last, for any number of browsers that each take what is new to them.

    Attributes:
        tick: Number of the newest tick; a browser that has seen it has seen everything.
        bad_reason: Why the last message that could not be read could not be; "" where all could.
    """

    def __init__(self) -> None:
        self.tick = 0
        self.bad_reason = ""
        self._boot = ""
        self._shown: dict[bytes, _Shown] = {}
        self._changes: deque[tuple[int, dict[str, Any]]] = deque(maxlen=CHANGES)

    def add(self, messages: list[list[bytes]], now_s: float) -> bool:
        """Add what has arrived since the last tick, and begin a tick where anything has; return whether it has.

        Of each topic but ``warning`` only the newest message is read.

        Args:
            messages: The frames of each message.
            now_s: Time on a clock that never goes back, s.
        """
        if not messages:
            return False
        self.tick += 1
        newest: dict[bytes, list[bytes]] = {}
        for frames in messages:
            if frames[0] == WARNING_TOPIC.encode():
                if raw := self._read(frames):
                    self._changes.append((self.tick, raw))
            else:
                newest.pop(frames[0], None)  # so that they stay in the order of their arrival
                newest[frames[0]] = frames
        for topic, frames in newest.items():
            self._show(topic, self._read(frames), now_s)
        return True

    def clear(self) -> None:
        """Forget the newest messages: nobody looks, and they grow old. The daemon sends them again."""
        self._shown.clear()

    def frame(self, since: int, now_s: float) -> str:
        """Return as JSON what has arrived after the tick ``since``, up to which a browser has seen everything.

        Each topic is sent with the age of its message, s: it may have arrived long before this browser.
        """
        new = {topic.decode(): shown for topic, shown in self._shown.items() if shown.tick > since}
        frame = {
            "topics": {topic: shown.raw for topic, shown in new.items()},
            "ages": {topic: round(max(now_s - shown.at_s, 0.0), 3) for topic, shown in new.items()},
            "changes": [raw for tick, raw in self._changes if tick > since],
            "bad": self.bad_reason,
        }
        return json.dumps(frame, separators=(",", ":"), default=bytes.hex)

    def _show(self, topic: bytes, raw: dict[str, Any] | None, now_s: float) -> None:
        """Keep a message; one that repeats an earlier one, as after a reconnection, changes nothing."""
        if raw is None:
            self._shown.pop(topic, None)  # what it replaces is no longer the newest
            return
        if raw["boot"] != self._boot:  # another run: what the one before it sent is over
            self._boot = raw["boot"]
            self._shown.clear()
        before = self._shown.get(topic)
        if before is None or raw["seq"] > before.raw["seq"]:
            self._shown[topic] = _Shown(self.tick, now_s, raw)

    def _read(self, frames: list[bytes]) -> dict[str, Any] | None:
        try:
            return read(frames)[1]
        except MessageError as error:
            self.bad_reason = str(error)
            return None


TOPICS = (b"slip", b"tactile", b"warning", b"grasp", b"motion", b"gripper", b"status")

FRAME_S = 1 / 30
"""Shortest time between two frames: nobody reads faster."""

IDLE_S = 0.25
"""A frame is sent at least so often, even where nothing is new: so a browser notices a server that is gone."""

NEXT = "next"
"""What a browser sends when it can draw another frame."""

TOUCH = "touch "
"""Before the JSON of a touch of an emulated pad; all else that a browser sends is a request, as JSON."""

VIEWERS = 32
"""Browsers at once."""


class LiveFeed:
    """The messages of one daemon for any number of browsers.

    Args:
        endpoint: Where the daemon publishes.
        requests: Carries out what people request on the page; None: the page has no buttons.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        hand: Touches the pads of an emulation; None: nothing on the page does.

    Attributes:
        viewers: Number of browsers that look.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint.
    """

    def __init__(
        self, endpoint: str, requests: PageRequests | None, keys: Keys | None = None, hand: EmulatedHand | None = None
    ) -> None:
        self.viewers = 0
        self._link = Link(zmq.SUB, endpoint, keys)
        self._requests = requests
        self._hand = hand
        self._newest = Newest()
        self._looked_at = asyncio.Event()
        self._arrived = asyncio.Condition()

    async def run(self) -> None:
        """Receive for as long as the task runs; nothing is subscribed to while nobody looks."""
        try:
            while True:
                await self._looked_at.wait()
                self._subscribe(zmq.SUBSCRIBE)
                await self._receive()
                self._subscribe(zmq.UNSUBSCRIBE)
                self._receive_all()
                self._newest.clear()
        finally:
            self._link.close()

    async def _receive(self) -> None:
        """Receive until nobody looks any more."""
        while self.viewers:
            await asyncio.sleep(FRAME_S)
            if self._newest.add(self._receive_all(), time.monotonic()):
                async with self._arrived:
                    self._arrived.notify_all()

    def _subscribe(self, option: int) -> None:
        for topic in TOPICS:
            self._link.socket.setsockopt(option, topic)

    def _receive_all(self) -> list[list[bytes]]:
        """Return every message that has arrived."""
        return list(iter(self._link.receive_now, None))

    async def view(self, connection: ServerConnection) -> None:
        """Serve one browser until it leaves."""
        if self.viewers >= VIEWERS:
            await connection.close(1013, f"{VIEWERS} browsers look already")
            return
        ready = asyncio.Event()
        asked: asyncio.Queue[str] = asyncio.Queue(1)
        touches: asyncio.Queue[str] = asyncio.Queue(1)
        jobs = [self._send(connection, ready), self._carry_out(connection, asked)]
        if self._hand is not None:
            jobs += [self._hand.send_fingers(connection), _touch(connection, self._hand, touches)]
        with self._looking(), contextlib.suppress(ConnectionClosed):
            await _first_of(self._listen(connection, ready, asked, touches), *jobs)

    async def _listen(
        self, connection: ServerConnection, ready: asyncio.Event, asked: asyncio.Queue[str], touches: asyncio.Queue[str]
    ) -> None:
        async for text in connection:
            if text == NEXT:
                ready.set()
            elif isinstance(text, str) and self._hand is not None and text.startswith(TOUCH):
                await touches.put(text.removeprefix(TOUCH))
            elif asked.full():  # it is refused while another is carried out: none is carried out later
                await _reply(connection, refused("busy: the request before it is not answered yet"))
            elif isinstance(text, str):
                asked.put_nowait(text)

    async def _carry_out(self, connection: ServerConnection, asked: asyncio.Queue[str]) -> None:
        """Carry out the requests of one browser, one after another."""
        if self._requests is None:
            while True:
                await asked.get()
                await _reply(connection, refused("this view takes no requests: it was started without buttons"))
        await connection.send(json.dumps({"permission": await self._requests.permission()}))
        while True:
            text = await asked.get()
            asked.put_nowait(text)  # it stays until it is answered, so that another is refused
            reply = await self._requests.carry_out(text)
            asked.get_nowait()
            await _reply(connection, reply)

    async def _send(self, connection: ServerConnection, ready: asyncio.Event) -> None:
        """Send a frame whenever the browser is ready and anything is new, and at least every ``IDLE_S``."""
        seen = 0
        while True:
            await ready.wait()
            ready.clear()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._newer_than(seen), IDLE_S)
            frame = self._newest.frame(seen, time.monotonic())
            seen = self._newest.tick
            await connection.send(frame)

    async def _newer_than(self, seen: int) -> None:
        async with self._arrived:
            await self._arrived.wait_for(lambda: self._newest.tick > seen)

    @contextlib.contextmanager
    def _looking(self) -> Iterator[None]:
        self.viewers += 1
        self._looked_at.set()
        try:
            yield
        finally:
            self.viewers -= 1
            if not self.viewers:
                self._looked_at.clear()


async def _touch(connection: ServerConnection, hand: EmulatedHand, touches: asyncio.Queue[str]) -> None:
    """Carry out the touches of one browser, one after another."""
    while True:
        await connection.send(json.dumps({"touched": await hand.touch(await touches.get())}))


async def _reply(connection: ServerConnection, reply: Reply) -> None:
    await connection.send(json.dumps({"reply": reply}))


async def _first_of(*jobs: Coroutine[Any, Any, None]) -> None:
    """Run jobs until the first ends, end the others, and raise what it raised."""
    tasks = [asyncio.create_task(job) for job in jobs]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
