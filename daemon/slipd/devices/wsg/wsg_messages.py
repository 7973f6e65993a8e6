"""Messages of Weiss/Schunk WSG grippers: byte layout, encoders and parsers for both ends of the line.

The packets are those of `slipd.devices.shared.weiss_packets`, with a checksum that includes the preamble. A reply has
the id of its command and begins with a status (u16). Widths are mm, speeds mm/s; numbers are little-endian, and real
numbers f32. **Forces are the sum of both fingers**, twice the force on one pad. Sources: the fieldbus manual, and
the public WSG drivers in nalt/wsg50-ros-pkg at bca5f46, RobotLocomotion/drake-schunk-driver at d07fcfc, and
roboticslibrary/rl at 91df9f2.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

import numpy as np

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE

DISCONNECT = 0x07
HOME = 0x20
PREPOSITION = 0x21
STOP = 0x22
ACKNOWLEDGE = 0x24
SET_FORCE = 0x32
GET_FORCE = 0x33
OVERDRIVE = 0x37
STATE = 0x40
GRASPING = 0x41
WIDTH = 0x43
FORCE = 0x45
SYSTEM = 0x50
LIMITS = 0x53

UPDATES = (WIDTH, FORCE, GRASPING, STATE)
"""Updates that the gripper sends periodically on request, one packet each."""

OK = 0
NOT_INITIALISED = 3
NO_PARAMETER_EXPECTED = 12
NOT_ENOUGH_PARAMETERS = 13
UNKNOWN_COMMAND = 14
ABORTED = 19
PENDING = 26
RANGE_ERROR = 28
AXIS_BLOCKED = 29

FINGERS = 2
"""Ratio of the gripper's force to the force on one pad."""

CLAMP_ABSOLUTE = 0
"""Flags of a pre-position: absolute width, and clamp what blocks the way with the force limit.

The sources disagree on the meaning of the other bits.
"""

STATE_BITS = {
    0: "referenced",
    1: "moving",
    2: "blocked_minus",
    3: "blocked_plus",
    4: "soft_limit_minus",
    5: "soft_limit_plus",
    6: "axis_stopped",
    7: "target_reached",
    8: "overdrive",
    9: "force_control",
    12: "fast_stop",
    13: "temperature_warning",
    14: "over_temperature",
    15: "power_fault",
    16: "overcurrent",
    17: "finger_fault",
    18: "command_failure",
    19: "script_running",
    20: "script_failure",
}
FAULTS = ("fast_stop", "over_temperature", "power_fault", "overcurrent", "finger_fault", "script_failure")
"""Faults, the worst first; except that the fast stop, which others cause, is what must be acknowledged."""
NOTICES = (
    "soft_limit_minus",
    "soft_limit_plus",
    "overdrive",
    "temperature_warning",
    "command_failure",
    "script_running",
)
"""Conditions of a gripper that continues to work."""

GRASPING_STATES = ("idle", "grasping", "no_part", "part_lost", "holding", "releasing", "positioning", "error")

MOST = 1000.0
"""Largest plausible width (mm), speed (mm/s) or force (N)."""

_F32 = struct.Struct("<f")
_FLAGS = struct.Struct("<I")
_GOAL = struct.Struct("<Bff")  # flags, width in mm, speed in mm/s
_UPDATE = struct.Struct("<BH")  # periodic, period in ms
_SYSTEM = struct.Struct("<BBHI")  # type, hardware revision, firmware, serial number
_LIMITS = struct.Struct("<8f")  # as in `Limits`
STATUS_LENGTH = 2
"""Bytes of the status at the beginning of a reply."""

_COMMANDS = (DISCONNECT, HOME, PREPOSITION, STOP, ACKNOWLEDGE, SET_FORCE, OVERDRIVE)

REPLY_SIZES = dict.fromkeys(_COMMANDS, 0) | {
    GET_FORCE: _F32.size,
    STATE: _FLAGS.size,
    GRASPING: 1,
    WIDTH: _F32.size,
    FORCE: _F32.size,
    SYSTEM: _SYSTEM.size,
    LIMITS: _LIMITS.size,
}
"""Bytes after a status of 0; there are none after any other status."""
REQUEST_SIZES = dict.fromkeys((DISCONNECT, STOP, GET_FORCE, SYSTEM, LIMITS), 0) | {
    HOME: 1,
    OVERDRIVE: 1,
    PREPOSITION: _GOAL.size,
    ACKNOWLEDGE: 3,
    SET_FORCE: _F32.size,
    **dict.fromkeys(UPDATES, _UPDATE.size),
}
"""Bytes of a request, for emulators."""


