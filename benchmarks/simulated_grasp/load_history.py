"""The loads on a grasped object over time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from simulated_grasp.grasp_parts import Pair

from slipd.types.arrays import Array


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """What acts on the object over time, linear between the samples. The trace has the same samples.

    The load is everything that acts on the object but the pads: weight, inertia in an accelerated hand (−m a), pulls,
    collisions. The object is at rest and its bristles relaxed at the first sample, so a load should grow from 0.

    Attributes:
        t_s: Times, increasing, shape (n,), s.
        force_n: Force on the object in the frame of the left pad, shape (n, 2), N.
        torque_nm: Torque on the object about ``about_m``, along the normal of the left pad, shape (n,), N·m.
        grip_n: Commanded normal force on one pad, shape (n,), N; at the first sample it is in force.
        tilt_nm: Moments (about x, about y) on the object that tilt it between the pads, shape (n, 2), N·m. Half of each
            goes to either pad and shifts the pressure there, to opposite sides on the two pads. None is 0.
        grip_lag_s: Time constant with which the grip force follows the command.
        about_m: Point of the object, in the frame of the left pad before the object has moved, where the force acts
            and about which the torque is. It moves with the object: with weight at the centre of mass the lever
            changes as the object turns.

    Raises:
        ValueError: Shapes disagree, a number is not finite, a grip force is negative or the times do not increase.
    """

    t_s: Array
    force_n: Array
    torque_nm: Array
    grip_n: Array
    tilt_nm: Array | None = None
    grip_lag_s: float = 0.0
    about_m: Pair = field(default=(0.0, 0.0))

    def __post_init__(self) -> None:
        n = len(self.t_s)
        shapes = {"t_s": (n,), "force_n": (n, 2), "torque_nm": (n,), "grip_n": (n,), "tilt_nm": (n, 2)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            if np.shape(value) != shape:
                raise ValueError(f"{name} must have shape {shape}, got {np.shape(value)}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} must be finite")
        if n == 0 or (np.diff(self.t_s) <= 0.0).any():
            raise ValueError("t_s must not be empty and must increase")
        if (np.asarray(self.grip_n) < 0.0).any() or self.grip_lag_s < 0.0:
            raise ValueError("grip_n and grip_lag_s must not be negative")
