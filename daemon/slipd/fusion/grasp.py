"""Two fingers as one grasp: the internal force, which cancels, and the external wrench on the object between them.

The two pads of a parallel jaw face each other. With a force sensor in each finger, both the grip and everything else
(the object's weight, a push, contact with a table) are known (paper, below eq. (3)).

Bad data gives NaN: nothing is known of a grasp while one finger is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slipd.types.arrays import Array


class PadPose(NamedTuple):
    """Pose of a pad in the gripper frame.

    Attributes:
        rotation: Maps pad coordinates to gripper coordinates, shape (3, 3).
        position_m: Origin of the pad frame, shape (3,), m; None where it is unknown.
    """

    rotation: Array
    position_m: Array | None


class ExternalWrench(NamedTuple):
    """External wrench on the object, in the gripper frame.

    Attributes:
        force_n: Shape (3,), N; NaN where a finger's force is unknown.
        torque_nm: About the origin of the gripper frame, shape (3,), N·m; NaN where a finger's torque is unknown, None
            where the position of a pad is.
    """

    force_n: Array
    torque_nm: Array | None


def external_wrench(wrenches: Sequence[Sequence[float]], poses: Sequence[PadPose]) -> ExternalWrench:
    """Add up the wrenches of the object on the fingers.

    An object at rest passes on exactly what acts on it: its own weight and every contact with anything but the pads are
    in the sum and cannot be separated. For an object that the arm accelerates, the sum lacks mass times acceleration:
    it is the wrench that the grasp has to carry.

    Args:
        wrenches: Force by the object on each finger, N, and torque about the pad's origin, N·m, in the pad frame: six
            numbers each.
        poses: Poses of the pads, in the same order.
    """
    force, torque = np.zeros(3), np.zeros(3)
    placed = True
    for wrench, pose in zip(wrenches, poses, strict=True):
        own_force = pose.rotation @ np.array(wrench[:3])
        force += own_force
        if pose.position_m is None:
            placed = False
            continue
        torque += pose.rotation @ np.array(wrench[3:]) + np.cross(pose.position_m, own_force)
    return ExternalWrench(force, torque if placed else None)


def internal_force(first_n: float, second_n: float) -> float:
    """Return the grip: the part of the two normal forces that cancels, N on one pad; 0 where a pad is not pressed.

    That is the smaller force. The difference is an axial external force, carried by the pad it presses on. Half the sum
    instead (the null space of the grasp matrix) would count a pull on the other pad, which no contact gives, and would
    call a box gripped that is pushed onto one pad.

    Args:
        first_n: Normal force on one pad, N, positive when pressed.
        second_n: On the other, N.

    Source: Yoshikawa and Nagai, "Manipulating and Grasping Forces in Manipulation by Multifingered Robot Hands", IEEE
        Trans. Robotics and Automation 7(1), 1991: what manipulates neither opposes the grasp nor contains a part of it.
    """
    if not math.isfinite(first_n + second_n):
        return math.nan
    return max(min(first_n, second_n), 0.0)


def asymmetry(first_n: float, second_n: float, least_n: float) -> float:
    """Return the difference of the normal forces over their sum: +1 if only the first pad is pressed, −1 if the second.

    Args:
        first_n: Normal force on one pad, N.
        second_n: On the other, N.
        least_n: Below this force on both pads there is nothing to compare: NaN.
    """
    first_n, second_n = max(first_n, 0.0), max(second_n, 0.0)
    if not (math.isfinite(first_n + second_n) and max(first_n, second_n) >= least_n > 0.0):
        return math.nan
    return (first_n - second_n) / (first_n + second_n)


def load_share(first_n: float, second_n: float, least_n: float) -> float:
    """Return the share of the tangential load that the first finger carries, 0 to 1; the second carries the rest.

    Magnitudes are compared, not vectors: shear of the fingers against each other uses up friction too.

    Args:
        first_n: Magnitude of the tangential force on one finger, N.
        second_n: On the other, N.
        least_n: Below this sum there is nothing to share: NaN.
    """
    total_n = first_n + second_n
    if not (math.isfinite(total_n) and total_n >= least_n > 0.0):
        return math.nan
    return first_n / total_n


def grasp_utilisation(first: float, second: float) -> float:
    """Return λ of the grasp: that of the worse finger, which is never too low; NaN where one is unknown.

    Each finger's load lies within λ times its own limit surface, so their sum lies within λ times what both carry
    together (lower-bound theorem of limit analysis). Both together may carry more, once one has begun to slip and has
    passed load on to the other. That is left out, because the slip of one finger is what to warn of.
    """
    return math.nan if math.isnan(first) or math.isnan(second) else max(first, second)


def grasp_needed_n(normal_n: tuple[float, float], needed_n: tuple[float, float]) -> float:
    """Return the least internal force with which both fingers hold, N on one pad.

    Gripping harder by d raises both normal forces by d and keeps their difference, an axial external force. So the
    finger that lacks most decides: the result is the internal force now plus what that finger lacks.

    Args:
        normal_n: Normal force on each pad, N.
        needed_n: Normal force that each pad needs for its load (`grip_needed_n`), N.

    Returns:
        The force, at least 0. Minus the internal force now, it is what the grip lacks or, if negative, can spare. NaN
        where a number is unknown, inf where no grip holds.
    """
    first_n, second_n = normal_n
    lacking_n = (needed_n[0] - first_n, needed_n[1] - second_n)
    if math.isnan(lacking_n[0]) or math.isnan(lacking_n[1]):
        return math.nan
    return internal_force(first_n, second_n) + max(lacking_n)
