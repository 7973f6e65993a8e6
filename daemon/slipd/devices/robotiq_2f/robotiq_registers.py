"""Registers of the Robotiq 2F grippers: bit layout and parsers, and what their bytes are in SI units.

Three output registers (from 1000) command the gripper, three input registers (from 2000) report its status. Both are
six bytes, high byte of each register first: action or status flags, reserved or fault, position request or its echo,
then speed and force, or position and current. Source: Robotiq 2F instruction manual, gripper register mapping.

The manufacturer publishes only the ends of the scales of position, speed and force, and they are not linear. So a site
measures its own tables, which are linear between their points.
"""

from __future__ import annotations

import bisect
import itertools
import math
import operator
import struct
from collections.abc import Callable, Sequence

from slipd.devices.shared import modbus
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.gripper_session import check_range
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
        self._frames = FrameScanner(bytes((unit,)), _measure, _STATUS_LENGTH, self.health, least=_STATUS_LENGTH)

    def _readings(self, data: bytes, t_ns: int) -> list[GripperSample]:
        buffer, found = self._frames.receive(data)
        return [parse_status(_STATUS.unpack_from(buffer, at + _STATUS_AT), t_ns, None) for at, _ in found]


def _measure(buffer: bytes, at: int) -> int:
    if buffer[at + 1] not in (modbus.READ_HOLDING, modbus.READ_INPUT) or buffer[at + 2] != _STATUS.size:
        return NO_FRAME
    return _STATUS_LENGTH if modbus.checksum_matches(buffer[at : at + _STATUS_LENGTH]) else NO_FRAME


Table = Sequence[tuple[float, float]]

FULL = 255
"""Largest byte of position, speed and force."""

OPEN, CLOSED = 3, 230
"""Position bytes that a 2F-85 reports when it is fully open and fully closed.

Source: PickNikRobotics/ros2_robotiq_gripper at 3b6cf8f, ``robotiq_driver/src/hardware_interface.cpp``, lines 45 and 46.
The ROS 1 driver has 13 and 230 (ros-industrial-attic/robotiq at 1e744f1, ``robotiq_2f_gripper_ctrl.py``, ``get_pos``).
They depend on the fingertips, so a site measures its own.
"""

FORCE_TABLE: Table = ((0, 20.0), (FULL, 235.0))
WIDTH_TABLE: Table = ((OPEN / FULL, 0.085), (CLOSED / FULL, 0.0))
SPEED_TABLE: Table = ((0, 0.020), (FULL, 0.150))
"""Ends of the scales from the data sheet of the 2F-85, with straight lines between them."""

MIDDLE_SPEED = 128
"""Speed byte if no speed is requested."""

_ROUNDING = 1e-6
"""Rounding error allowed at the ends of the range, m or m/s; a position byte is 300 times as much."""
_EXACT = 1e-9
"""Rounding error allowed of an exact force byte."""


class Units:
    """Convert between SI units and the gripper's bytes.

    Args:
        force_table: (force byte, N on one pad), both rising.
        width_table: (position byte / 255, m between the pads), the first rising and the second falling.
        speed_table: (speed byte, m/s), both rising; None if the speed cannot be set.

    Attributes:
        force_range_n: Smallest and largest force, N on one pad.
        width_range_m: Smallest and largest width.
        width_step_m: Largest difference of the widths of two neighbouring position bytes.
        speed_range_mps: Smallest and largest speed; None if the speed cannot be set.
    """

    def __init__(self, force_table: Table, width_table: Table, speed_table: Table | None) -> None:
        self._forces = force_table
        self._settings = [(newtons, byte) for byte, newtons in force_table]
        self._widths = width_table
        self._closures = [(width, closure) for closure, width in reversed(self._widths)]
        slopes = [(wide - narrow) / (b - a) for (a, wide), (b, narrow) in itertools.pairwise(self._widths)]
        self.width_step_m = max(slopes) / FULL
        self._speeds = [(speed, byte) for byte, speed in speed_table or ()]
        self.force_range_n = (float(force_table[0][1]), float(force_table[-1][1]))
        self.width_range_m = (self._closures[0][0], self._closures[-1][0])
        self.speed_range_mps = (self._speeds[0][0], self._speeds[-1][0]) if self._speeds else None

    def force(self, force_n: float) -> int:
        """Return the largest force byte that gives at most ``force_n``, or the smallest byte if all give more.

        Raises:
            ValueError: The force is not finite.
        """
        if not math.isfinite(force_n):
            raise ValueError(f"a force must be finite, got {force_n} N")
        return max(int(interpolate(self._settings, force_n) + _EXACT), int(self._forces[0][0]))

    def newtons(self, byte: int) -> float:
        """Return the force of a force byte, N on one pad."""
        return interpolate(self._forces, byte)

    def position(self, width_m: float) -> int:
        """Return the position byte nearest to a width.

        Raises:
            ValueError: The width is out of range.
        """
        check_range("width", width_m, self.width_range_m, "m", _ROUNDING)
        return round(FULL * interpolate(self._closures, width_m))

    def width_m(self, position: int) -> float:
        """Return the width between the pads at a position byte."""
        return interpolate(self._widths, position / FULL)

    def speed(self, speed_mps: float | None) -> int:
        """Return the speed byte nearest to a speed, or the middle one for None.

        Raises:
            ValueError: The speed is out of range, or cannot be set.
        """
        if speed_mps is None:
            return MIDDLE_SPEED
        if self.speed_range_mps is None:
            raise ValueError("the speed must be left out, because there is no speed_table")
        check_range("speed", speed_mps, self.speed_range_mps, "m/s", _ROUNDING)
        return round(interpolate(self._speeds, speed_mps))


def interpolate(table: Table, value: float) -> float:
    """Return the second column of a table at ``value`` of its rising first column, constant beyond its ends."""
    if value <= table[0][0]:
        return table[0][1]
    if value >= table[-1][0]:
        return table[-1][1]
    after = bisect.bisect_right(table, value, key=operator.itemgetter(0))
    (x0, y0), (x1, y1) = table[after - 1], table[after]
    return y0 + (value - x0) / (x1 - x0) * (y1 - y0)
