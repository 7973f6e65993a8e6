"""A session with an external driver, and the driver that answers it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import msgpack
from permits import set_force

from slipd.devices.external_gripper import Session
from slipd.tools.sim.emulated_external_gripper import Driver
from slipd.types.samples import GripperSample

MS = 1_000_000


@dataclass
class Bench:
    """A session and a driver, with a delay of a millisecond."""

    session: Session = field(default_factory=Session)
    driver: Driver = field(default_factory=Driver)
    now_ns: int = 0
    samples: list[GripperSample] = field(default_factory=list)
    sent: list[dict[str, Any]] = field(default_factory=list)
    deaf: bool = False

    def start(self) -> Bench:
        self.driver.opened(self.now_ns)
        assert self.session.start(self.now_ns) == b""
        return self.run(0.1)

    def deliver(self, pieces: list[bytes]) -> None:
        for piece in pieces:
            self.samples += self.session.receive(piece, self.now_ns)

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds * 1000)):
            self.now_ns += MS
            pieces = self.driver.advance(self.now_ns)
            self.deliver([] if self.deaf else pieces)
            while (due := self.session.next_deadline()) is not None and due <= self.now_ns:
                self.write(self.session.on_time(self.now_ns))
        return self

    def write(self, data: bytes) -> None:
        unpacker = msgpack.Unpacker()
        unpacker.feed(data)
        self.sent += unpacker
        self.deliver(self.driver.receive(data, self.now_ns))

    def set_force(self, force_n: float, seconds: float = 0.1) -> float | None:
        """Ask for a force, and run; return the one that was accepted."""
        accepted = set_force(self.session, force_n)
        self.run(seconds)
        return accepted

    @property
    def last(self) -> GripperSample:
        return self.samples[-1]

    def operations(self) -> list[str]:
        return [body["op"] for body in self.sent if "op" in body]
