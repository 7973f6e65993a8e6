"""Follow the object that the fingers hold: mass, centre of mass, inertia and swing, and what is known by its name."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from slipd.events import NEVER_NS
from slipd.grasp.arm_motion import ArmMotion
from slipd.grasp.grasp_fingers import LEAST_NOISE_N, LoadReader, LoadReading, WeighedFinger
from slipd.grasp.object_estimate import (
    NO_MOTION,
    NO_SENSOR,
    NOT_MOVED,
    NOT_TARED,
    NOTHING_HELD,
    SCALE_STD,
    WAITING,
    GripperMotion,
    NamedObject,
    ObjectEstimate,
    ObjectState,
    gripped_again,
)
from slipd.grasp.object_swing import Swing, SwingEstimate, spin_about
from slipd.types.arrays import Array

PERIOD_NS = 20_000_000
"""The load is read this often."""
WAIT_NS = 110_000_000
"""A reading of the load waits this long for the arm's readings of its time, and of those around it (`SHIFTS_NS`)."""
SLOW_READINGS = 8
"""The orientation that requests set (`gravity.set`) is uncertain by its change over so many readings, 0.16 s."""
EVEN_TURN_RADPS2 = 1.0
"""A faster change of the turn shows no swing, because the inertia of the object may not be known."""
SAME_WEIGHT, SAME_READINGS = 0.03, 10
"""A named object is known again where the load differs from its weight by no more than the first part of it, in so many
readings in a row, 0.2 s: then no table carries a part of it."""


class HeldObject:
    """Learns what is held from the load on both fingers and the motion of the gripper.

    Args:
        fingers: Those of the grasp that have a force sensor; without two, nothing is learned.
        arm: Motion of the arm; None: no stream reports it.
        known: What is known of named objects.

    Attributes:
        state: What is known of the object.
        supported: What an earlier grasp showed of the named object, while something else may still carry a part of its
            weight; None: nothing is known, or the grip carries it.
    """

    def __init__(self, fingers: Sequence[WeighedFinger], arm: ArmMotion | None, known: KnownObjects) -> None:
        self._fingers, self._arm, self._known = fingers, arm, known
        self.state = NOTHING_HELD if len(fingers) > 1 else NO_SENSOR
        self.supported: ObjectState | None = None
        self._noise_n = min((one.noise_n for one in fingers), default=LEAST_NOISE_N)
        self._reader, self._estimate, self._swing = LoadReader(fingers), ObjectEstimate(), SwingEstimate()
        self._waiting: deque[LoadReading] = deque()
        self._requested: deque[Array] = deque(maxlen=SLOW_READINGS)
        self._touching: tuple[bool, ...] = ()

    @property
    def swing(self) -> Swing | None:
        """How the object swings about the line through both pads; None: no swing was seen."""
        return self._swing.swing()

    def update(self, t_ns: int, width_m: float | None) -> int:
        """Read the load; return when that is due again.

        Args:
            t_ns: Now.
            width_m: Width between the pads, m; None where it is not known.
        """
        if self.state is NO_SENSOR:
            return NEVER_NS
        first, second = self._fingers
        touching = first.finger.in_contact, second.finger.in_contact
        if touching != self._touching:
            self._touching = touching
            self._begin_again()
        by_arm = self._arm is not None and self._learn_by_arm(self._arm, width_m, t_ns)
        motion_known = by_arm or self._learn_by_requests(width_m, t_ns)
        if not (first.finger.zero_known and second.finger.zero_known):
            self.state = NOT_TARED
        elif not all(touching):
            self.state = NOTHING_HELD
        else:
            self.state = self._estimate.state if motion_known else NO_MOTION
        self.supported = self._known.supported if self.state.unknown == NOT_MOVED else None
        return t_ns + PERIOD_NS

    def _begin_again(self) -> None:
        """Restart what is learned, because a finger made or lost contact."""
        # A wrong arm stream can feign touches. The loads still show its fault, but teach nothing of the object.
        self._waiting = deque(load._replace(own=None) for load in self._waiting)
        self._known.begin_again()
        self._estimate.forget(WAITING)
        self._swing = SwingEstimate()

    def _learn_by_arm(self, arm: ArmMotion, width_m: float | None, t_ns: int) -> bool:
        """Learn from loads with the arm's readings of their time; return whether the stream is believed."""
        waiting, newest_ns = self._waiting, arm.history.newest_ns
        if (load := self._reader.read(width_m, t_ns)) is not None:
            waiting.append(load)
        while waiting and waiting[0].t_ns + WAIT_NS <= newest_ns:
            load = waiting.popleft()
            if arm.compare(load.t_ns, load.whole_n):
                self._estimate.forget(WAITING)
            motion = arm.history.motion(load.t_ns)
            if motion is not None and load.own is not None and arm.is_used(t_ns):
                self._learn(load, load.own, motion)
                self._follow_swing(load, load.own, motion)
        if waiting and waiting[0].t_ns + 2 * WAIT_NS <= t_ns:  # the stream fell silent
            waiting.clear()
        return arm.is_used(t_ns)

    def _follow_swing(self, load: LoadReading, own: Array, motion: GripperMotion) -> None:
        """Compare the spin on the pads with that of a rigid grip, once the mass is known."""
        turns = np.linalg.norm(motion.acceleration_radps2) > EVEN_TURN_RADPS2
        if self._estimate.state.mass_kg is not None and not turns:
            axis = load.geometry.poses[0].rotation[:, 2]
            spin, rigid = (spin_about(load.middle_m, axis, each) for each in (own, self._estimate.expected(motion)))
            self._swing.update(load.t_ns, spin, rigid)

    def _learn_by_requests(self, width_m: float | None, t_ns: int) -> bool:
        """Learn from the newest load, with the orientation that requests set; return whether they did.

        Such a gripper counts as at rest.
        """
        gravity = self._fingers[0].gravity(t_ns)
        if gravity is None:
            self._requested.clear()
            return False
        self._requested.append(gravity)
        if (load := self._reader.read(width_m, t_ns)) is not None and load.own is not None:
            change = float(np.ptp(np.array(self._requested), axis=0).max())
            self._learn(load, load.own, GripperMotion(gravity, np.zeros(3), np.zeros(3), change))
        return True

    def _learn(self, load: LoadReading, own: Array, motion: GripperMotion) -> None:
        """Learn mass and centre of mass from a load whose ``own`` part is known."""
        estimate = self._estimate
        normal = load.geometry.poses[0].rotation[:, 2]
        self._known.compare(estimate, own[:3], motion.gravity_mps2)
        rise = 1.0 + SCALE_STD * load.grip_n / self._noise_n
        estimate.update(own, motion, load.geometry.noise, rise, load.geometry.lever_m, normal)
        self._known.keep(estimate.state)