class Limits(NamedTuple):
    """Limits of a gripper, in its own units."""

    stroke_mm: float
    min_speed: float
    max_speed: float
    min_acceleration: float
    max_acceleration: float
    min_force: float
    nominal_force: float
    overdrive_force: float

    def most_force(self, *, overdrive: bool) -> float:
        """Return the largest force limit, N of both fingers."""
        return max(self.nominal_force, self.overdrive_force) if overdrive else self.nominal_force


def encode(packet_id: int, payload: bytes = b"") -> bytes:
    """Return a packet of either direction."""
    return weiss.encode(packet_id, payload, SEED_WITH_PREAMBLE)


def preposition(width_mm: float, speed_mmps: float) -> bytes:
    """Return the command to move to a width, and to clamp what blocks the way.

    The payload is flags (u8), width in mm (f32) and speed in mm/s (f32).
    """
    return encode(PREPOSITION, _GOAL.pack(CLAMP_ABSOLUTE, width_mm, speed_mmps))


def parse_goal(payload: bytes) -> tuple[int, float, float]:
    """Return flags, width in mm and speed in mm/s of a pre-position."""
    flags, width_mm, speed_mmps = _GOAL.unpack(payload)
    return flags, width_mm, speed_mmps


def home() -> bytes:
    """Return the command to search for the reference, in the direction set in the gripper."""
    return encode(HOME, b"\0")


def acknowledge() -> bytes:
    """Return the acknowledgement of a fault or fast stop."""
    return encode(ACKNOWLEDGE, b"ack")


def set_force(newtons: float) -> bytes:
    """Return the command that sets the force limit, N of both fingers together."""
    return encode(SET_FORCE, _F32.pack(newtons))


def overdrive() -> bytes:
    """Return the command that allows forces above the nominal one.

    Sources: MaKaNu/WSGToolbox at 1d27ea1, ``@wsg50/overdrive.m``: one byte, 1 for on and 0 for off. The Robotics
    Library agrees on id and bit 0 (roboticslibrary/rl at 91df9f2, ``src/rl/hal/WeissWsg50.cpp``, ``doOverdriveMode``,
    which writes the bit into the length by mistake).
    """
    return encode(OVERDRIVE, b"\1")


def update_request(update_id: int, period_ms: int) -> bytes:
    """Return the request for one of `UPDATES` every ``period_ms``."""
    return encode(update_id, _UPDATE.pack(1, period_ms))


def parse_update(payload: bytes) -> int:
    """Return the period of a request for updates, ms; 0 for a single answer."""
    automatic, period_ms = _UPDATE.unpack(payload)
    return period_ms if automatic else 0


def encode_reply(reply_id: int, status: int = OK, data: bytes = b"") -> bytes:
    """Return a reply as the gripper sends it."""
    return encode(reply_id, status.to_bytes(STATUS_LENGTH, "little") + data)


def encode_number(reply_id: int, number: float) -> bytes:
    """Return a reply that consists of one number: width, force or force limit."""
    return encode_reply(reply_id, data=_F32.pack(number))


def encode_state(words: set[str]) -> bytes:
    """Return the system state with the bits of these words set."""
    flags = sum(1 << bit for bit, word in STATE_BITS.items() if word in words)
    return encode_reply(STATE, data=_FLAGS.pack(flags))


def encode_grasping(state: str) -> bytes:
    """Return the grasping state."""
    return encode_reply(GRASPING, data=bytes((GRASPING_STATES.index(state),)))


def encode_limits(limits: Limits) -> bytes:
    """Return the answer about the limits."""
    return encode_reply(LIMITS, data=_LIMITS.pack(*limits))


def encode_system(serial: int) -> bytes:
    """Return the answer about the system."""
    return encode_reply(SYSTEM, data=_SYSTEM.pack(1, 0, 0, serial))


def parse_number(data: bytes) -> float:
    """Return the number in a reply, or in the command that sets the force limit."""
    return float(_F32.unpack(data)[0])


def parse_state(data: bytes) -> frozenset[str]:
    """Return the words of the bits set in a system state; ignore bits without a meaning."""
    flags = _FLAGS.unpack(data)[0]
    return frozenset(word for bit, word in STATE_BITS.items() if flags >> bit & 1)


def parse_limits(data: bytes) -> Limits:
    """Return the limits in an answer."""
    return Limits(*_LIMITS.unpack(data))


def parse_serial(data: bytes) -> int:
    """Return the serial number in an answer about the system."""
    return int(_SYSTEM.unpack(data)[3])


def at_most(number: float) -> float:
    """Return the largest f32 that does not exceed ``number``."""
    rounded = np.float32(number)
    return float(rounded if float(rounded) <= number else np.nextafter(rounded, np.float32(-math.inf)))
