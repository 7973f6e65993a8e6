"""A Robotiq 2F gripper as seen from its line: Modbus registers in front of a drive that the scene moves.

Not emulated: emergency release, faults of the gripper itself, and the full stroke of a real activation.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.robotiq_2f.robotiq_registers import WIDTH_TABLE, Table, Units
from slipd.devices.shared import modbus
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameScanner
from slipd.tools.sim.emulators import EmulatedDevice, moved_jaws
from slipd.tools.sim.scene import GripCommand, Scene

FORCE_TABLE = ((0, 3.0), (60, 7.5), (120, 13.0), (180, 19.5), (255, 30.0))
"""Force byte and normal force on one pad, N. The maker publishes no curve, so this one is invented, and not linear."""

SPEED_MPS = (0.020, 0.150)
"""Speed of the fingers at speed bytes 0 and 255, m/s."""

POLL_HZ = 50.0
"""Polling rate of its session, Hz."""

ACTIVATION_NS = 500_000_000

FRAME_GAP_NS = 5_000_000
"""Longest gap within a request, ns: the bytes of a frame follow at once, and a host leaves 5 ms between frames."""

READABLE = 6
"""Registers that can be read; the driver of PickNikRobotics/ros2_robotiq_gripper (3b6cf8f) reads six."""
UNUSED = (0,) * (READABLE - robotiq_registers.REGISTERS)

WRITE_AND_READ = 23
"""Function that writes, then reads: hosts such as pyRobotiqGripper use it."""

_READ_LENGTH = 8  # of a request to read registers
_SIZE_AT = {modbus.WRITE: 6, WRITE_AND_READ: 10}  # offset of the number of bytes that a request writes
_ILLEGAL_ADDRESS = 2
_INACTIVE, _ACTIVATING, _ACTIVE = 0, 1, 3
_FOUND_MOVING, _FOUND_CLOSING, _FOUND_NONE = 0, 2, 3
_FAULT_DELAYED, _FAULT_NOT_ACTIVATED = 5, 7
_MOVING_A, _HOLDING_A_PER_N = 0.12, 0.02


def encode_reply(request: modbus.Request, registers: tuple[int, ...] = ()) -> bytes:
    """Return the answer of a device that carried out ``request``, with the values of the registers it asks for."""
    return modbus.with_checksum(modbus.reply_head(request) + struct.pack(f">{len(registers)}H", *registers))


def encode_exception(request: modbus.Request, code: int) -> bytes:
    """Return the answer of a device that refuses ``request``."""
    return modbus.with_checksum(bytes((request.unit, request.function | modbus.ERROR_FLAG, code)))


def request_scanner(unit: int) -> FrameScanner:
    """Return what finds the requests to a device at this address among the bytes that it receives."""
    return FrameScanner(bytes((unit,)), _measure, _READ_LENGTH, DecoderHealth())


def _measure(buffer: bytes, at: int) -> int:
    """Return the length of the request at ``at``; 0 if it may be incomplete, else `NO_FRAME`."""
    function = buffer[at + 1] if at + 1 < len(buffer) else modbus.READ_INPUT
    length = _READ_LENGTH
    if function in _SIZE_AT:
        size_at = at + _SIZE_AT[function]
        size = buffer[size_at] if size_at < len(buffer) else 0
        length = _SIZE_AT[function] + 1 + size + modbus.CRC_LENGTH
    elif function not in (modbus.READ_HOLDING, modbus.READ_INPUT):
        return NO_FRAME
    if at + length > len(buffer):
        return 0
    is_request = modbus.checksum_matches(buffer[at : at + length]) and parse_requests(buffer, at)
    return length if is_request else NO_FRAME


def parse_requests(buffer: bytes, at: int) -> tuple[modbus.Request, ...]:
    """Return the request at ``at``, whose checksum matches; nothing if its counts contradict each other.

    A request of `WRITE_AND_READ` returns as two: the write, then the read.
    """
    unit, function = buffer[at : at + 2]
    read = struct.unpack_from(">HH", buffer, at + 2)
    try:
        if function not in _SIZE_AT:
            return (modbus.Request(unit, function, *read),)
        size_at = at + _SIZE_AT[function]
        address, count = struct.unpack_from(">HH", buffer, size_at - 4)
        registers = struct.unpack_from(f">{buffer[size_at] // 2}H", buffer, size_at + 1)
        if count != len(registers):
            return ()
        write = modbus.Request(unit, modbus.WRITE, address, 0, registers)
        return (write,) if function == modbus.WRITE else (write, modbus.Request(unit, modbus.READ_HOLDING, *read))
    except ValueError:
        return ()


@dataclass(frozen=True, slots=True)
class Output:
    """Content of the three output registers, for emulators.

    Attributes:
        activate: rACT; its rising edge starts the activation.
        go: rGTO, go to the position.
        position: rPR, 0 open to 255 closed.
        speed: rSP, 0 to 255.
        force: rFR, 0 to 255.
    """

    activate: bool
    go: bool
    position: int
    speed: int
    force: int


def parse_output(registers: tuple[int, ...]) -> Output:
    """Read the output registers 1000 to 1002."""
    action = registers[0] >> 8
    return Output(
        activate=bool(action & robotiq_registers.ACTIVATE),
        go=bool(action & robotiq_registers.GO),
        position=registers[1] & 0xFF,
        speed=registers[2] >> 8,
        force=registers[2] & 0xFF,
    )


def write_output(registers: tuple[int, ...], request: modbus.Request) -> tuple[int, ...] | None:
    """Return the output registers after a write request; None if it writes outside them."""
    first = request.address - robotiq_registers.OUTPUT_ADDRESS
    if first < 0 or first + len(request.registers) > robotiq_registers.REGISTERS:
        return None
    written = list(registers)
    written[first : first + len(request.registers)] = request.registers
    return tuple(written)


def status_registers(
    output: Output, *, stage: int, found: int, fault: int, position: int, current_a: float
) -> tuple[int, int, int]:
    """Return the input registers 2000 to 2002 of a gripper.

    Args:
        output: Command received last; activation, "go" and requested position are echoed.
        stage: gSTA: 0 reset, 1 activating, 3 active.
        found: gOBJ: 0 moving, 1 contact while opening, 2 contact while closing, 3 at the position.
        fault: gFLT, 0 to 15.
        position: gPO, 0 open to 255 closed.
        current_a: Motor current, A; sent in steps of 10 mA, at most 2.55 A.
    """
    flags = output.activate * robotiq_registers.ACTIVATE | output.go * robotiq_registers.GO | stage << 4 | found << 6
    current = min(round(current_a * robotiq_registers.CURRENT_PER_A), 0xFF)
    return flags << 8, fault << 8 | output.position, position << 8 | current


class Gripper2F(EmulatedDevice):
    """The gripper on its line, and the drive's command to the scene.

    Args:
        width_table: Position byte / 255 and width between the pads, m.
        force_table: Force byte and normal force on one pad, N.
        unit: Its Modbus address.

    Attributes:
        activated_ns: When it was first activated, ns; None before.
    """

    def __init__(
        self,
        width_table: Table = WIDTH_TABLE,
        force_table: Table = FORCE_TABLE,
        unit: int = robotiq_registers.UNIT,
    ) -> None:
        super().__init__(POLL_HZ)
        self._force_bytes, self._forces_n = zip(*force_table, strict=True)
        self.activated_ns: int | None = None
        self._units = Units(force_table, width_table, None)
        self._requests: FrameScanner = request_scanner(unit)
        self._open_width_m = open_width_m = self._units.width_range_m[1]
        self._registers: tuple[int, ...] = (0,) * robotiq_registers.REGISTERS
        self._output = parse_output(self._registers)
        self._received_ns = 0
        self._ready_ns = 0
        self._goal = self._command = GripCommand(open_width_m, SPEED_MPS[0], self._forces_n[0])
        self._width_m, self._normal_n = open_width_m, 0.0
        self._moving, self._holding = False, False

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the answers."""
        if t_ns - self._received_ns > FRAME_GAP_NS:
            self._requests.forget()
        self._received_ns = t_ns
        return super().receive(data, t_ns)

    def _obey(self, buffer: bytes, at: int, t_ns: int) -> list[bytes]:
        answers = [self._answer(request, t_ns) for request in parse_requests(buffer, at)]
        if len(answers) == 1:
            return answers
        written, read = answers
        answer = written if written[1] & modbus.ERROR_FLAG else read
        function = WRITE_AND_READ | answer[1] & modbus.ERROR_FLAG
        return [modbus.with_checksum(bytes((answer[0], function)) + answer[2 : -modbus.CRC_LENGTH])]

    def command(self, t_ns: int) -> GripCommand:
        """Return the present command to the drive."""
        stage = self._stage(t_ns)
        if stage == _ACTIVATING:
            self._command = GripCommand(self._open_width_m, SPEED_MPS[1], self._forces_n[0])
        elif stage == _ACTIVE and self._output.go:
            self._command = self._goal
        elif not self._holding:  # stopped; a held object stays held
            self._command = GripCommand(self._width_m, self._command.speed_mps, self._command.force_n)
        return self._command

    def observe(self, scene: Scene) -> None:
        """Read the state of the scene after the command."""
        self._width_m, self._normal_n = scene.width_m, scene.normal_n
        self._moving, self._holding = scene.moving, scene.in_contact

    def _answer(self, request: modbus.Request, t_ns: int) -> bytes:
        if request.registers:
            written = write_output(self._registers, request)
            if written is None:
                return encode_exception(request, _ILLEGAL_ADDRESS)
            self._write_output(written, t_ns)
            return encode_reply(request)
        first = request.address - robotiq_registers.INPUT_ADDRESS
        if not 0 <= first <= READABLE - request.count:
            return encode_exception(request, _ILLEGAL_ADDRESS)
        return encode_reply(request, (*self._status(t_ns), *UNUSED)[first : first + request.count])

    def _write_output(self, registers: tuple[int, ...], t_ns: int) -> None:
        was_active, written = self._output.activate, parse_output(registers)
        slow, fast = SPEED_MPS
        self._registers, self._output = registers, written
        self._goal = GripCommand(
            width_m=self._units.width_m(written.position),
            speed_mps=slow + (fast - slow) * written.speed / 255,
            force_n=float(np.interp(written.force, self._force_bytes, self._forces_n)),
        )
        if written.activate and not was_active:
            self._ready_ns = t_ns + ACTIVATION_NS
            self.activated_ns = t_ns if self.activated_ns is None else self.activated_ns

    def _stage(self, t_ns: int) -> int:
        if not self._output.activate:
            return _INACTIVE
        return _ACTIVE if t_ns >= self._ready_ns else _ACTIVATING

    def _status(self, t_ns: int) -> tuple[int, ...]:
        stage, fault = self._stage(t_ns), 0
        if self._output.go and stage != _ACTIVE:
            fault = _FAULT_DELAYED if stage == _ACTIVATING else _FAULT_NOT_ACTIVATED
        return status_registers(
            self._output,
            stage=stage,
            found=_FOUND_CLOSING if self._holding else _FOUND_MOVING if self._moving else _FOUND_NONE,
            fault=fault,
            position=self._units.position(min(self._width_m, self._open_width_m)),
            current_a=_MOVING_A if self._moving else _HOLDING_A_PER_N * self._normal_n,
        )


class GripperLine(Gripper2F):
    """A gripper with a rigid part between its pads, or nothing; for its arguments see `Gripper2F`.

    Attributes:
        part_m: Width of the part, m; 0: none.
    """

    part_m = 0.0
    _now_ns = 0

    @property
    def grip_n(self) -> float:
        """Grip force on one pad, N."""
        return self._normal_n

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance the jaws to ``t_ns``; send nothing unasked."""
        command = self.command(t_ns)
        reach_m = command.speed_mps * max(t_ns - self._now_ns, 0) * 1e-9
        self._now_ns = t_ns
        self._width_m, self._moving, self._holding = moved_jaws(self._width_m, command.width_m, self.part_m, reach_m)
        self._normal_n = command.force_n if self._holding else 0.0
        return []
