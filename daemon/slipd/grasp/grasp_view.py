"""Both fingers as one grasp: its grip, what the world does to the object in it, and the grip that would hold it.

A finger that is stale, or that something speaks against, says nothing here: what rests on it is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.config.model import Grasp, PadPlace
from slipd.finger.finger import Finger
from slipd.finger.verdict import SEVERITY
from slipd.fusion import (
    PadPose,
    asymmetry,
    external_wrench,
    grasp_needed_n,
    grasp_utilisation,
    internal_force,
    load_share,
)
from slipd.publish.message_bodies import Body, needed_n, number, vector
from slipd_client.messages import level_code

_NO_WRENCH = (math.nan,) * 6


@dataclass(slots=True, frozen=True)
class GraspState:
    """What is known of a grasp; None is unknown.

    Attributes:
        t_ns: When this was put together, CLOCK_MONOTONIC.
        level: Of the worse finger.
        reasons: Of every finger at that level.
        internal_n: Grip force, N on one pad.
        grip_needed_n: Least grip force that holds both fingers with their configured safety, N on one pad; None also
            where no force would do.
        utilisation: λ of the worse finger; None also where no grip holds.
        width_m: Between the pads, as it was told.
    """

    t_ns: int
    level: str
    reasons: tuple[str, ...]
    internal_n: float | None
    grip_needed_n: float | None
    utilisation: float | None
    width_m: float | None


class GraspView:
    """Two fingers seen as one grasp.

    Args:
        config: ``[grasp]``.
        fingers: All fingers by name; both that ``[grasp]`` names are among them.

    Attributes:
        state: As of the last `update`.
    """

    def __init__(self, config: Grasp, fingers: dict[str, Finger]) -> None:
        first, second = (fingers[name] for name in config.pads)
        self._fingers = first, second
        self._places = tuple(_Place(place) for place in config.pads.values())
        self._least_n = max(finger.config.min_normal_n for finger in self._fingers)
        self.state = self.update(0, None)

    def update(self, t_ns: int, width_m: float | None) -> GraspState:
        """Puts together what the fingers' newest readings say.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            width_m: Between the pads, m; None where that is not known.
        """
        first, second = self._fingers
        verdicts = first.state.verdict, second.state.verdict
        level = max((verdict.level for verdict in verdicts), key=SEVERITY.__getitem__)
        reasons = dict.fromkeys(why for verdict in verdicts if verdict.level == level for why in verdict.reasons)
        normal_n = _normal_n(first), _normal_n(second)
        self.state = GraspState(
            t_ns,
            level,
            tuple(reasons),
            number(internal_force(*normal_n)),
            number(grasp_needed_n(normal_n, (_needed_n(first), _needed_n(second)))),
            number(grasp_utilisation(_utilisation(first), _utilisation(second))),
            number(width_m),
        )
        return self.state

    def body(self, t_ns: int) -> Body:
        """The ``grasp`` message, published at ``t_ns``, of the fingers' newest readings and the width told last."""
        state = self.update(t_ns, self.state.width_m)
        first, second = self._fingers
        wrenches = [_wrench(finger, t_ns) for finger in self._fingers]
        world = external_wrench(wrenches, [place.pose(state.width_m) for place in self._places])
        ages = first.age_s(t_ns), second.age_s(t_ns)
        return {
            "fingers": [first.name, second.name],
            "level": state.level,
            "level_code": level_code(state.level),
            "reasons": list(state.reasons),
            "internal_n": state.internal_n,
            "grip_needed_n": state.grip_needed_n,
            "utilisation": state.utilisation,
            "external_force_n": vector(world.force_n),
            "external_torque_nm": vector(world.torque_nm),
            "load_share": self._load_share(),
            "asymmetry": number(asymmetry(_normal_n(first), _normal_n(second), self._least_n)),
            "width_m": state.width_m,
            "age_s": number(max(math.inf if age is None else age for age in ages)),
        }

    def _load_share(self) -> dict[str, float] | None:
        """Share of the tangential load that each finger carries."""
        first, second = self._fingers
        share = number(load_share(_tangential_n(first), _tangential_n(second), self._least_n))
        return None if share is None else {first.name: share, second.name: 1.0 - share}


class _Place:
    """``[grasp.pads.X]``: where a pad is at a width."""

    def __init__(self, config: PadPlace) -> None:
        self._rotation = Rotation.from_quat(config.quat_xyzw).as_matrix()
        rows = np.array(config.positions)
        self._widths_m, self._positions_m = rows[:, 0], rows[:, 1:]

    def pose(self, width_m: float | None) -> PadPose:
        """The pose; without a position where the width is not known, or beyond what was measured."""
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
    needed = needed_n(finger.state, finger)
    return math.nan if needed is None else needed


def _wrench(finger: Finger, t_ns: int) -> tuple[float, ...]:
    """Force and torque on the pad; not known either where they may hold the finger's own weight."""
    wrench, force = finger.state.wrench, finger.force
    if wrench is None or not finger.is_trusted:
        return _NO_WRENCH
    if force is not None and force.gravity.state(t_ns) == "unknown_orientation":
        return _NO_WRENCH
    return wrench
