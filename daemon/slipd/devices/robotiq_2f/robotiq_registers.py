"""Registers of the Robotiq 2F grippers: bit layout and parsers.

Three output registers (from 1000) command the gripper, three input registers (from 2000) report its status. Both are
six bytes, high byte of each register first: action or status flags, reserved or fault, position request or its echo,
then speed and force, or position and current. Source: Robotiq 2F instruction manual, gripper register mapping.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from slipd.devices.shared import checksums, modbus
from slipd.devices.shared.frame_scanner import FixedLengthScanner, FrameDecoder
from slipd.types.samples import GripperSample

UNIT = 9
OUTPUT_ADDRESS = 1000
INPUT_ADDRESS = 2000
REGISTERS = 3
FORCE_ADDRESS = 1002

ACTIVATE = 0x01
GO = 0x08
_STAGE_ACTIVATING = 1
_STAGE_ACTIVE = 3
_OBJECTS = ("moving", "contact_opening", "contact_closing", "none")
_FAULTS = {
    0x0: "",
    0x5: "activation_needed",
    0x7: "activation_bit_not_set",
    0x8: "over_temperature",
    0x9: "no_communication",
    0xA: "under_voltage",
    0xB: "automatic_release",
    0xC: "internal",
    0xD: "activation_failed",
    0xE: "overcurrent",
    0xF: "automatic_release_completed",
}
CURRENT_PER_A = 100


def parse_status(
    registers: tuple[int, ...], t_ns: int, requested: int | None, width_m: Callable[[int], float] | None = None
) -> GripperSample:
    """Read the input registers 2000 to 2002, received at ``t_ns``.

    The object bits mean "moving" only while the gripper goes to a position; a contact remains one after a halt.

    Args:
        registers: The three registers.
        t_ns: When the reply was received.
        requested: Position byte requested last, for ``echo_ok``; None if there was none. The gripper echoes neither
            force nor speed.
        width_m: Converts a position byte to a width, m; None if the conversion is unknown.
    """
    flags, (fault, echo) = registers[0] >> 8, divmod(registers[1], 256)
    position, current = divmod(registers[2], 256)
    stage, found = flags >> 4 & 3, flags >> 6
    moving = (found == 0 and bool(flags & GO)) or stage == _STAGE_ACTIVATING
    return GripperSample(
        t_ns=t_ns,
        device_time_ns=None,
        active=bool(flags & ACTIVATE) and stage == _STAGE_ACTIVE,
        width_m=None if width_m is None else width_m(position),
        moving=moving,
        object=_OBJECTS[found] if found or moving else "none",
        fault=_fault_name(fault),
        echo_ok=None if requested is None else echo == requested,
        current_a=current / CURRENT_PER_A,
    )


def is_activating(registers: tuple[int, ...]) -> bool:
    """Return whether gSTA reports an activation in progress."""
    return registers[0] >> 12 & 3 == _STAGE_ACTIVATING


def _fault_name(fault: int) -> str:
    gripper, controller = fault & 0xF, fault >> 4
    if gripper or not controller:
        return _FAULTS.get(gripper, f"fault_{gripper}")
    return f"controller_{controller}"


_STATUS = struct.Struct(f">{REGISTERS}H")
_STATUS_AT = 3
_STATUS_LENGTH = _STATUS_AT + _STATUS.size + 2


class Decoder(FrameDecoder):
    """Decode the status replies in a stream to gripper samples; skip everything else.

    ``echo_ok`` and ``width_m`` are None, because the replies contain neither the request nor the width in metres;
    `Session` sets them.

    Args:
        unit: Modbus address of the gripper.
    """

    def __init__(self, unit: int = UNIT) -> None:
        super().__init__()
        self._frames = FixedLengthScanner(bytes((unit,)), _STATUS_LENGTH, _is_status, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the status readings they complete."""
        buffer, found = self._frames.receive(data)
        self.health.good += len(found)
        return [parse_status(_STATUS.unpack_from(buffer, at + _STATUS_AT), t_ns, None) for at, _ in found]


def _is_status(buffer: bytes, at: int) -> bool:
    if buffer[at + 1] not in (modbus.READ_HOLDING, modbus.READ_INPUT) or buffer[at + 2] != _STATUS.size:
        return False
    frame = buffer[at : at + _STATUS_LENGTH]
    return checksums.modbus(frame[:-2]) == int.from_bytes(frame[-2:], "little")
