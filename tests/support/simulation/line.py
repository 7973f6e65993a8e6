"""The line from one device to the engine, and what a fault may do to it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from slipd.devices import Decoder


class Fault:
    """What befalls the bytes of a line.

    Attributes:
        lies: What comes through is well formed and untrue.
    """

    lies = False

    def pass_on(self, data: bytes, now_ns: int) -> list[tuple[int, bytes]]:
        """Return what becomes of the bytes said at ``now_ns``: pieces, each with the time at which it arrives."""
        raise NotImplementedError


@dataclass
class Line:
    """One line between a device and the engine."""

    link: str
    listener: Decoder
    fault: Fault | None = None
    up: bool = False
    deaf: bool = False  # what is written never reaches the device
    answers: bytes = b""
    queue: deque[tuple[int, int, bytes, bool]] = field(default_factory=deque)  # due, said, bytes, true

    def say(self, data: bytes, now_ns: int) -> None:
        """The device says something at ``now_ns``."""
        if not (data and self.up):
            return
        fault = self.fault
        pieces = [(now_ns, data)] if fault is None else fault.pass_on(data, now_ns)
        for due_ns, piece in pieces:
            if piece:
                self.queue.append((due_ns, now_ns, piece, fault is None or not fault.lies))

    def take(self, now_ns: int) -> list[tuple[int, int, bytes, bool]]:
        """What has arrived by ``now_ns``; a line keeps the order."""
        arrived = []
        while self.queue and self.queue[0][0] <= now_ns:
            arrived.append(self.queue.popleft())
        return arrived
