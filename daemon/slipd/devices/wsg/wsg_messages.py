"""Messages of Weiss/Schunk WSG grippers: byte layout, commands, and parsers of replies.

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
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, STATUS_WORDS

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
ABORTED = 19
PENDING = 26
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

F32 = struct.Struct("<f")
FLAGS = struct.Struct("<I")
GOAL_FIELDS = struct.Struct("<Bff")  # flags, width in mm, speed in mm/s
UPDATE_FIELDS = struct.Struct("<BH")  # periodic, period in ms
SYSTEM_FIELDS = struct.Struct("<BBHI")  # type, hardware revision, firmware, serial number
LIMITS_FIELDS = struct.Struct("<8f")  # as in `Limits`
STATUS_LENGTH = 2
"""Bytes of the status at the beginning of a reply."""

_COMMANDS = (DISCONNECT, HOME, PREPOSITION, STOP, ACKNOWLEDGE, SET_FORCE, OVERDRIVE)

REPLY_SIZES = dict.fromkeys(_COMMANDS, 0) | {
    GET_FORCE: F32.size,
    STATE: FLAGS.size,
    GRASPING: 1,
    WIDTH: F32.size,
    FORCE: F32.size,
    SYSTEM: SYSTEM_FIELDS.size,
    LIMITS: LIMITS_FIELDS.size,
}
"""Bytes after a status of 0; there are none after any other status."""


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
    return encode(PREPOSITION, GOAL_FIELDS.pack(CLAMP_ABSOLUTE, width_mm, speed_mmps))


SEARCH_REFERENCE = encode(HOME, b"\0")
"""Command to search for the reference, in the direction set in the gripper."""

ACKNOWLEDGEMENT = encode(ACKNOWLEDGE, b"ack")
"""Acknowledgement of a fault or fast stop."""

ALLOW_OVERDRIVE = encode(OVERDRIVE, b"\1")
"""Command that allows forces above the nominal one.

Sources: MaKaNu/WSGToolbox at 1d27ea1, ``@wsg50/overdrive.m``: one byte, 1 for on and 0 for off. The Robotics Library
agrees on id and bit 0 (roboticslibrary/rl at 91df9f2, ``src/rl/hal/WeissWsg50.cpp``, ``doOverdriveMode``, which writes
the bit into the length by mistake).
"""


def set_force(newtons: float) -> bytes:
    """Return the command that sets the force limit, N of both fingers together."""
    return encode(SET_FORCE, F32.pack(newtons))


def update_request(update_id: int, period_ms: int) -> bytes:
    """Return the request for one of `UPDATES` every ``period_ms``."""
    return encode(update_id, UPDATE_FIELDS.pack(1, period_ms))


def parse_number(data: bytes) -> float:
    """Return the number in a reply, or in the command that sets the force limit."""
    return float(F32.unpack(data)[0])


def parse_state(data: bytes) -> frozenset[str]:
    """Return the words of the bits set in a system state; ignore bits without a meaning."""
    flags = FLAGS.unpack(data)[0]
    return frozenset(word for bit, word in STATE_BITS.items() if flags >> bit & 1)


def parse_limits(data: bytes) -> Limits:
    """Return the limits in an answer."""
    return Limits(*LIMITS_FIELDS.unpack(data))


def at_most(number: float) -> float:
    """Return the largest f32 that does not exceed ``number``."""
    rounded = np.float32(number)
    return float(rounded if float(rounded) <= number else np.nextafter(rounded, np.float32(-math.inf)))


class Reply(NamedTuple):
    """An answer or an update: id, status, and the data after it."""

    id: int
    status: int
    data: bytes


def is_reply(reply_id: int, size: int, payload: bytes) -> bool:
    """Return whether a packet is a reply, as far as it is received, for `weiss.PacketScanner`."""
    expected = REPLY_SIZES.get(reply_id)
    if expected is None or size not in (STATUS_LENGTH, STATUS_LENGTH + expected):
        return False
    if len(payload) < STATUS_LENGTH:
        return True
    status = int.from_bytes(payload[:STATUS_LENGTH], "little")
    if status >= len(STATUS_WORDS) or size != STATUS_LENGTH + (expected if status == OK else 0):
        return False
    return status != OK or len(payload) < size or _is_sound(reply_id, payload[STATUS_LENGTH:])


def _is_sound(reply_id: int, data: bytes) -> bool:
    """Return whether the numbers of a reply are plausible."""
    if reply_id in (GET_FORCE, WIDTH, FORCE):
        return abs(parse_number(data)) <= MOST  # also False for NaN
    if reply_id == GRASPING:
        return data[0] < len(GRASPING_STATES)
    if reply_id == LIMITS:
        return _are_limits(parse_limits(data))
    return True


def _are_limits(limits: Limits) -> bool:
    return (
        all(map(math.isfinite, limits))
        and 0.0 < limits.stroke_mm <= MOST
        and 0.0 <= limits.min_speed < limits.max_speed <= MOST
        and 0.0 <= limits.min_force < limits.nominal_force <= MOST
        and limits.overdrive_force <= MOST
    )
