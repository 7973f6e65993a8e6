"""Both fingers as one grasp: the grip force, the load on the object, and the grip force that would hold it.

A quantity that depends on a finger with stale or untrusted readings is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.config import Grasp, PadPlace
from slipd.finger.finger import Finger
from slipd.finger.friction_limits import needed_normal_n
from slipd.fusion.grasp import (
    PadPose,
    asymmetry,
    external_wrench,
    grasp_needed_n,
    grasp_utilisation,
    internal_force,
    load_share,
)
from slipd.types.arrays import Array
from slipd.types.finite import finite_or_none
from slipd_client.messages import SEVERITY

_NO_WRENCH = (math.nan,) * 6


@dataclass(slots=True, frozen=True)
class GraspState:
    """What is known of a grasp; None is unknown.

    Attributes:
        level: Level of the worse finger.
        reasons: Reasons of every finger at that level.
        internal_n: Grip force, N on one pad.
        grip_needed_n: Least grip force that holds both fingers with their configured safety, N on one pad; None also
            where no force would hold them.
        grip_kept_n: Likewise without what friction was learned above the stated one: the reflex lowers no further. None
            also where none is stated.
        utilisation: λ of the worse finger; None also where no grip holds.
        width_m: Width between the pads, m.
    """

    level: str
    reasons: tuple[str, ...]
    internal_n: float | None
    grip_needed_n: float | None
    grip_kept_n: float | None
    utilisation: float | None
    width_m: float | None


@dataclass(slots=True, frozen=True)
class GraspLoad:
    """The load on the object in a grasp, and how the fingers share it; None and NaN are unknown.

    Attributes:
        external_force_n: Force of the world on the object, in the gripper frame, shape (3,), N.
        external_torque_nm: Its torque about the frame's origin, shape (3,), N·m; None where the pads' place is unknown.
        first_share: Share of the tangential load that the first finger carries, 0 to 1.
        asymmetry: First minus second normal force over their sum, −1 to 1.
        age_s: Age of the older of the two force readings, s.
    """

    external_force_n: Array
    external_torque_nm: Array | None
    first_share: float | None
    asymmetry: float | None
    age_s: float | None


class GraspView:
    """Two fingers as one grasp.

    Args:
        config: ``[grasp]``.
        fingers: All fingers by name, among them the two that ``[grasp]`` names.

    Attributes:
        state: State at the last `update`.
    """

    def __init__(self, config: Grasp, fingers: dict[str, Finger]) -> None:
        first, second = (fingers[name] for name in config.pads)
        self._fingers = first, second
        self._places = tuple(_Place(place) for place in config.pads.values())
        self._least_n = max(finger.config.min_normal_n for finger in self._fingers)
        self.state = self.update(None)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the first and the second finger."""
        first, second = self._fingers
        return first.name, second.name

    def levels(self) -> tuple[str, str]:
        """Return the levels of the first and the second finger."""
        first, second = self._fingers
        return first.level, second.level

    def level(self) -> str:
        """Return the level of the worse finger."""
        first, second = self.levels()
        return first if SEVERITY[first] >= SEVERITY[second] else second

    def evidence(self) -> dict[str, tuple[str, ...]]:
        """Return what shows on each finger that the object moves, by the finger's name."""
        return {finger.name: finger.state.evidence for finger in self._fingers}

    def update(self, width_m: float | None) -> GraspState:
        """Combine the newest readings of both fingers.

        Args:
            width_m: Width between the pads, m; None where it is not known.
        """
        first, second = self._fingers
        verdicts = first.state.verdict, second.state.verdict
        level = self.level()
        reasons = dict.fromkeys(why for verdict in verdicts if verdict.level == level for why in verdict.reasons)
        normal_n = _normal_n(first), _normal_n(second)
        needed_n = grasp_needed_n(normal_n, (_needed_n(first), _needed_n(second)))
        self.state = GraspState(
            level,
            tuple(reasons),
            finite_or_none(internal_force(*normal_n)),
            finite_or_none(needed_n),
            finite_or_none(needed_n * max(_learned_rise(first), _learned_rise(second))),
            finite_or_none(grasp_utilisation(_utilisation(first), _utilisation(second))),
            finite_or_none(width_m),
        )
        return self.state

    def load(self, t_ns: int) -> GraspLoad:
        """Return the load at ``t_ns``, with the pads at the width of the last `update`."""
        first, second = self._fingers
        wrenches = [_wrench(finger, t_ns) for finger in self._fingers]
        world = external_wrench(wrenches, [place.pose(self.state.width_m) for place in self._places])
        ages = first.age_s(t_ns), second.age_s(t_ns)
        return GraspLoad(
            world.force_n,
            world.torque_nm,
            finite_or_none(load_share(_tangential_n(first), _tangential_n(second), self._least_n)),
            finite_or_none(asymmetry(_normal_n(first), _normal_n(second), self._least_n)),
            finite_or_none(max(math.inf if age is None else age for age in ages)),
        )


class _Place:
    """Pose of a pad at each width, from ``[grasp.pads.X]``."""

    def __init__(self, config: PadPlace) -> None:
        self._rotation = Rotation.from_quat(config.quat_xyzw).as_matrix()
        rows = np.array(config.positions)
        self._widths_m, self._positions_m = rows[:, 0], rows[:, 1:]

    def pose(self, width_m: float | None) -> PadPose:
        """Return the pose; without a position where the width is unknown or outside the configured positions."""
        widths = self._widths_m
        if width_m is None or not widths[0] <= width_m <= widths[-1]:
            return PadPose(self._rotation, None)
        return PadPose(self._rotation, np.array([np.interp(width_m, widths, along) for along in self._positions_m.T]))


def _normal_n(finger: Finger) -> float:
    contact = finger.state.contact
    return contact.normal_n if contact is not None and finger.is_trusted else math.nan


def _tangential_n(finger: Finger) -> float:
    contact = finger.state.contact
    return contact.tangential_norm_n if contact is not None and finger.is_trusted else math.nan


def _utilisation(finger: Finger) -> float:
    used = finger.state.utilisation
    return used.value if used is not None and finger.is_trusted else math.nan


def _needed_n(finger: Finger) -> float:
    needed = needed_normal_n(finger, finger.state)
    return math.nan if needed is None else needed


def _learned_rise(finger: Finger) -> float:
    """Return by which factor the friction in use is above the stated one, at least 1; inf where none is stated."""
    friction, stated = finger.state.friction, finger.friction.stated
    if friction is None or friction.mu is None:
        return 1.0
    return math.inf if stated is None else max(friction.mu / stated, 1.0)


def _wrench(finger: Finger, t_ns: int) -> tuple[float, ...]:
    """Return force and torque on the pad; NaN also where they may contain the finger's own weight."""
    wrench, force = finger.state.wrench, finger.force
    if wrench is None or not finger.is_trusted:
        return _NO_WRENCH
    if force is not None and force.gravity.state(t_ns) == "unknown_orientation":
        return _NO_WRENCH
    return wrench
