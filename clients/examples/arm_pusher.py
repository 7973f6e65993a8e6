"""Make the messages of the arm's motion (docs/arm.md) from values in a base frame whose Z axis points up."""

from __future__ import annotations

from collections.abc import Sequence

import msgpack
import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY_MPS2 = (0.0, 0.0, -9.80665)
"""In the base frame; another one for a base on a wall."""


def arm_message(
    t_ns: int,
    quat_xyzw: Sequence[float],
    acceleration_mps2: Sequence[float],
    angular_velocity_radps: Sequence[float],
) -> bytes:
    """Pack one reading; send it on a ZeroMQ PUSH socket, as external_pusher.py does.

    Args:
        t_ns: When the motion was, CLOCK_MONOTONIC of the daemon's machine.
        quat_xyzw: Orientation of the gripper frame in the base frame.
        acceleration_mps2: Acceleration of its origin, in the base frame.
        angular_velocity_radps: Its angular velocity, in the base frame.
    """
    to_gripper = Rotation.from_quat(quat_xyzw).inv()
    apparent_mps2 = np.subtract(GRAVITY_MPS2, acceleration_mps2)
    return msgpack.packb(
        {
            "stream": "arm",
            "t_ns": t_ns,
            "gravity_mps2": to_gripper.apply(apparent_mps2).tolist(),
            "angular_velocity_radps": to_gripper.apply(angular_velocity_radps).tolist(),
        }
    )
