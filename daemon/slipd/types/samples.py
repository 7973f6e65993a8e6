"""The output of a decoder: one reading of one sensor, in SI units.

A leaf module, so that the rooms share these types without importing each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slipd.types.arrays import Array

UNTRUSTED_WORDS = frozenset({"overload", "invalid", "raw"})
"""Status words of a reading whose value cannot be trusted."""

_NO_TORQUE = (0.0, 0.0, 0.0)


class WrenchSample:
    """One reading of a force/torque sensor, in frame and sign of the sensor.

    Args:
        t_ns: CLOCK_MONOTONIC when the last byte of the reading was received.
        device_time_ns: Clock of the device, not yet unwrapped; None if it has none.
        force_n: Force, shape (3,), N.
        torque_nm: Torque about the origin of the sensor, shape (3,), N·m; None if the device does not measure it.
        status: Conditions that the device reported with the reading, such as ``("overload",)``; empty if there are
            none.
        source: Name of the sensor on a port that carries several; "" if there is one.

    Attributes:
        numbers: Force and torque; the torque is zero if the device does not measure it.
        has_torque: Whether the device measures the torque.
    """

    __slots__ = ("t_ns", "device_time_ns", "numbers", "has_torque", "status", "source")  # noqa: RUF023 - in the order of the arguments

    def __init__(
        self,
        t_ns: int,
        device_time_ns: int | None,
        force_n: Sequence[float] | Array,
        torque_nm: Sequence[float] | Array | None,
        status: tuple[str, ...] = (),
        source: str = "",
    ) -> None:
        self.t_ns = t_ns
        self.device_time_ns = device_time_ns
        self.has_torque = torque_nm is not None
        self.numbers = (*force_n, *(_NO_TORQUE if torque_nm is None else torque_nm))
        self.status = status
        self.source = source

    @property
    def force_n(self) -> Array:
        """Force, shape (3,), N."""
        return np.array(self.numbers[:3])

    @property
    def torque_nm(self) -> Array | None:
        """Torque about the origin of the sensor, shape (3,), N·m; None if the device does not measure it."""
        return np.array(self.numbers[3:]) if self.has_torque else None

    def __repr__(self) -> str:
        torque_nm = self.numbers[3:] if self.has_torque else None
        return (
            f"WrenchSample({self.t_ns}, {self.device_time_ns}, {self.numbers[:3]}, {torque_nm}, {self.status},"
            f" {self.source!r})"
        )


@dataclass(slots=True, eq=False)
class TactileSample:
    """One image of a tactile pad, in units and scan order of the device.

    Attributes:
        t_ns: CLOCK_MONOTONIC when the last byte of the image was received.
        device_time_ns: Clock of the device at the start of the scan; None if it has none.
        values: Shape (taxels,) for normal-only pads, (taxels, 3) for three-axis taxels.
        status: Conditions that the device reported with the image; empty if there are none.
        source: Name of the pad on a port that carries several; "" if there is one.
        dwell_ns: Time from one taxel of the scan to the next, ns; 0 if all are sampled at once.
    """

    t_ns: int
    device_time_ns: int | None
    values: Array
    status: tuple[str, ...] = ()
    source: str = ""
    dwell_ns: int = 0


@dataclass(slots=True, eq=False)
class GripperSample:
    """One status reading of a gripper.

    Attributes:
        t_ns: CLOCK_MONOTONIC when the reply was received.
        device_time_ns: None, as no gripper has a clock.
        active: Whether the gripper is activated and accepts commands.
        width_m: Width between the pads, m; None if unknown.
        moving: Whether the fingers move.
        object: "moving", "contact_opening", "contact_closing" or "none" (at the requested position, or lost).
        fault: Name of the fault that the gripper reports; "" if there is none.
        echo_ok: Whether the gripper repeats the last command; None before the first one.
        current_a: Motor current, A; None if the gripper does not measure it.
        force_n: Measured force on one pad, N; None if the gripper does not measure it.
        source: Always "".
    """

    t_ns: int
    device_time_ns: int | None
    active: bool
    width_m: float | None
    moving: bool
    object: str
    fault: str
    echo_ok: bool | None
    current_a: float | None = None
    force_n: float | None = None
    source: str = ""


@dataclass(slots=True, eq=False)
class ObjectSample:
    """What another process reports of the object in the grip; None where it does not.

    Attributes:
        t_ns: CLOCK_MONOTONIC when the last byte of the reading was received.
        device_time_ns: Time of the observation, CLOCK_MONOTONIC of the sender.
        xyz_m: Position of a point of the object in the gripper frame, m.
        quat_xyzw: Orientation of the object in the gripper frame, a unit quaternion.
        speed_mps: Speed of the object over the pads, m/s.
        speed_std_mps: Standard deviation of that speed, m/s.
        status: Conditions that the sender reported with the reading.
        source: Name of the stream.
    """

    t_ns: int
    device_time_ns: int | None
    xyz_m: tuple[float, ...] | None = None
    quat_xyzw: tuple[float, ...] | None = None
    speed_mps: float | None = None
    speed_std_mps: float | None = None
    status: tuple[str, ...] = ()
    source: str = ""


@dataclass(slots=True, eq=False)
class ArmSample:
    """Motion of the arm at the origin of the gripper frame, in that frame, as another process reports it.

    Attributes:
        t_ns: CLOCK_MONOTONIC when the last byte of the reading was received.
        device_time_ns: Time of the motion, CLOCK_MONOTONIC of the sender.
        gravity_mps2: Apparent gravity: gravity minus the acceleration of the origin, m/s².
        angular_velocity_radps: Angular velocity of the gripper, rad/s.
        angular_acceleration_radps2: Angular acceleration of the gripper, rad/s²; None if unknown.
        status: Conditions that the sender reported with the reading.
        source: Name of the stream.
    """

    t_ns: int
    device_time_ns: int | None
    gravity_mps2: tuple[float, ...]
    angular_velocity_radps: tuple[float, ...]
    angular_acceleration_radps2: tuple[float, ...] | None = None
    status: tuple[str, ...] = ()
    source: str = ""


Sample = WrenchSample | TactileSample | GripperSample | ObjectSample | ArmSample
