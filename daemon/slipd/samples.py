"""What a decoder hands on: one reading of one sensor, in SI units.

A leaf module, so that devices, signals and pipeline share the words without importing each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNTRUSTED = frozenset({"overload", "invalid", "raw"})
"""Status words that make a reading's value untrustworthy."""


_NO_TORQUE = (0.0, 0.0, 0.0)


class WrenchSample:
    """One reading of a force/torque sensor, in the sensor's own frame and sign.

    Args:
        t_ns: CLOCK_MONOTONIC when the last byte of the reading was received.
        device_time_ns: The device's own clock, unwrapped by nobody yet; None where it has none.
        force_n: Force, shape (3,), N.
        torque_nm: Torque about the sensor's origin, shape (3,), N·m; None where the device has none.
        status: Conditions the device reported with this reading, e.g. ``("overload",)``; empty when well.
        source: Which sensor of a port that carries several; "" where there is one.

    Attributes:
        numbers: Force and torque; the torque is zero where the device has none.
        has_torque: The device measures the torque.
    """

    __slots__ = ("t_ns", "device_time_ns", "numbers", "has_torque", "status", "source")  # noqa: RUF023 - as of others

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
        """Torque about the sensor's origin, shape (3,), N·m; None where the device has none."""
        return np.array(self.numbers[3:]) if self.has_torque else None

    def __repr__(self) -> str:
        torque_nm = self.numbers[3:] if self.has_torque else None
        return (
            f"WrenchSample({self.t_ns}, {self.device_time_ns}, {self.numbers[:3]}, {torque_nm}, {self.status},"
            f" {self.source!r})"
        )


@dataclass(slots=True, eq=False)
class TactileSample:
    """One image of a tactile pad, in the device's own units and scan order.

    Attributes:
        t_ns: CLOCK_MONOTONIC when the last byte of the image was received.
        device_time_ns: The device's own clock at the start of the scan; None where it has none.
        values: Shape (taxels,) for normal-only pads, (taxels, 3) for three-axis taxels.
        status: Conditions the device reported with this image; empty when well.
        source: Which pad of a port that carries several; "" where there is one.
        dwell_ns: Time from one taxel of the scan to the next; 0 when all are sampled at once.
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
        device_time_ns: Always None for the grippers known so far.
        active: The gripper is activated and takes commands.
        width_m: Width between the pads, m; None where it is not known.
        moving: The fingers are moving.
        object: "moving", "contact_opening", "contact_closing" or "none" (at the requested position, or lost).
        fault: Name of the fault the gripper reports, "" when none.
        echo_ok: The gripper repeats what was last requested; None before the first command.
        current_a: Motor current, A; None where the gripper does not measure it.
        force_n: Force on one pad that the gripper measures, N; None where it does not.
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


Sample = WrenchSample | TactileSample | GripperSample
