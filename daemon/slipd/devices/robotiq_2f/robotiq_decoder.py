"""Decoder of the status replies of a Robotiq gripper, for recordings without their requests."""

from __future__ import annotations

import struct

from slipd.devices.robotiq_2f.robotiq_registers import REGISTERS, UNIT, parse_status
from slipd.devices.shared import crc, modbus
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.frame_scanner import FixedLengthScanner
from slipd.types.samples import GripperSample

_STATUS = struct.Struct(f">{REGISTERS}H")
_STATUS_AT = 3
_STATUS_LENGTH = _STATUS_AT + _STATUS.size + 2


class Decoder:
    """Decode the status replies in a stream to gripper samples; skip everything else.

    ``echo_ok`` and ``width_m`` are None, because the replies contain neither the request nor the width in metres;
    `Session` sets them.

    Args:
        unit: Modbus address of the gripper.
    """

    def __init__(self, unit: int = UNIT) -> None:
        self.health = DecoderHealth()
        self._frames = FixedLengthScanner(bytes((unit,)), _STATUS_LENGTH, _is_status, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the status readings they complete."""
        buffer, found = self._frames.receive(data)
        self.health.good += len(found)
        return [parse_status(_STATUS.unpack_from(buffer, at + _STATUS_AT), t_ns, None) for at, _ in found]

    def forget(self) -> None:
        """Drop a partial reply, because the line was closed."""
        self._frames.forget()


def _is_status(buffer: bytes, at: int) -> bool:
    if buffer[at + 1] not in (modbus.READ_HOLDING, modbus.READ_INPUT) or buffer[at + 2] != _STATUS.size:
        return False
    frame = buffer[at : at + _STATUS_LENGTH]
    return crc.modbus(frame[:-2]) == int.from_bytes(frame[-2:], "little")
