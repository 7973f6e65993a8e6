"""Receives a daemon's messages while at least one browser looks, and gives each browser the newest state.

A browser asks for the next frame when it has drawn the last: a slow one gets fewer frames, and delays no other.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import Coroutine, Iterator
from typing import TYPE_CHECKING, Any

import zmq
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from slipd_client.link import Link
from slipd_client.page.newest import Newest
from slipd_client.page.requests_of_page import PageRequests, Reply, refused

if TYPE_CHECKING:
    from slipd_client.keys import Keys
    from slipd_client.page.emulated_hand import EmulatedHand

TOPICS = (b"slip", b"tactile", b"warning", b"grasp", b"gripper", b"status")

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
                self._take()
                self._newest.clear()
        finally:
            self._link.close()

    async def _receive(self) -> None:
        """Receive until nobody looks any more."""
        due_s = time.monotonic()
        while self.viewers:
            due_s = max(due_s + FRAME_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())
            if self._newest.add(self._take(), time.monotonic()):
                async with self._arrived:
                    self._arrived.notify_all()

    def _subscribe(self, option: int) -> None:
        for topic in TOPICS:
            self._link.socket.setsockopt(option, topic)

    def _take(self) -> list[list[bytes]]:
        """Return every message that has arrived."""
        found = []
        while (frames := self._link.take()) is not None:
            found.append(frames)
        return found

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
            jobs += [self._hand.tell(connection), _touch(connection, self._hand, touches)]
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
            elif isinstance(text, str):
                await self._accept(connection, asked, text)

    async def _accept(self, connection: ServerConnection, asked: asyncio.Queue[str], text: str) -> None:
        """Pass a request on, or refuse it while another is carried out: none is carried out later."""
        try:
            asked.put_nowait(text)
        except asyncio.QueueFull:
            await _reply(connection, refused("busy: the request before it is not answered yet"))

    async def _carry_out(self, connection: ServerConnection, asked: asyncio.Queue[str]) -> None:
        """Carry out the requests of one browser, one after another."""
        if self._requests is None:
            while True:
                await asked.get()
                await _reply(connection, refused("this view only shows: it was started without buttons"))
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
