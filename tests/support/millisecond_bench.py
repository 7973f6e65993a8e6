"""A session and its gripper, on a simulated line with a delay of a millisecond."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from nanoseconds import MS
from permits import move, set_force

from slipd.types.samples import GripperSample


@dataclass
class GripperBench:
    """Run both; a subclass keeps what the session sends.

    Attributes:
        session: The session.
        gripper: Its emulator.
        samples: What the session reported.
        mute: Whether nothing reaches the session.
    """

    session: Any
    gripper: Any
    now_ns: int = 0
    samples: list[GripperSample] = field(default_factory=list)
    sent: list[Any] = field(default_factory=list)
    mute: bool = False

    def open(self) -> Any:
        """Open the line, which takes no time."""
        self.gripper.opened(self.now_ns)
        self.write(self.session.start(self.now_ns))
        return self

    def start(self) -> Any:
        """Open the line, and run until the gripper is known."""
        return self.open().run(0.3)

    def write(self, data: bytes) -> None:
        """Keep what the session sends, and deliver the answers."""
        raise NotImplementedError

    def deliver(self, pieces: list[bytes]) -> None:
        for piece in [] if self.mute else pieces:
            self.samples += self.session.receive(piece, self.now_ns)

    def send(self) -> None:
        """Let the session write what is due now."""
        while (due_ns := self.session.next_deadline()) is not None and due_ns <= self.now_ns:
            self.write(self.session.on_time(self.now_ns))

    def run(self, seconds: float) -> Any:
        for _ in range(round(seconds * 1000)):
            self.now_ns += MS
            self.deliver(self.gripper.advance(self.now_ns))
            self.send()
        return self

    def move(self, width_m: float, speed_mps: float | None, force_n: float, seconds: float = 0.1) -> float | None:
        """Ask for a move, and run; return the force that was accepted."""
        accepted = move(self.session, width_m, speed_mps, force_n)
        self.run(seconds)
        return accepted

    def set_force(self, force_n: float, seconds: float = 0.1) -> float | None:
        """Ask for a force, and run; return the one that was accepted."""
        accepted = set_force(self.session, force_n)
        self.run(seconds)
        return accepted

    @property
    def last(self) -> GripperSample:
        return self.samples[-1]
