"""A WSG session and its emulator on a simulated line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from millisecond_bench import GripperBench

from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, Packet, PacketScanner
from slipd.devices.wsg import Decoder, Session
from slipd.devices.wsg import wsg_messages as wire
from slipd.tools.sim import emulated_wsg as sim
from slipd.tools.sim.emulated_wsg import Gripper

GO = (wire.SET_FORCE, wire.PREPOSITION, wire.GET_FORCE)


def updates(width_mm: float = 40.0, words: tuple[str, ...] = ("referenced",)) -> list[bytes]:
    return [
        sim.encode_number(wire.WIDTH, width_mm),
        sim.encode_number(wire.FORCE, 20.0),
        sim.encode_grasping("idle"),
        sim.encode_state(set(words)),
    ]


@dataclass
class Bench(GripperBench):
    """A session and a gripper; keeps the packets that the session sends, and may swallow or answer them."""

    session: Session = field(default_factory=Session)
    gripper: Gripper = field(default_factory=Gripper)
    swallow: Callable[[Packet], bool] = lambda _: False
    forge: Callable[[int], int | None] = lambda _: None

    def write(self, data: bytes) -> None:
        for packet in PacketScanner(SEED_WITH_PREAMBLE, lambda *_: True, 9, Decoder().health).packets(data):
            self.sent.append(packet)
            if self.swallow(packet):
                continue
            forged = self.forge(packet.id)
            answers = self.gripper.receive(wire.encode(*packet), self.now_ns) if forged is None else []
            self.deliver(answers if forged is None else [sim.encode_reply(packet.id, forged)])

    def commands(self, *, all_ids: bool = False) -> list[int]:
        """Return the ids of the commands, or of the queries too."""
        return [packet.id for packet in self.sent if all_ids or packet.id < wire.STATE]
