"""Three emulated grippers behind their own protocols, and independent readers of what is written to them.

Each is an emulator of `slipd.tools.sim`, which obeys the bytes that it receives. It holds a part, refuses, fails, and
tells which commands it was sent, in metres, and in newtons on one pad.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from functools import cached_property
from random import Random
from typing import Any

import msgpack
import numpy as np
from gripper_registers import read_requests

from slipd.devices.external_gripper import Session as ExternalSession
from slipd.devices.robotiq_2f import Session as RobotiqSession
from slipd.devices.robotiq_2f import robotiq_registers as registers
from slipd.devices.shared import modbus
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import Session as WsgSession
from slipd.devices.wsg import wsg_messages as wire
from slipd.tools.sim import emulated_robotiq_2f as robotiq_sim
from slipd.tools.sim import emulated_wsg as wsg_sim
from slipd.tools.sim.emulated_external import DRIVER, Driver, encode_driver_message
from slipd.tools.sim.emulated_robotiq_2f import FORCE_TABLE, GripperLine


@dataclass(frozen=True)
class SentCommand:
    """One command on the wire: "activate", "move", "force", "stop", "acknowledge" or "other"; in m, and N on a pad."""

    kind: str
    width_m: float | None = None
    force_n: float | None = None


class Peer:
    """The far end of a gripper's line.

    Attributes:
        CONFIG: Its config, but for the limits.
        RESOLUTION_M: A width is told, and reported, no finer.
        widths_m: Some that it can reach, the widest last.
        forces_n: Its least and largest force.
        line: The emulator.
        session: What talks to it.
    """

    CONFIG: str
    RESOLUTION_M = 1e-6
    widths_m: tuple[float, ...]
    forces_n: tuple[float, float]
    line: Any
    session: Any

    def __init__(self, rng: Random | None = None) -> None:
        self.rng = rng or Random(0)

    def opened(self, now_ns: int) -> None:
        """The link was opened."""
        self.line.opened(now_ns)

    def left(self) -> None:
        """Who was connected said goodbye."""

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        """Take what the session wrote; return the answers."""
        return list(self.line.receive(data, now_ns))

    def advance(self, now_ns: int) -> list[bytes]:
        """Let time pass; return what is sent unasked."""
        return list(self.line.advance(now_ns))

    def put(self, part_m: float) -> None:
        """Lay something between the jaws, or (0) take it away."""
        self.line.part_m = part_m if self.width_m > part_m else 0.0

    @property
    def grip_n(self) -> float:
        """What presses on each pad, N."""
        return float(self.line.grip_n)

    @property
    def width_m(self) -> float:
        """Where the fingers are."""
        raise NotImplementedError


class RobotiqPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.085)
    forces_n = (FORCE_TABLE[0][1], FORCE_TABLE[-1][1])
    RESOLUTION_M = 0.085 / 255
    CONFIG = f"""
    device = "robotiq_2f"
    port = "/dev/gripper"
    rate_hz = 50.0
    force_table = {[list(row) for row in FORCE_TABLE]}
    width_table = [[0.0, 0.085], [1.0, 0.0]]
    speed_table = [[0, 0.02], [255, 0.15]]
    """

    def __init__(self, rng: Random | None = None) -> None:
        super().__init__(rng)
        self.gripper = self.line = GripperLine(((0.0, 0.085), (1.0, 0.0)))

    @cached_property
    def session(self) -> RobotiqSession:
        return RobotiqSession(force_table=FORCE_TABLE, width_table=((0.0, 0.085), (1.0, 0.0)))

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        self.line.advance(now_ns)
        return super().hear(data, now_ns)

    def requests(self, data: bytes) -> list[modbus.Request]:
        return read_requests(data)

    def commands(self, data: bytes) -> list[SentCommand]:
        return [self._command(request) for request in self.requests(data) if request.registers]

    def _command(self, request: modbus.Request) -> SentCommand:
        force_n = float(np.interp(request.registers[-1] & 0xFF, *zip(*FORCE_TABLE, strict=True)))
        if request.address == registers.FORCE_ADDRESS:
            return SentCommand("force", force_n=force_n)
        if request.registers[0] >> 8 & registers.GO:
            return SentCommand("move", 0.085 * (1.0 - (request.registers[1] & 0xFF) / 255), force_n)
        return SentCommand("stop" if len(request.registers) == 1 else "activate")

    def inactive(self) -> None:
        self.gripper._write_output((0, 0, 0), 0)

    def refuse(self, data: bytes) -> list[bytes]:
        return [robotiq_sim.encode_exception(request, 1) for request in self.requests(data)]

    def disturb(self) -> list[bytes]:
        self.gripper._write_output(self.rng.choice(((0, 0, 0), (0x0100, 0, 0))), self.rng.randrange(2) << 40)
        return []

    @property
    def active(self) -> bool:
        return self.gripper._stage(self.line._now_ns) == 3

    @property
    def width_m(self) -> float:
        return self.line._width_m


class WsgPeer(Peer):
    """A WSG; its forces are the sum of both fingers."""

    widths_m = (0.0, 0.02, 0.06, 0.11)
    forces_n = (2.5, 40.0)
    CONFIG = """
    device = "wsg"
    port = "tcp://127.0.0.1:1000"
    rate_hz = 50.0
    """

    def __init__(self, rng: Random | None = None) -> None:
        super().__init__(rng)
        self.line = self.gripper = wsg_sim.Gripper()
        if rng is not None:
            self.gripper.part_m = rng.choice((0.0, 0.04))
            if rng.random() < 0.2:
                self.gripper.words.clear()

    @cached_property
    def session(self) -> WsgSession:
        return WsgSession()

    def left(self) -> None:
        self.gripper._connected = False

    def inactive(self) -> None:
        self.gripper.words.discard("referenced")

    def fault(self) -> None:
        self.gripper.words.add("fast_stop")

    def packets(self, data: bytes) -> Any:
        return PacketScanner(SEED_WITH_PREAMBLE, lambda *_: True, 9, DecoderHealth()).packets(data)

    def commands(self, data: bytes) -> list[SentCommand]:
        return [self._command(packet.id, packet.payload) for packet in self.packets(data) if packet.id < wire.STATE]

    def _command(self, command: int, payload: bytes) -> SentCommand:
        if command == wire.SET_FORCE:
            return SentCommand("force", force_n=wire.parse_number(payload) / 2)
        if command == wire.PREPOSITION:
            return SentCommand("move", wsg_sim.parse_goal(payload)[1] / 1000)
        words = {wire.HOME: "activate", wire.STOP: "stop", wire.ACKNOWLEDGE: "acknowledge"}
        return SentCommand(words.get(command, "other"))

    def refuse(self, data: bytes) -> list[bytes]:
        statuses = wsg_sim.NOT_INITIALISED, wire.ABORTED, wsg_sim.RANGE_ERROR
        return [wsg_sim.encode_reply(packet.id, self.rng.choice(statuses)) for packet in self.packets(data)]

    def disturb(self) -> list[bytes]:
        self.gripper.words ^= {self.rng.choice(("referenced", "fast_stop", "temperature_warning"))}
        return []

    def put(self, part_m: float) -> None:
        super().put(part_m)
        if not part_m:
            self.gripper._blocked = ""

    @property
    def grip_n(self) -> float:
        return super().grip_n if 1000 * self.gripper.part_m == self.gripper.width_mm else 0.0

    @property
    def active(self) -> bool:
        return "referenced" in self.gripper.words and self.gripper._goal is None

    @property
    def width_m(self) -> float:
        return self.gripper.width_mm / 1000


class ExternalPeer(Peer):
    """A gripper that another program's driver holds."""

    widths_m = (0.0, 0.02, 0.06, 0.1)
    forces_n = DRIVER.force_range_n
    CONFIG = """
    device = "external_gripper"
    port = "unix:///run/slipd/gripper"
    rate_hz = 50.0
    """

    def __init__(self, rng: Random | None = None) -> None:
        super().__init__(rng)
        self.line = self.driver = Driver()
        self.driver.part_m = 0.0 if rng is None else self.driver.part_m

    def __deepcopy__(self, memo: dict[int, Any]) -> ExternalPeer:
        """An unpacker cannot be copied; between two messages a new one does as well."""
        memo[id(self.driver._unpacker)] = msgpack.Unpacker()
        other = ExternalPeer.__new__(ExternalPeer)
        vars(other).update(copy.deepcopy(vars(self), memo))
        return other

    @cached_property
    def session(self) -> ExternalSession:
        return ExternalSession()

    def inactive(self) -> None:
        self.driver.report = replace(self.driver.report, active=False)

    def fault(self) -> None:
        self.driver.report = replace(self.driver.report, fault="no_power")

    def messages(self, data: bytes) -> Any:
        unpacker = msgpack.Unpacker()
        unpacker.feed(data)
        return [body for body in unpacker if "op" in body]

    def commands(self, data: bytes) -> list[SentCommand]:
        return [SentCommand(body["op"], body.get("width_m"), body.get("force_n")) for body in self.messages(data)]

    def refuse(self, data: bytes) -> list[bytes]:
        return [
            encode_driver_message(replace(self.driver.report, id=body["id"], error="no"))
            for body in self.messages(data)
        ]

    def disturb(self) -> list[bytes]:
        change = self.rng.choice(({"fault": "no_power"}, {"fault": ""}, {"active": False}, {"active": True}))
        self.driver.report = replace(self.driver.report, **change)
        name = self.rng.choice((DRIVER.name, DRIVER.name, "stranger", ""))
        return [encode_driver_message(replace(DRIVER, name=name))] if name and self.rng.random() < 0.4 else []

    def put(self, part_m: float) -> None:
        super().put(part_m)
        if not part_m and self.driver._blocked:
            self.driver._blocked = False
            self.driver.report = replace(self.driver.report, object="none", force_n=0.0)

    @property
    def active(self) -> bool:
        return self.driver.report.active

    @property
    def width_m(self) -> float:
        return self.driver._width_m


PEERS: dict[str, Any] = {"robotiq_2f": RobotiqPeer, "wsg": WsgPeer, "external_gripper": ExternalPeer}