class KnownObjects:
    """Keeps what was learned of each named object, and knows one again by its weight.

    Args:
        named: Name of the object in the grip.
        regrip_std_m: How far an object may be gripped from where it was before, as a standard deviation, m.

    Attributes:
        supported: What is known of the named object, where the last load was no more than its weight: a table may carry
            the rest. None: nothing is known, it is known again, or the load is another.
    """

    def __init__(self, named: NamedObject, regrip_std_m: float) -> None:
        self._named, self._regrip_std_m = named, regrip_std_m
        self._states: dict[str, ObjectState] = {}
        self._alike = 0  # readings in a row that weigh as much as the named object
        self.supported: ObjectState | None = None

    def begin_again(self) -> None:
        """Forget the readings so far: another grasp begins."""
        self._alike = 0

    def compare(self, estimate: ObjectEstimate, force_n: Array, gravity_mps2: Array) -> None:
        """Compare a load with the weight of the named object; let the estimate go on with it once it is known again.

        Args:
            estimate: Of the present grasp.
            force_n: Force on both fingers, shape (3,), N.
            gravity_mps2: Apparent gravity, shape (3,).
        """
        self.supported = None
        known = None if self._named.name is None else self._states.get(self._named.name)
        if known is None or estimate.state.com_m is not None or estimate.recognised:
            return
        weight_n = (known.mass_kg or 0.0) * gravity_mps2
        error_n = SAME_WEIGHT * np.linalg.norm(weight_n)
        if np.linalg.norm(force_n) <= np.linalg.norm(weight_n) + error_n:
            self.supported = known
        self._alike = self._alike + 1 if np.linalg.norm(force_n - weight_n) <= error_n else 0
        if self._alike == SAME_READINGS:
            self._alike = 0
            estimate.recognise(known)

    def keep(self, state: ObjectState) -> None:
        """Keep what is known of the named object for its next grasp."""
        if self._named.name is not None and not state.unknown:
            self._states[self._named.name] = gripped_again(state, self._regrip_std_m)
