"""The tables of a config that say where both pads of a parallel-jaw gripper are."""

from __future__ import annotations

OPEN_M = 0.085
"""Of the gripper of `engine_rig`."""


def grasp_table(open_m: float = OPEN_M) -> str:
    """Return ``[grasp.pads]`` of a left and a right finger that open by ``open_m``, half of it each."""
    pads = (("left", "[0.5, -0.5, 0.5, 0.5]", open_m / 2), ("right", "[-0.5, -0.5, -0.5, 0.5]", -open_m / 2))
    return "".join(
        f"""
[grasp.pads.{finger}]
positions = [[0.0, 0.0, 0.0, 0.0], [{open_m}, 0.0, {y_m}, 0.0]]
quat_xyzw = {quaternion}
"""
        for finger, quaternion, y_m in pads
    )
