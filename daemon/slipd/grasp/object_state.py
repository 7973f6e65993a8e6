"""What is known of the object in a grasp: its mass and where its centre of mass is."""

from __future__ import annotations

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(slots=True, frozen=True)
class ObjectState:
    """Mass and centre of mass of the object, as `slipd.grasp.grasp_view.GraspView.object` holds them.

    All in the gripper frame. None is unknown.

    Attributes:
        mass_kg: Mass, kg.
        mass_std_kg: Its standard deviation, kg.
        com_m: Centre of mass from the origin of the gripper frame, m; None also while only a part of it is known.
        com_std_m: Standard deviation of each component, m.
        unknown: Why mass or centre of mass is unknown, for people; "" where both are known.
    """

    mass_kg: float | None
    mass_std_kg: float | None
    com_m: Vector | None
    com_std_m: Vector | None
    unknown: str


def unknown_object(why: str) -> ObjectState:
    """Return an object of which nothing is known; ``why``: the reason for people."""
    return ObjectState(None, None, None, None, why)


NOTHING_HELD = unknown_object("nothing is held")
