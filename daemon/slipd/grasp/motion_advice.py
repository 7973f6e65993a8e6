"""How fast the arm may go with the object in the grip, so that the grip holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from slipd.config import Grasp
from slipd.finger.finger import Finger
from slipd.grasp.grasp_view import GraspView
from slipd.types.arrays import Array

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


class MotionAdvice:
    """Advises how fast the arm may go.

    Args:
        grasp: ``[grasp]``.
        fingers: All fingers by name.
        view: The two fingers as one grasp, with what is known of the object.

    Attributes:
        safety: Safety factor of the limits: the larger one of both fingers.
        wanted_mps2: Acceleration that is wanted in every direction.
    """

    def __init__(self, grasp: Grasp, fingers: dict[str, Finger], view: GraspView) -> None:
        self.safety = max(fingers[name].config.grip_safety for name in grasp.pads)
        self.wanted_mps2 = grasp.motion.wanted_acceleration_mps2
        self._view = view

    @property
    def level(self) -> str:
        """Level of the worse finger."""
        return self._view.level()

    def limits(self, t_ns: int) -> MotionLimits:
        """Return how fast the arm may go at ``t_ns``."""
        return MotionLimits(self._why_unknown(t_ns))

    def check(self, points: Array, t_ns: int) -> MotionCheck:
        """Return whether the present grip holds a motion.

        Args:
            points: Rows of `slipd_client.messages.schema.request_fields.POINT_COLUMNS`, shape (n, 10).
            t_ns: Now.
        """
        return MotionCheck(self._why_unknown(t_ns))

    def check_acceleration(self, acceleration_mps2: list[float], t_ns: int) -> MotionCheck:
        """Return whether the present grip holds an acceleration in the present orientation."""
        return MotionCheck(self._why_unknown(t_ns))

    def _why_unknown(self, _: int) -> str:
        return self._view.object.unknown or "the limits of the motion are not computed yet"
