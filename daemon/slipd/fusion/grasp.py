"""Two fingers as one grasp: what of their forces cancels, and what the world does to the object between them.

The two pads of a parallel jaw face each other. Everything else (an object's weight, a push, contact with a table) is
the rest, and with two force sensors both are known (paper, below eq. (3)).

Bad data gives NaN: nothing here is known of a grasp of which one finger is not known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PadPose(NamedTuple):
    """Where a pad is in the gripper frame.

    Attributes:
        rotation: Takes pad coordinates to gripper coordinates, shape (3, 3).
        position_m: Origin of the pad frame, shape (3,), m; None where it is not known.
    """

    rotation: Array
    position_m: Array | None


class ExternalWrench(NamedTuple):
    """What the world does to the object, in the gripper frame.

    Attributes:
        force_n: Shape (3,), N; NaN where a finger's force is not known.
        torque_nm: About the origin of the gripper frame, shape (3,), N·m; NaN where a finger's torque is not known,
            None where the position of a pad is not.
    """

    force_n: Array
    torque_nm: Array | None


def external_wrench(wrenches: Sequence[Sequence[float]], poses: Sequence[PadPose]) -> ExternalWrench:
    """Adds up what the object does to the two fingers.

    An object at rest hands on exactly what the world does to it: its own weight and every contact with anything but the
    pads are in the sum, and cannot be told apart. Of an object that the arm accelerates, mass times acceleration is
    taken off: what is told is what the grasp has to carry.

    Args:
        wrenches: Of each finger, force by the object in its pad frame, N, and torque about that frame's origin, N·m:
            six numbers each.
        poses: Of the pads, in the same order.
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
    """The grip: the part of the two normal forces that cancels, N on one pad; 0 where a pad is not pressed.

    That is the smaller one. The rest, their difference, is an axial external force, carried by the pad it presses on.
    Halving the sum instead (the null space of the grasp matrix) would count a pull on the other pad, which no contact
    gives, and call a box that is pushed onto one pad gripped.

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
    """Difference of the normal forces over their sum: +1 where only the first pad is pressed, −1 only the second.

    Args:
        first_n: Normal force on one pad, N.
        second_n: On the other, N.
        least_n: Where no pad is pressed harder than this, there is nothing to compare: NaN.
    """
    first_n, second_n = max(first_n, 0.0), max(second_n, 0.0)
    if not (math.isfinite(first_n + second_n) and max(first_n, second_n) >= least_n > 0.0):
        return math.nan
    return (first_n - second_n) / (first_n + second_n)


def load_share(first_n: float, second_n: float, least_n: float) -> float:
    """Share of the tangential load that the first finger carries, 0 to 1; the second carries the rest.

    The amounts are compared and not the vectors: shear with which the fingers work against each other uses up friction
    too.

    Args:
        first_n: Amount of the tangential force on one finger, N.
        second_n: On the other, N.
        least_n: Where both together carry less than this, there is nothing to share: NaN.
    """
    total_n = first_n + second_n
    if not (math.isfinite(total_n) and total_n >= least_n > 0.0):
        return math.nan
    return first_n / total_n


def grasp_utilisation(first: float, second: float) -> float:
    """λ of the grasp: the worse finger's, which is never too low; NaN where one is not known.

    Each finger's load lies within λ times its own limit surface, so their sum lies within λ times what both carry
    together (lower-bound theorem of limit analysis). Both together may carry more than this tells, once one has begun
    to slip and has handed load to the other. That is left out: it is the slip of one finger that is to be warned of.
    """
    return math.nan if math.isnan(first) or math.isnan(second) else max(first, second)


def grasp_needed_n(normal_n: tuple[float, float], needed_n: tuple[float, float]) -> float:
    """The least internal force with which both fingers hold, N on one pad.

    Gripping harder by d raises both normal forces by d, and leaves their difference, an axial external force. So the
    finger that lacks most decides: the internal force now, and what that finger lacks.

    Args:
        normal_n: Normal force on each pad, N.
        needed_n: Normal force that each pad needs for its load (`grip_needed_n`), N.

    Returns:
        The force, 0 or more; less the internal force now, it is what the grip may lack (or, negative, spare). NaN where
        a number is not known, inf where no grip holds.
    """
    first_n, second_n = normal_n
    lacking_n = (needed_n[0] - first_n, needed_n[1] - second_n)
    if math.isnan(lacking_n[0]) or math.isnan(lacking_n[1]):
        return math.nan
    return internal_force(first_n, second_n) + max(lacking_n)
