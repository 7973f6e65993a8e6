"""A WSG session and its emulator on a simulated line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from permits import move, set_force

from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, Packet, PacketScanner
from slipd.devices.wsg import Decoder, Session
from slipd.devices.wsg import wsg_messages as wire
from slipd.tools.sim import emulated_wsg as sim
from slipd.tools.sim.emulated_wsg import Gripper, make
from slipd.types.samples import GripperSample

MS = 1_000_000
GO = (wire.SET_FORCE, wire.PREPOSITION, wire.GET_FORCE)


def updates(width_mm: float = 40.0, force: float = 20.0, words: tuple[str, ...] = ("referenced",)) -> list[bytes]:
    return [
        sim.encode_number(wire.WIDTH, width_mm),
        sim.encode_number(wire.FORCE, force),
        sim.encode_grasping("idle"),
        sim.encode_state(set(words)),
    ]


@dataclass
class Bench:
    """A session and a gripper, with a delay of a millisecond; keeps what the session sends, and may swallow it."""

    session: Session = field(default_factory=Session)
    gripper: Gripper = field(default_factory=lambda: make(0))
    now_ns: int = 0
    samples: list[GripperSample] = field(default_factory=list)
    sent: list[Packet] = field(default_factory=list)
    swallow: Callable[[Packet], bool] = lambda _: False
    mute: bool = False
    forge: Callable[[int], int | None] = lambda _: None

    def start(self) -> Bench:
        self.gripper.opened(self.now_ns)
        self.write(self.session.start(self.now_ns))
        return self.run(0.3)

    def write(self, data: bytes) -> None:
        for packet in PacketScanner(SEED_WITH_PREAMBLE, lambda *_: True, 9, Decoder().health).packets(data):
            self.sent.append(packet)
            if self.swallow(packet):
                continue
            forged = self.forge(packet.id)
            answers = self.gripper.receive(wire.encode(*packet), self.now_ns) if forged is None else []
            self.deliver(answers if forged is None else [sim.encode_reply(packet.id, forged)])

    def deliver(self, pieces: list[bytes]) -> None:
        for piece in [] if self.mute else pieces:
            self.samples += self.session.receive(piece, self.now_ns)

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds * 1000)):
            self.now_ns += MS
            self.deliver(self.gripper.advance(self.now_ns))
            while (due := self.session.next_deadline()) is not None and due <= self.now_ns:
                self.write(self.session.on_time(self.now_ns))
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

    def commands(self) -> list[int]:
        return [packet.id for packet in self.sent if packet.id < wire.STATE]
