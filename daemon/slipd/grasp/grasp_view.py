"""Both fingers as one grasp: grip force, load on the object, whether it is held, and the grip force that would hold it.

A quantity that depends on a finger with stale or untrusted readings is not known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.trust import is_trusted
from slipd.fusion.grasp import (
    asymmetry,
    external_wrench,
    grasp_needed_n,
    grasp_utilisation,
    internal_force,
    load_share,
)
from slipd.grasp.grasp_fingers import PlacedFinger
from slipd.types.arrays import Array, finite_or_none
from slipd_client.messages import SEVERITY

HoldWord = Literal["empty", "held", "slipping", "lost", "unknown"]
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
    """The load on the object in a grasp, and how the fingers share it; what is not finite is unknown.

    Attributes:
        external_force_n: Force of the world on the object, in the gripper frame, shape (3,), N.
        external_torque_nm: Its torque about the frame's origin, shape (3,), N·m; None where the pads' place is unknown.
        first_share: Share of the tangential load that the first finger carries, 0 to 1.
        asymmetry: First minus second normal force over their sum, −1 to 1.
        age_s: Age of the older of the two force readings, s.
    """

    external_force_n: Array
    external_torque_nm: Array | None
    first_share: float
    asymmetry: float
    age_s: float


class GraspView:
    """Two fingers as one grasp.

    Args:
        placed: Both, with the places of their pads.

    Attributes:
        fingers: The first and the second finger.
        state: State at the last `update`.
    """

    def __init__(self, placed: Sequence[PlacedFinger]) -> None:
        self.fingers = tuple(finger for finger, _ in placed)
        self._places = tuple(place for _, place in placed)
        self._least_n = max(finger.config.min_normal_n for finger in self.fingers)
        self.state = self.update(None)

    def levels(self) -> tuple[str, str]:
        """Return the levels of the first and the second finger."""
        first, second = self.fingers
        return first.level, second.level

    def level(self) -> str:
        """Return the level of the worse finger."""
        first, second = self.fingers
        return first.level if SEVERITY[first.level] >= SEVERITY[second.level] else second.level

    def evidence(self) -> dict[str, tuple[str, ...]]:
        """Return what showed on each finger at the last `update` that the object moves, by the finger's name."""
        return {one.finger.name: one.state.evidence for one in self._now}

    def update(self, width_m: float | None) -> GraspState:
        """Combine the newest readings of both fingers.

        Args:
            width_m: Width between the pads, m; None where it is not known.
        """
        first, second = self._now = [_FingerNow(finger, finger.state) for finger in self.fingers]
        level = self.level()
        verdicts = first.state.verdict, second.state.verdict
        reasons = dict.fromkeys(why for verdict in verdicts if verdict.level == level for why in verdict.reasons)
        normal_n = first.normal_n, second.normal_n
        needed_n = grasp_needed_n(normal_n, (first.needed_n, second.needed_n))
        self.state = GraspState(
            level,
            tuple(reasons),
            finite_or_none(internal_force(*normal_n)),
            finite_or_none(needed_n),
            finite_or_none(needed_n * max(first.learned_rise, second.learned_rise)),
            finite_or_none(grasp_utilisation(first.utilisation, second.utilisation)),
            finite_or_none(width_m),
        )
        return self.state

    def load(self, t_ns: int) -> GraspLoad:
        """Return the load at ``t_ns``, with the readings and the width of the last `update`."""
        first, second = self._now
        poses = [place.pose(self.state.width_m) for place in self._places]
        world = external_wrench([one.wrench(t_ns) for one in self._now], poses)
        ages = [one.finger.freshness.age_s(t_ns) for one in self._now]
        return GraspLoad(
            world.force_n,
            world.torque_nm,
            load_share(first.tangential_n, second.tangential_n, self._least_n),
            asymmetry(first.normal_n, second.normal_n, self._least_n),
            max(math.inf if age is None else age for age in ages),
        )


class _FingerNow:
    """One finger of a grasp with its state, which is read once; NaN is unknown, also where the state is not trusted.

    Args:
        finger: The finger.
        state: Its state.

    Attributes:
        normal_n: Normal force, N.
        tangential_n: Size of the tangential force, N.
        utilisation: λ of the load.
        needed_n: Least normal force that holds the load, N.
        learned_rise: By which factor the friction in use is above the stated one, at least 1; inf where none is stated.
    """

    def __init__(self, finger: Finger, state: FingerState) -> None:
        self.finger, self.state = finger, state
        self._trusted = is_trusted(state.verdict)
        self.normal_n = self.tangential_n = self.utilisation = math.nan
        contact, used = state.contact, state.utilisation
        if used is not None and self._trusted:
            self.utilisation = used.value
        if contact is not None and self._trusted:
            self.normal_n, self.tangential_n = contact.normal_n, contact.tangential_norm_n
        needed_n, friction, stated = state.needed_normal_n(finger.config), state.friction, finger.friction.stated
        self.needed_n = math.nan if needed_n is None else needed_n
        self.learned_rise = 1.0
        if friction is not None and friction.mu is not None:
            self.learned_rise = math.inf if stated is None else max(friction.mu / stated, 1.0)

    def wrench(self, t_ns: int) -> Sequence[float]:
        """Return force and torque on the pad; NaN also where they may contain the finger's own weight."""
        wrench, force = self.state.wrench, self.finger.force
        weighs = force is not None and force.gravity.state(t_ns) == "unknown_orientation"
        return _NO_WRENCH if wrench is None or weighs or not self._trusted else wrench


class HoldState:
    """Follows from the levels of both fingers what the grasp does with the object.

    A parallel gripper holds an object only while both pads press on it. So one pad that is known to be free is enough
    to know that nothing is held; that both press must be known of both.

    Attributes:
        word: The state at the last `update`.
        since_ns: When it began, CLOCK_MONOTONIC; 0 before the first `update`. A loss keeps its time over moments in
            which nothing is known.
    """

    def __init__(self) -> None:
        self.word: HoldWord = "unknown"
        self.since_ns = 0
        self._holding = False  # an object was held, and its end was not known since
        self._lost_ns = 0  # when it was lost; 0 while it was not
        self._releasing = False  # opening was commanded since the pads last pressed without

    def update(self, levels: tuple[str, str], *, releasing: bool, t_ns: int) -> None:
        """Update with what is known at ``t_ns``.

        Args:
            levels: Levels of both fingers.
            releasing: A release was commanded and is not confirmed yet.
            t_ns: Now.
        """
        word = self._next(levels, releasing=releasing)
        if word == self.word and self.since_ns:
            return
        if word == "lost":
            self._lost_ns = self._lost_ns or t_ns
        self.word, self.since_ns = word, self._lost_ns if word == "lost" else t_ns

    def _next(self, levels: tuple[str, str], *, releasing: bool) -> HoldWord:
        self._releasing = self._releasing or releasing
        if "no_contact" in levels:
            if self._holding and not self._releasing:
                return "lost"
            return "unknown" if "unknown" in levels else "empty"
        if "slipping" not in levels and "unknown" in levels:
            return "unknown"
        self._holding, self._releasing, self._lost_ns = True, releasing, 0
        return "slipping" if "slipping" in levels else "held"
