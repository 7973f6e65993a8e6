"""Reads a ZeroMQ socket from the event loop without missing a wake-up and without starving the loop.

The file descriptor of a ZeroMQ socket is edge-triggered: it wakes the loop once, any call on the socket may use that
wake-up up, and after that it stays silent however much is waiting. So the socket is read until it says that nothing
is left, on each wake-up and again after each send. A flood is read in gulps with rests between them: what cannot be
read meanwhile waits at the sender.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

import zmq

FRAMES_PER_WAKE = 64
"""Frames read before the rest of the loop has its turn: well below a millisecond, whatever floods in."""

WAKE_S = 0.001
"""Time after which the rest of the loop has its turn, where the messages are dear."""

_POLLIN = int(zmq.POLLIN)
"""A plain number: this is looked at for every message."""


class Drain:
    """Hands on every message of one receiving socket, frame lists in order.

    What ``on_message`` raises reaches the loop's exception handler, and reading goes on behind it.

    Args:
        socket: To be read; nobody else may read it.
        on_message: Called with the frames of one message.
        max_frames: Frames kept of one message; of a longer one, ``max_frames + 1`` are handed on to show it.
        frames_per_wake: Frames read before the rest of the loop has its turn.
        rest_s: How long it has its turn when more is waiting, s; 0: once round.
        identify: ``told`` is wanted; it costs some microseconds a message.
    """

    def __init__(
        self,
        socket: zmq.Socket[bytes],
        on_message: Callable[[list[bytes]], None],
        max_frames: int,
        frames_per_wake: int = FRAMES_PER_WAKE,
        *,
        rest_s: float = 0.0,
        identify: bool = False,
    ) -> None:
        self._socket = socket
        self._on_message = on_message
        self._keep = max_frames + 1
        self._per_wake = frames_per_wake
        self._rest_s = rest_s
        self._identify = identify
        self._first: zmq.Frame | None = None
        self._frames: list[bytes] = []
        self._again: asyncio.Handle | None = None

    def start(self) -> None:
        """Begin to read, on the running loop."""
        self._loop = asyncio.get_running_loop()
        self._fd = int(self._socket.getsockopt(zmq.FD))
        self._loop.add_reader(self._fd, self._read)
        self.after_send()

    def stop(self) -> None:
        """Read no more; to be called before the socket is closed."""
        self._loop.remove_reader(self._fd)
        if self._again is not None:
            self._again.cancel()

    def after_send(self) -> None:
        """Look whether a send used up the wake-up of something that arrived; it is then read soon."""
        if self._again is None and self._waiting():
            self._again = self._loop.call_soon(self._read)

    def told(self, name: str) -> bytes:
        """What ZeroMQ knows of the connection of the message at hand, such as "User-Id"; b"" where it does not."""
        try:
            return b"" if self._first is None else str(self._first.get(name)).encode()
        except zmq.ZMQError:
            return b""

    def _waiting(self) -> bool:
        return int(self._socket.getsockopt(zmq.EVENTS)) & _POLLIN != 0

    def _resume(self) -> None:
        self._loop.add_reader(self._fd, self._read)
        self._read()

    def _rest(self) -> None:
        """Hear nothing for a while; the wake-ups of then are made good by reading at its end."""
        self._loop.remove_reader(self._fd)
        if self._again is not None:
            self._again.cancel()
        self._again = self._loop.call_later(self._rest_s, self._resume)

    def _read(self) -> None:
        if self._again is not None:
            self._again.cancel()
            self._again = None
        until = time.monotonic() + WAKE_S
        try:
            for _ in range(self._per_wake):
                if not self._waiting():
                    return
                self._read_frame()
                if time.monotonic() > until:
                    break
            if self._rest_s:
                self._rest()
        finally:
            self.after_send()

    def _read_frame(self) -> None:
        frame = self._first_frame() if self._identify and not self._frames else self._socket.recv(zmq.NOBLOCK)
        if len(self._frames) < self._keep:
            self._frames.append(frame)
        if not self._socket.getsockopt(zmq.RCVMORE):
            frames, self._frames = self._frames, []
            self._on_message(frames)

    def _first_frame(self) -> bytes:
        self._first = self._socket.recv(zmq.NOBLOCK, copy=False)
        return self._first.bytes
