"""What two fingers feel of a load that they share: the contact equations backwards."""

from __future__ import annotations

import numpy as np

from slipd.tools.sim.scene_parts import Load
from slipd.types.arrays import Array


def finger_load(load: Load, *, right: bool) -> Load:
    """Return half of a load (frame of the left pad), which one finger carries, in the frame of its own pad."""
    fx, fy, spin = load[0] / 2, load[1] / 2, load[2] / 2
    return (fx, -fy, -spin) if right else (fx, fy, spin)


def pad_wrench(load: Load, normal_n: float, centre_m: tuple[float, float]) -> tuple[Array, Array]:
    """Return force and torque of the object on a finger, in its pad frame: the inverse of eqs. (1)–(3) of the paper.

    Args:
        load: Load that the friction of this finger carries, in its pad frame.
        normal_n: Normal force, N.
        centre_m: Centroid of the contact of this finger in its pad frame, m.

    Returns:
        Force (3,), N, with F_z = −normal; torque about the centre of the pad (3,), N·m.
    """
    fx, fy, spin = load
    cx, cy = centre_m
    force = np.array([fx, fy, -normal_n])
    return force, np.array([-cy * normal_n, cx * normal_n, cx * fy - cy * fx + spin])
