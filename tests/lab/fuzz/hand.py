"""The gripper at the far end of its line: it understands the bytes by itself, and keeps whatever it was told.

Nothing here is the daemon's: frames, checksum and tables are written down a second time (Robotiq 2F instruction manual,
Modbus RTU), so that a fault of the daemon's own encoder cannot hide.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from itertools import pairwise
from random import Random

FORCE_TABLE = ((0, 3.0), (60, 7.5), (120, 13.0), (180, 19.5), (255, 30.0))
OPEN_M, FASTEST_MPS = 0.085, 0.150
MS = 1_000_000

_UNIT, _OUTPUT, _INPUT, _REGISTERS = 9, 1000, 2000, 3
_WRITE, _READS = 16, (3, 4)
_ACTIVATE, _GO = 0x01, 0x08
_RESET, _ACTIVATING, _ACTIVE = 0, 1, 3
_MOVING, _CLOSED_ON, _AT_GOAL = 0, 2, 3
_ACTIVATION_NS = 60 * MS
"""Short beside a real one: a gripper that is always getting ready would never be asked to do anything."""

_FULL_STROKE_NS = 300 * MS
OBJECT_AT = 110.0
"""Position at which the fingers meet the object."""

FAULTS = (5, 7, 8, 9, 10, 11, 12, 13, 14, 15)


@dataclass(frozen=True, slots=True)
class Told:
    """One frame that told the gripper something.

    Attributes:
        addresses: The registers it wrote.
        action: The action byte in force behind it.
        reserved: What stands in bits that must be zero.
        position: Position byte in force.
        force: Force byte in force.
    """

    addresses: range
    action: int
    reserved: int
    position: int
    force: int

    @property
    def goes(self) -> bool:
        """It lets the fingers move."""
        return bool(self.action & _GO) and _OUTPUT in self.addresses

    @property
    def activates(self) -> bool:
        """It begins or ends an activation, on which real fingers open."""
        return not self.action & _ACTIVATE and _OUTPUT in self.addresses

    @property
    def forces(self) -> bool:
        """It says with what force."""
        return _OUTPUT + 2 in self.addresses and bool(self.action & _ACTIVATE)


@dataclass(frozen=True, slots=True)
class Said:
    """What a status that the gripper sent says: a position byte, whether it is active, holds, or reports a fault."""

    position: int
    active: bool
    holds: bool
    fault: int


def newtons(byte: int) -> float:
    """The force on one pad at a force byte."""
    for (low, low_n), (high, high_n) in pairwise(FORCE_TABLE):
        if byte <= high:
            return low_n + (high_n - low_n) * (byte - low) / (high - low)
    return FORCE_TABLE[-1][1]


class Hand:
    """A gripper between whose fingers something lies, now and then.

    Attributes:
        fault: Its fault nibble.
        silent: It hears, and does not answer.
        deaf: It hears nothing.
        lying: Its echo of the position is wrong.
        garbled: Its answers are damaged on their way.
        told: Everything that it was told since this was last emptied.
        said: What the last answer said, where that was its status.
        bad_frames: Bytes that were no frame; a sound host sends none.
    """

    def __init__(self, rng: Random) -> None:
        self._rng = rng
        self.fault = 0
        self.silent = self.deaf = self.lying = self.garbled = False
        self.object_there = True
        self.told: list[Told] = []
        self.said: Said | None = None
        self.bad_frames = 0
        self._registers = [0] * _REGISTERS
        self._stage, self._ready_ns, self._now_ns = _RESET, 0, 0
        self._at = 0.0

    @property
    def holds(self) -> bool:
        """The fingers press on the object."""
        return self.object_there and self._at >= OBJECT_AT and self._goal >= OBJECT_AT

    @property
    def grip_n(self) -> float:
        """The force on each pad."""
        return newtons(self._registers[2] & 0xFF) if self.holds else 0.0

    def power_cycle(self) -> None:
        """It forgets what it was told."""
        self._registers = [0] * _REGISTERS
        self._stage = _RESET

    def advance(self, now_ns: int) -> None:
        """Let the fingers go on."""
        passed, self._now_ns = now_ns - self._now_ns, now_ns
        if self._stage == _ACTIVATING and now_ns >= self._ready_ns:
            self._stage = _ACTIVE
        if self._stage == _ACTIVE and self._registers[0] >> 8 & _GO:
            reach = 255.0 * passed / _FULL_STROKE_NS
            goal = min(self._goal, OBJECT_AT) if self.object_there and self._at <= OBJECT_AT else self._goal
            self._at += min(max(goal - self._at, -reach), reach)

    @property
    def _goal(self) -> float:
        return float(self._registers[1] & 0xFF)

    def receive(self, data: bytes, now_ns: int) -> bytes:
        """Take what the host wrote; return the answer."""
        self.advance(now_ns)
        self.said = None
        if self.deaf:
            return b""
        if len(data) < 4 or data[0] != _UNIT or _crc(data[:-2]) != data[-2:]:
            self.bad_frames += 1
            return b""
        answer = self._write(data) if data[1] == _WRITE else self._read(data)
        if self.silent:
            self.said = None
            return b""
        answer += _crc(answer)
        if self.garbled:
            at = self._rng.randrange(len(answer))
            answer = answer[:at] + bytes((answer[at] ^ 0x10,)) + answer[at + 1 :]
            self.said = None
        return answer

    def _write(self, data: bytes) -> bytes:
        first, count, size = struct.unpack_from(">HHB", data, 2)
        values = struct.unpack(f">{count}H", data[7:-2]) if size == 2 * count == len(data) - 9 else ()
        addresses = range(first, first + count)
        if not values or not set(addresses) <= set(range(_OUTPUT, _OUTPUT + _REGISTERS)):
            self.bad_frames += 1
            return bytes((_UNIT, _WRITE | 0x80, 2))
        was_active = bool(self._registers[0] >> 8 & _ACTIVATE)
        self._registers[first - _OUTPUT : first - _OUTPUT + count] = values
        action, low = divmod(self._registers[0], 256)
        reserved = low | self._registers[1] >> 8 | action & ~(_ACTIVATE | _GO)
        position, force = self._registers[1] & 0xFF, self._registers[2] & 0xFF
        self.told.append(Told(addresses, action, reserved, position, force))
        if not action & _ACTIVATE:
            self._stage = _RESET
        elif not was_active:
            self._stage, self._ready_ns, self.fault = _ACTIVATING, self._now_ns + _ACTIVATION_NS, 0
            self._at = 0.0
        return data[:6]

    def _read(self, data: bytes) -> bytes:
        function, first, count = data[1], *struct.unpack_from(">HH", data, 2)
        if function not in _READS or (first, count) != (_INPUT, _REGISTERS) or len(data) != 8:
            self.bad_frames += 1
            return bytes((_UNIT, function | 0x80, 2))
        action = self._registers[0] >> 8
        moving = self._stage == _ACTIVE and bool(action & _GO) and abs(self._goal - self._at) > 0.5 and not self.holds
        found = _CLOSED_ON if self.holds else _MOVING if moving else _AT_GOAL
        position = round(self._at)
        flags = action & (_ACTIVATE | _GO) | self._stage << 4 | found << 6
        echo = (self._registers[1] & 0xFF) ^ (0x40 if self.lying else 0)
        self.said = Said(position, self._stage == _ACTIVE and bool(action & _ACTIVATE), self.holds, self.fault)
        return bytes((_UNIT, function, 6, flags, 0, self.fault, echo, position, 10))


def _crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, low byte first."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _CRC[(value ^ byte) & 0xFF]
    return value.to_bytes(2, "little")


def _crc_of(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_CRC = [_crc_of(byte) for byte in range(256)]
