"""Base class of the sessions with grippers: permits become motions, by a state machine."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

from slipd.devices.shared.state_machine import StateMachine
from slipd.types.permit import Permit


class GripperSessionBase(ABC):
    """Carry out permits, the only way to command a gripper; each device implements the motions.

    A subclass sets ``_machine``, its state machine, and ``_activation``, the states in which it activates the gripper.
    """

    _machine: StateMachine[Any, Any]
    _activation: ClassVar[frozenset[Any]]

    @property
    def width_step_m(self) -> float:
        """Resolution of the reported width, m; 0: as fine as its numbers."""
        return 0.0

    @property
    def activating(self) -> bool:
        """Whether an activation is queued or in progress; until it is over no motion is accepted."""
        return self._machine.state in self._activation

    def execute(self, permit: Permit, now_ns: int) -> bool:
        """Carry out a permit; see `slipd.devices.GripperSession.execute`.

        Raises:
            ValueError: The width or speed is out of the gripper's range, or a value is missing or not finite.
        """
        if permit.kind == "activate":
            return self._activate(now_ns)
        if permit.kind == "halt":
            return self._halt()
        force_n = permit.force_n
        if force_n is None:
            raise ValueError(f"a permit of kind {permit.kind!r} must have a force")
        if not math.isfinite(force_n):
            raise ValueError(f"a force must be finite, got {force_n} N")
        if permit.kind == "set_force":
            return self._set_force(force_n)
        if permit.width_m is None:
            raise ValueError("a permit of kind 'move' must have a width")
        return self._move(permit.width_m, permit.speed_mps, force_n)

    @abstractmethod
    def _activate(self, now_ns: int) -> bool:
        """Make the gripper ready."""

    @abstractmethod
    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        """Move to a width with a force."""

    @abstractmethod
    def _set_force(self, force_n: float) -> bool:
        """Change the force at the width requested last."""

    @abstractmethod
    def _halt(self) -> bool:
        """Stop the fingers where they are."""


def check_range(name: str, value: float, bounds: tuple[float, float], unit: str, tolerance: float = 0.0) -> None:
    """Check that a value is within its bounds.

    Raises:
        ValueError: It is not, or it is not a number.
    """
    low, high = bounds
    if not low - tolerance <= value <= high + tolerance:  # also False for NaN
        raise ValueError(f"the {name} must be from {low:g} to {high:g} {unit}, got {value}")
