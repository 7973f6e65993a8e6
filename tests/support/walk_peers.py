"""The other ends of a walk: each gripper answers, refuses, disturbs, and tells which commands it was sent."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import msgpack

from slipd.devices.external_gripper import Session as ExternalSession
from slipd.devices.external_gripper.external_gripper_message import encode_registration, encode_report
from slipd.devices.robotiq_2f import Session as RobotiqSession
from slipd.devices.robotiq_2f import robotiq_registers as registers
from slipd.devices.shared import modbus
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import Session as WsgSession
from slipd.devices.wsg import wsg_messages as wire
from slipd.tools.sim import emulated_wsg as wsg_sim
from slipd.tools.sim import modbus_device as modbus_device_sim
from slipd.tools.sim.emulated_external_gripper import DRIVER, Driver
from slipd.tools.sim.emulated_robotiq_2f import FORCE_TABLE, Gripper2F
from slipd.tools.sim.emulated_wsg import make as make_wsg


@dataclass(frozen=True)
class SentCommand:
    """One command on the wire: "activate", "move", "force", "stop", "acknowledge" or "other"; in m and N a pad."""

    kind: str
    width_m: float | None = None
    force_n: float | None = None


class Peer(ABC):
    """The far end of the line."""

    session: Any
    widths_m: tuple[float, ...]
    forces_n: tuple[float, float]

    def __init__(self, rng: Random) -> None:
        self.rng = rng

    @abstractmethod
    def opened(self, now_ns: int) -> None:
        """The link was opened."""

    @abstractmethod
    def commands(self, data: bytes) -> list[SentCommand]:
        """What the bytes tell the gripper."""

    @abstractmethod
    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        """Take what the session wrote; return the answers."""

    @abstractmethod
    def refuse(self, data: bytes) -> list[bytes]:
        """Refusals of what the session wrote."""

    @abstractmethod
    def advance(self, now_ns: int) -> list[bytes]:
        """What is sent unasked."""

    @abstractmethod
    def disturb(self) -> list[bytes]:
        """Something happens to the gripper; what is sent at that."""

    @abstractmethod
    def inactive(self) -> None:
        """The gripper has to be activated again."""

    def fault(self) -> None:  # noqa: B027
        """The gripper has a fault; a Robotiq reports those that it bears beside its state."""

    @abstractmethod
    def width_m(self) -> float:
        """Where the fingers are."""


class RobotiqPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.085)
    forces_n = (FORCE_TABLE[0][1], FORCE_TABLE[-1][1])

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        self.session = RobotiqSession(force_table=FORCE_TABLE)
        self.gripper = Gripper2F()
        self.output = (0, 0, 0)

    def opened(self, now_ns: int) -> None:
        pass

    def requests(self, data: bytes) -> list[modbus.Request]:
        return modbus_device_sim.parse_requests(data, registers.UNIT)[0]

    def commands(self, data: bytes) -> list[SentCommand]:
        found = []
        for request in (request for request in self.requests(data) if request.registers):
            (action, *_), force = request.registers, request.registers[-1] & 0xFF
            force_n = self.session._units.newtons(force)
            if request.write_address == registers.FORCE_ADDRESS:
                found.append(SentCommand("force", force_n=force_n))
            elif action >> 8 & registers.GO:
                found.append(SentCommand("move", self.session._units.width_m(request.registers[1]), force_n))
            else:
                found.append(SentCommand("stop" if len(request.registers) == 1 else "activate"))
        return found

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        self.gripper.command(now_ns)
        return [self.gripper.receive(data, now_ns)]

    def refuse(self, data: bytes) -> list[bytes]:
        return [modbus_device_sim.encode_exception(request, 1) for request in self.requests(data)]

    def advance(self, now_ns: int) -> list[bytes]:
        return []

    def disturb(self) -> list[bytes]:
        self.gripper._write_output(self.rng.choice(((0, 0, 0), (0x0100, 0, 0))), self.rng.randrange(2) << 40)
        return []

    def inactive(self) -> None:
        self.gripper._write_output((0, 0, 0), 0)

    def width_m(self) -> float:
        return 0.0


class WsgPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.11)
    forces_n = (2.5, 40.0)

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        self.session = WsgSession()
        self.gripper = make_wsg(0)
        self.gripper.part_mm = rng.choice((0.0, 40.0))
        if rng.random() < 0.2:
            self.gripper.words.clear()

    def opened(self, now_ns: int) -> None:
        self.gripper.opened(now_ns)

    def packets(self, data: bytes) -> Any:
        return PacketScanner(SEED_WITH_PREAMBLE, lambda *_: True, 9, DecoderHealth()).packets(data)

    def commands(self, data: bytes) -> list[SentCommand]:
        found = []
        for packet in (packet for packet in self.packets(data) if packet.id < wire.STATE):
            if packet.id == wire.SET_FORCE:
                found.append(SentCommand("force", force_n=wire.parse_number(packet.payload) / wire.FINGERS))
            elif packet.id == wire.PREPOSITION:
                found.append(SentCommand("move", wsg_sim.parse_goal(packet.payload)[1] / 1000))
            else:
                found.append(
                    SentCommand(
                        {wire.HOME: "activate", wire.STOP: "stop", wire.ACKNOWLEDGE: "acknowledge"}.get(
                            packet.id, "other"
                        )
                    )
                )
        return found

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        return self.gripper.receive(data, now_ns)

    def refuse(self, data: bytes) -> list[bytes]:
        return [
            wsg_sim.encode_reply(packet.id, self.rng.choice((wire.NOT_INITIALISED, wire.ABORTED, wire.RANGE_ERROR)))
            for packet in self.packets(data)
        ]

    def advance(self, now_ns: int) -> list[bytes]:
        return self.gripper.advance(now_ns)

    def disturb(self) -> list[bytes]:
        self.gripper.words ^= {self.rng.choice(("referenced", "fast_stop", "temperature_warning"))}
        return []

    def inactive(self) -> None:
        self.gripper.words.discard("referenced")

    def fault(self) -> None:
        self.gripper.words.add("fast_stop")

    def width_m(self) -> float:
        return self.gripper.width_mm / 1000


class ExternalPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.1)
    forces_n = DRIVER.force_range_n

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        self.session = ExternalSession()
        self.driver = Driver()

    def opened(self, now_ns: int) -> None:
        self.driver.opened(now_ns)

    def messages(self, data: bytes) -> Any:
        unpacker = msgpack.Unpacker()
        unpacker.feed(data)
        return [body for body in unpacker if "op" in body]

    def commands(self, data: bytes) -> list[SentCommand]:
        return [SentCommand(body["op"], body.get("width_m"), body.get("force_n")) for body in self.messages(data)]

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        return self.driver.receive(data, now_ns)

    def refuse(self, data: bytes) -> list[bytes]:
        return [encode_report(replace(self.driver.report, id=body["id"], error="no")) for body in self.messages(data)]

    def advance(self, now_ns: int) -> list[bytes]:
        return self.driver.advance(now_ns)

    def disturb(self) -> list[bytes]:
        change = self.rng.choice(({"fault": "no_power"}, {"fault": ""}, {"active": False}, {"active": True}))
        self.driver.report = replace(self.driver.report, **change)
        name = self.rng.choice((DRIVER.name, DRIVER.name, "stranger", ""))
        return [encode_registration(replace(DRIVER, name=name))] if name and self.rng.random() < 0.4 else []

    def inactive(self) -> None:
        self.driver.report = replace(self.driver.report, active=False)

    def fault(self) -> None:
        self.driver.report = replace(self.driver.report, fault="no_power")

    def width_m(self) -> float:
        return self.driver.report.width_m or 0.0


PEERS = {"robotiq_2f": RobotiqPeer, "wsg": WsgPeer, "external_gripper": ExternalPeer}
