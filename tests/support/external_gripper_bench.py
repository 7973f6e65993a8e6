"""A session with an external driver, and the driver that answers it."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgpack
from millisecond_bench import GripperBench

from slipd.devices.external_gripper import Session
from slipd.tools.sim.emulated_external_gripper import Driver


@dataclass
class Bench(GripperBench):
    """A session and a driver; keeps the messages to the driver."""

    session: Session = field(default_factory=Session)
    gripper: Driver = field(default_factory=Driver)

    def write(self, data: bytes) -> None:
        unpacker = msgpack.Unpacker()
        unpacker.feed(data)
        self.sent += unpacker
        self.deliver(self.gripper.receive(data, self.now_ns))

    def operations(self) -> list[str]:
        return [body["op"] for body in self.sent if "op" in body]
