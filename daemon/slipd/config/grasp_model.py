"""Keys of ``[grasp]`` and ``[reflex]``, with units and defaults."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from slipd.config.bounds import Calm, Grip, LeadTime, Quaternion, Slew, StrictModel


class PadPlace(StrictModel):
    """``[grasp.pads.X]``: where the pad of a finger is in the gripper frame.

    Attributes:
        positions: Rows of (width m, x m, y m, z m): the origin of the pad frame at some widths between the pads, width
            rising; linear between the rows, and not known beyond them.
        quat_xyzw: Takes pad coordinates to gripper coordinates.
    """

    positions: list[Annotated[tuple[float, float, float, float], Strict(False)]] = Field(min_length=2)
    quat_xyzw: Quaternion


class Grasp(StrictModel):
    """``[grasp]``: two fingers as one grasp; ``pads`` names both."""

    pads: dict[str, PadPlace] = Field(min_length=2, max_length=2)


class Reflex(StrictModel):
    """``[reflex]``: raises the grip by itself on a warning, where ``enabled``; needs ``[grasp]`` and ``[gripper]``.

    Attributes:
        enabled: It acts.
        raise_n_per_s: How fast it raises the force on one pad, N/s.
        ceiling_n: Most that it asks for, N on one pad; None: ``gripper.max_force_n``.
        slip_gain: Factor on the present force where a finger slips although the grip should hold, because the assumed μ
            is too high.
        lead_time_s: How long before the drop a warning comes, s; `slipd check` prints how much force the reflex can add
            within it.
        calm_s: Time without need after which it lowers again, s.
        lower_n_per_s: How fast it lowers to what is needed, N/s; 0: never.
    """

    enabled: bool = False
    raise_n_per_s: Slew = 50.0
    ceiling_n: Grip | None = None
    slip_gain: float = Field(default=1.2, ge=1.0, le=3.0)
    lead_time_s: LeadTime = 0.1
    calm_s: Calm = 2.0
    lower_n_per_s: float = Field(default=0.0, ge=0.0)
