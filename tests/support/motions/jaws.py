"""Three emulated grippers behind their own protocols, with or without an object between the jaws.

Each is the emulator of `slipd.tools.sim`, which obeys the bytes it receives, with an independent reader of its line:
whatever the daemon writes becomes a `Sent` in metres and newtons on one pad.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar, Protocol, cast

import msgpack
import numpy as np

from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import wsg_messages
from slipd.tools.sim import emulated_external_gripper
from slipd.tools.sim import emulated_robotiq_2f as robotiq_2f_sim
from slipd.tools.sim import emulated_wsg as wsg_sim
from slipd.tools.sim import modbus_device as modbus_device_sim
from slipd.tools.sim.scene import Scene

EPS_M = 1e-6


@dataclass(frozen=True, slots=True)
class Sent:
    """A command on the wire.

    Attributes:
        kind: "activate", "move", "force", "halt" or "other", which moves nothing.
        width_m: Of a move.
        force_n: On one pad, where the command says it.
    """

    kind: str
    width_m: float | None = None
    force_n: float | None = None


class Jaws(Protocol):
    """A gripper.

    Attributes:
        CONFIG: Its config, but for the limits.
        LEAST_N: The least force that it has.
        RESOLUTION_M: A width is told, and reported, no finer.
    """

    CONFIG: str
    LEAST_N: float
    RESOLUTION_M: float

    @property
    def width_m(self) -> float: ...

    @property
    def active(self) -> bool: ...

    @property
    def grip_n(self) -> float:
        """What presses on each pad, N."""
        ...

    def opened(self, t_ns: int) -> None: ...

    def receive(self, data: bytes, t_ns: int) -> list[bytes]: ...

    def advance(self, t_ns: int) -> list[bytes]: ...

    def put(self, part_m: float) -> None:
        """Lay something between the jaws, or (0) take it away."""
        ...

    def sent(self, data: bytes) -> list[Sent]: ...


class RobotiqJaws:
    """A Robotiq 2F whose jaws move here: its emulator leaves them to a scene."""

    OPEN_M = 0.085
    FORCES = robotiq_2f_sim.FORCE_TABLE
    LEAST_N, RESOLUTION_M = FORCES[0][1], OPEN_M / 255
    CONFIG = f"""
    device = "robotiq_2f"
    port = "/dev/gripper"
    rate_hz = 50.0
    force_table = {[list(row) for row in FORCES]}
    width_table = [[0.0, {OPEN_M}], [1.0, 0.0]]
    speed_table = [[0, 0.02], [255, 0.15]]
    """

    def __init__(self) -> None:
        self.width_m, self.grip_n = self.OPEN_M, 0.0
        self._gripper = robotiq_2f_sim.Gripper2F(((0.0, self.OPEN_M), (1.0, 0.0)))
        self._part_m, self._moving, self._t_ns = 0.0, False, 0
        self._registers: tuple[int, ...] = (0, 0, 0)

    @property
    def active(self) -> bool:
        return self._gripper._stage(self._t_ns) == 3

    def opened(self, t_ns: int) -> None:
        del t_ns

    def put(self, part_m: float) -> None:
        self._part_m = part_m if self.width_m > part_m else 0.0

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        self.advance(t_ns)
        said = self._gripper.receive(data, t_ns)
        return [said] if said else []

    def advance(self, t_ns: int) -> list[bytes]:
        step_s, self._t_ns = (t_ns - self._t_ns) * 1e-9, t_ns
        command = self._gripper.command(t_ns)
        blocked = command.width_m < self._part_m <= self.width_m
        goal_m = self._part_m if blocked else command.width_m
        reach_m = command.speed_mps * step_s
        self.width_m += min(max(goal_m - self.width_m, -reach_m), reach_m)
        holds = blocked and self.width_m == self._part_m
        self.grip_n = command.force_n if holds else 0.0
        moving = not holds and abs(self.width_m - command.width_m) > EPS_M
        seen = SimpleNamespace(width_m=self.width_m, normal_n=self.grip_n, moving=moving, in_contact=holds)
        self._gripper.observe(cast(Scene, seen))
        return []

    def sent(self, data: bytes) -> list[Sent]:
        requests, _ = modbus_device_sim.parse_requests(data, robotiq_registers.UNIT)
        return [self._sent(request) for request in requests]

    def _sent(self, request: modbus.Request) -> Sent:
        if not request.registers:
            return Sent("other")
        written = robotiq_2f_sim.write_output(self._registers, request)
        assert written is not None
        self._registers = written
        told = robotiq_2f_sim.parse_output(written)
        if request.write_address == robotiq_registers.FORCE_ADDRESS:
            return Sent("force", force_n=self._newtons(told.force))
        if told.go:
            return Sent("move", self.OPEN_M * (1.0 - told.position / 255), self._newtons(told.force))
        return Sent("halt" if told.activate and len(request.registers) == 1 else "activate")

    def _newtons(self, byte: int) -> float:
        return float(np.interp(byte, *zip(*self.FORCES, strict=True)))


class WsgJaws:
    """A WSG; its forces are the sum of both fingers."""

    LEAST_N, RESOLUTION_M = wsg_sim.LIMITS.min_force / 2, EPS_M
    CONFIG = """
    device = "wsg"
    port = "tcp://127.0.0.1:1000"
    rate_hz = 50.0
    """

    def __init__(self) -> None:
        self._gripper = wsg_sim.make(0)
        sizes = wsg_sim.REQUEST_SIZES
        self._packets = PacketScanner(
            SEED_WITH_PREAMBLE, lambda one, size, _: sizes.get(one) == size, 12, DecoderHealth()
        )

    @property
    def width_m(self) -> float:
        return self._gripper.width_mm / 1000

    @property
    def active(self) -> bool:
        return "referenced" in self._gripper.words and self._gripper._goal is None

    @property
    def grip_n(self) -> float:
        holds = self._gripper._blocked and self._gripper.part_mm == self._gripper.width_mm
        return self._gripper.limit / 2 if holds else 0.0

    def opened(self, t_ns: int) -> None:
        self._gripper._connected = False  # who went before said goodbye
        self._gripper.opened(t_ns)

    def put(self, part_m: float) -> None:
        self._gripper.part_mm = part_m * 1000 if self.width_m > part_m else 0.0
        if not part_m:
            self._gripper._blocked = ""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        return self._gripper.receive(data, t_ns)

    def advance(self, t_ns: int) -> list[bytes]:
        return self._gripper.advance(t_ns)

    def sent(self, data: bytes) -> list[Sent]:
        return [self._sent(request.id, request.payload) for request in self._packets.packets(data)]

    def _sent(self, command: int, payload: bytes) -> Sent:
        if command == wsg_messages.PREPOSITION:
            return Sent("move", wsg_sim.parse_goal(payload)[1] / 1000)
        if command == wsg_messages.SET_FORCE:
            return Sent("force", force_n=wsg_messages.parse_number(payload) / 2)
        return Sent({wsg_messages.HOME: "activate", wsg_messages.STOP: "halt"}.get(command, "other"))


class DriverJaws:
    """A gripper that another program's driver holds."""

    LEAST_N, RESOLUTION_M = emulated_external_gripper.DRIVER.force_range_n[0], EPS_M
    CONFIG = """
    device = "external_gripper"
    port = "unix:///run/slipd/gripper"
    rate_hz = 50.0
    """
    KINDS: ClassVar = {"activate": "activate", "move": "move", "force": "force", "stop": "halt", "acknowledge": "other"}

    def __init__(self) -> None:
        self._driver = emulated_external_gripper.Driver()
        self._driver.part_m = 0.0
        self._unpacker = msgpack.Unpacker()

    def __deepcopy__(self, memo: dict[int, Any]) -> DriverJaws:
        """An unpacker cannot be copied; between two messages a new one does as well."""
        for unpacker in (self._unpacker, self._driver._unpacker):
            memo[id(unpacker)] = msgpack.Unpacker()
        other = DriverJaws.__new__(DriverJaws)
        vars(other).update(copy.deepcopy(vars(self), memo))
        return other

    @property
    def width_m(self) -> float:
        return self._driver._width_m

    @property
    def active(self) -> bool:
        return self._driver.report.active

    @property
    def grip_n(self) -> float:
        return self._driver.force_n if self._driver._blocked else 0.0

    def opened(self, t_ns: int) -> None:
        self._unpacker = msgpack.Unpacker()
        self._driver.opened(t_ns)

    def put(self, part_m: float) -> None:
        driver = self._driver
        driver.part_m = part_m if self.width_m > part_m else 0.0
        if not driver.part_m and driver._blocked:
            driver._blocked = False
            driver.report = replace(driver.report, object="none", force_n=0.0)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        return self._driver.receive(data, t_ns)

    def advance(self, t_ns: int) -> list[bytes]:
        return self._driver.advance(t_ns)

    def sent(self, data: bytes) -> list[Sent]:
        self._unpacker.feed(data)
        bodies: list[dict[str, Any]] = [body for body in self._unpacker if "op" in body]
        return [Sent(self.KINDS[body["op"]], body.get("width_m"), body.get("force_n")) for body in bodies]


GRIPPERS: dict[str, type[Jaws]] = {"robotiq_2f": RobotiqJaws, "wsg": WsgJaws, "external_gripper": DriverJaws}
