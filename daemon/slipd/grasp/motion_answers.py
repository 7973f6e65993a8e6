"""What the advice on motion answers: how fast the arm may go, and whether the grip holds a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from slipd.fusion.held_pad import UNBOUNDED
from slipd.types.arrays import Array


class NotKnownError(Exception):
    """Something that the advice needs is not known; the text is the reason, for people."""


Mode = Literal["translation", "rotation", "tipping"]


@dataclass(slots=True, frozen=True)
class MotionLimits:
    """How fast the arm may go with the present grip, in the gripper frame; None is unknown.

    Attributes:
        unknown: Why everything else is unknown, for people; "" where it is known.
        finger: Finger that limits the acceleration.
        mode: What would happen first.
        utilisation: Of the worse finger by its load now; inf where no grip holds it.
        acceleration_mps2: Largest acceleration that holds in every direction.
        worst_direction: Direction that is limited to it, shape (3,).
        accelerations_mps2: Largest acceleration along +x, −x, +y, −y, +z and −z.
        turn_utilisation: Utilisation at rest in the worst orientation; inf where no grip holds it.
        worst_gravity_mps2: Gravity in that orientation, shape (3,).
        angular_acceleration_radps2: Largest angular acceleration about the pinch axis, in either sense.
        grip_needed_n: Grip force with which the wanted acceleration holds in every direction; inf where none would.
        speed_scale: Time scale, 0 to 1, at which the larger of the wanted acceleration and the present one holds.
    """

    unknown: str = ""
    finger: str | None = None
    mode: Mode | None = None
    utilisation: float | None = None
    acceleration_mps2: float | None = None
    worst_direction: Array | None = None
    accelerations_mps2: tuple[float, ...] | None = None
    turn_utilisation: float | None = None
    worst_gravity_mps2: Array | None = None
    angular_acceleration_radps2: float | None = None
    grip_needed_n: float | None = None
    speed_scale: float | None = None


@dataclass(slots=True, frozen=True)
class MotionCheck:
    """Whether the present grip holds a motion; None is unknown.

    Attributes:
        unknown: As in `MotionLimits`.
        utilisation: Largest utilisation; inf where no grip holds the motion.
        at_s: Time of the point that has it, s.
        finger: Finger that has it.
        mode: What would happen first.
        grip_needed_n: Grip force with which the motion holds; inf where none would.
        time_scale: Largest time scale, 0 to 1, with which it holds.
    """

    unknown: str = ""
    utilisation: float | None = None
    at_s: float | None = None
    finger: str | None = None
    mode: Mode | None = None
    grip_needed_n: float | None = None
    time_scale: float | None = None


def unbounded(used: float) -> float:
    """Return a utilisation, inf where no grip holds."""
    return math.inf if used >= UNBOUNDED else float(used)
