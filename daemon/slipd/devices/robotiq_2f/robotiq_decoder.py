"""Decoder of the status replies of a Robotiq gripper, whoever requested them."""

from __future__ import annotations

import struct

from slipd.devices import crc, modbus
from slipd.devices.framing import FixedFrames
from slipd.devices.health import DecoderHealth
from slipd.devices.robotiq_2f.robotiq_registers import REGISTERS, UNIT, parse_status
from slipd.samples import GripperSample

_STATUS = struct.Struct(f">{REGISTERS}H")
_STATUS_AT = 3
_STATUS_LENGTH = _STATUS_AT + _STATUS.size + 2


class Decoder:
    """Makes gripper samples of the status replies in a stream; everything else in it is passed over.

    ``echo_ok`` and ``width_m`` are None: the replies contain neither what was requested nor the width in metres.
    `Session` adds them.

    Args:
        unit: Modbus address of the gripper.
    """

    def __init__(self, unit: int = UNIT) -> None:
        self.health = DecoderHealth()
        self._frames = FixedFrames(bytes((unit,)), _STATUS_LENGTH, _is_status, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``t_ns``; return the status readings they complete."""
        buffer, found = self._frames.receive(data)
        self.health.good += len(found)
        return [parse_status(_STATUS.unpack_from(buffer, at + _STATUS_AT), t_ns, None) for at, _ in found]

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._frames.forget()


def _is_status(buffer: bytes, at: int) -> bool:
    if buffer[at + 1] not in (modbus.READ_HOLDING, modbus.READ_INPUT) or buffer[at + 2] != _STATUS.size:
        return False
    frame = buffer[at : at + _STATUS_LENGTH]
    return crc.modbus(frame[:-2]) == int.from_bytes(frame[-2:], "little")
