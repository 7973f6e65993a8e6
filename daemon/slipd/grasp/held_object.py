"""Follow what the fingers carry: mass and centre of mass of the object, and whether the arm stream fits the load."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from slipd.config import Grasp
from slipd.events import NEVER_NS
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.trust import is_trusted
from slipd.fusion.grasp import PadPose, external_wrench
from slipd.grasp.arm_check import SHIFTS_NS, ArmCheck
from slipd.grasp.arm_motion import ArmMotion
from slipd.grasp.grasp_view import Place
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
from slipd.types.arrays import Array, cross_matrix

PERIOD_NS = 20_000_000
"""The load is read this often."""
WAIT_NS = 110_000_000
"""A reading of the load waits this long for the arm's readings of its time, and of those around it (`SHIFTS_NS`)."""
MOST_SKEW_NS = 15_000_000
"""The newest readings of both fingers are no further apart."""
LEAST_NOISE_N, LEAST_NOISE_NM = 0.005, 5e-5
"""Least noise of a sensor, even if its config states less."""
SLOW_READINGS = 8
"""The orientation that requests set (`gravity.set`) is uncertain by its change over so many readings, 0.16 s."""
EVEN_TURN_RADPS2 = 1.0
"""A faster change of the turn shows no swing, because the inertia of the object is not known."""
SAME_WEIGHT, SAME_READINGS = 0.03, 10
"""A named object is known again where the load differs from its weight by no more than the first part of it, in so many
readings in a row, 0.2 s: then no table carries a part of it."""


class _Geometry(NamedTuple):
    """What follows from the width between the pads.

    Attributes:
        width_m: The width, m; None where it is not known.
        poses: Poses of the pads.
        centres_m: Their centres in the gripper frame, each of shape (3,), m.
        noise: Covariance of the noise of force and torque of both fingers together, shape (6, 6).
        lever_m: Distance of the pads from the origin, m.
    """

    width_m: float | None
    poses: list[PadPose]
    centres_m: list[Array]
    noise: Array
    lever_m: float


class _Load(NamedTuple):
    """The load on both fingers at a time.

    Attributes:
        t_ns: When it was.
        whole_n: Force with the weight of the fingers, shape (3,), N.
        own: Force and torque without it, shape (6,); None where it is not known, or nothing is held firmly.
        grip_n: Mean normal force, N.
        middle_m: Point between both contacts, shape (3,), m; NaN where a pad touches nothing.
        geometry: Of the pads.
    """

    t_ns: int
    whole_n: Array
    own: Array | None
    grip_n: float
    middle_m: Array
    geometry: _Geometry


class HeldObject:
    """Learns what is held, and compares the arm stream with the load.

    Args:
        grasp: ``[grasp]``.
        fingers: All fingers by name. Without a force sensor in both of the grasp, nothing is learned.
        arm: Motion of the arm; None: no stream reports it.
        named: Name of the object; what was learned of a named one is kept for its next grasp.

    Attributes:
        state: What is known of the object.
        supported: What an earlier grasp showed of the named object, while something else may still carry a part of its
            weight; None: nothing is known, or the grip carries it.
        swing: How the object swings about the line through both pads; None: no swing was seen.
    """

    def __init__(self, grasp: Grasp, fingers: Mapping[str, Finger], arm: ArmMotion | None, named: NamedObject) -> None:
        self._arm, self._named, self._regrip_std_m = arm, named, grasp.motion.regrip_std_m
        self._sides = sides = [
            Side(fingers[name], force, Place(place))
            for name, place in grasp.pads.items()
            if (force := fingers[name].force) is not None
        ]
        weighs = len(sides) == len(grasp.pads)
        self.state, self._next_ns = (NOTHING_HELD, 0) if weighs else (NO_SENSOR, NEVER_NS)
        self.supported: ObjectState | None = None
        self.swing: Swing | None = None
        self._known: dict[str, ObjectState] = {}
        self._alike = 0  # readings in a row that weigh as much as the named object
        self._carried_in_part: ObjectState | None = None
        self._noise_n = min((side.noise_n for side in sides), default=LEAST_NOISE_N)
        self._estimate, self._swing = ObjectEstimate(), SwingEstimate()
        self._check = ArmCheck(math.hypot(*(side.noise_n for side in sides)))
        self._waiting: deque[_Load] = deque()
        self._geometry: _Geometry | None = None
        self._requested: deque[Array] = deque(maxlen=SLOW_READINGS)
        self._touching: tuple[bool, ...] = ()

    def update(self, t_ns: int, width_m: float | None) -> int:
        """Read the load where that is due; return when it is due again.

        Args:
            t_ns: Now.
            width_m: Width between the pads, m; None where it is not known.
        """
        if t_ns < self._next_ns:
            return self._next_ns
        self._next_ns = t_ns + PERIOD_NS
        self._follow_touches()
        by_arm = self._arm is not None and self._learn_by_arm(self._arm, width_m, t_ns)
        self.state = self._judge(motion_known=by_arm or self._learn_by_requests(width_m, t_ns))
        self.supported = self._carried_in_part if self.state.unknown == NOT_MOVED else None
        self.swing = self._swing.swing()
        return self._next_ns

    def _follow_touches(self) -> None:
        """Restart the estimate when a finger makes or loses contact."""
        first, second = self._sides
        touching = first.finger.in_contact, second.finger.in_contact
        if touching != self._touching:
            self._touching, self._alike = touching, 0
            # A wrong arm stream can feign touches. The loads still show its fault, but teach nothing of the object.
            self._waiting = deque(load._replace(own=None) for load in self._waiting)
            self._estimate.forget(WAITING)
            self._swing = SwingEstimate()

    def _judge(self, *, motion_known: bool) -> ObjectState:
        """Return what is known of the object, or why nothing is."""
        first, second = self._sides
        if not (first.finger.zero_known and second.finger.zero_known):
            return NOT_TARED
        if not all(self._touching):
            return NOTHING_HELD
        return self._estimate.state if motion_known else NO_MOTION

    def _learn_by_arm(self, arm: ArmMotion, width_m: float | None, t_ns: int) -> bool:
        """Compare loads with the arm's readings of their time, and learn from them; return whether it is believed."""
        waiting, newest_ns = self._waiting, arm.history.newest_ns
        if (load := self._load(width_m, t_ns)) is not None:
            waiting.append(load)
        while waiting and waiting[0].t_ns + WAIT_NS <= newest_ns:
            self._compare(waiting.popleft(), arm, t_ns)
        if waiting and waiting[0].t_ns + 2 * WAIT_NS <= t_ns:  # the stream fell silent
            waiting.clear()
        return arm.is_used(t_ns)

    def _compare(self, load: _Load, arm: ArmMotion, t_ns: int) -> None:
        """Check the stream against a load, and learn from both if the stream is believed."""
        gravities = [gravity for shift in SHIFTS_NS if (gravity := arm.history.gravity(load.t_ns + shift)) is not None]
        if len(gravities) == len(SHIFTS_NS):
            self._check.update(load.whole_n, gravities)
        if arm.misfit != self._check.fault:
            arm.misfit = self._check.fault
            self._estimate.forget(WAITING)
        motion = arm.history.motion(load.t_ns)
        if motion is not None and load.own is not None and arm.is_used(t_ns):
            self._learn(load, load.own, motion)
            turns = np.linalg.norm(motion.acceleration_radps2) > EVEN_TURN_RADPS2
            if self._estimate.state.mass_kg is not None and not turns:
                loads = load.own, self._estimate.expected(motion)
                axis = load.geometry.poses[0].rotation[:, 2]
                self._swing.update(load.t_ns, *(spin_about(load.middle_m, axis, each) for each in loads))

    def _learn_by_requests(self, width_m: float | None, t_ns: int) -> bool:
        """Learn from the newest load, with the orientation that requests set; return whether they did.

        Such a gripper counts as at rest.
        """
        gravity = self._sides[0].gravity(t_ns)
        if gravity is None:
            self._requested.clear()
            return False
        self._requested.append(gravity)
        if (load := self._load(width_m, t_ns)) is not None and load.own is not None:
            change = float(np.ptp(np.array(self._requested), axis=0).max())
            self._learn(load, load.own, GripperMotion(gravity, np.zeros(3), np.zeros(3), change))
        return True

    def _learn(self, load: _Load, own: Array, motion: GripperMotion) -> None:
        """Learn mass and centre of mass from a load whose ``own`` part is known, and keep those of a named object."""
        name, estimate, self._carried_in_part = self._named.name, self._estimate, None
        known = None if name is None else self._known.get(name)
        if known is not None and estimate.state.com_m is None and not estimate.recognised:
            self._recognise(known, own[:3], motion.gravity_mps2)
        rise = 1.0 + SCALE_STD * load.grip_n / self._noise_n
        estimate.update(own, motion, load.geometry.noise, rise, load.geometry.lever_m)
        if name is not None and not estimate.state.unknown:
            self._known[name] = gripped_again(estimate.state, self._regrip_std_m)

    def _recognise(self, known: ObjectState, force_n: Array, gravity_mps2: Array) -> None:
        """Compare the force on the fingers with the weight of a named object: a table may still carry a part of it."""
        weight_n = (known.mass_kg or 0.0) * gravity_mps2
        error_n = SAME_WEIGHT * np.linalg.norm(weight_n)
        if np.linalg.norm(force_n) <= np.linalg.norm(weight_n) + error_n:
            self._carried_in_part = known
        self._alike = self._alike + 1 if np.linalg.norm(force_n - weight_n) <= error_n else 0
        if self._alike == SAME_READINGS:
            self._alike = 0
            self._estimate.recognise(known)

    def _load(self, width_m: float | None, t_ns: int) -> _Load | None:
        """Return the load of the newest readings; None where they are not trusted, or do not belong together."""
        states = [side.finger.state for side in self._sides]
        times_ns = [state.t_ns for state in states]
        wrenches = [state.wrench for state in states if state.wrench is not None and is_trusted(state.verdict)]
        if len(wrenches) < len(states) or max(times_ns) - min(times_ns) > MOST_SKEW_NS:
            return None
        if self._geometry is None or self._geometry.width_m != width_m:
            self._geometry = _geometry(self._sides, width_m)
        carried = external_wrench(wrenches, self._geometry.poses)
        whole_n = carried.force_n
        for side in self._sides:
            whole_n = whole_n + side.weight_n()
        weighed = all(side.force.gravity.state(t_ns) != "unknown_orientation" for side in self._sides)
        slips = any(state.verdict.level == "slipping" for state in states)
        own = None
        if weighed and all(self._touching) and not slips:
            torque_nm = np.full(3, math.nan) if carried.torque_nm is None else carried.torque_nm
            own = np.concatenate((carried.force_n, torque_nm))
        grip_n = max(-sum(wrench[2] for wrench in wrenches) / len(wrenches), 0.0)
        middle_m = np.zeros(3)
        for side, centre_m, state in zip(self._sides, self._geometry.centres_m, states, strict=True):
            cx, cy = (math.nan, math.nan) if state.contact is None else (state.contact.cx_m, state.contact.cy_m)
            middle_m = middle_m + 0.5 * (centre_m + side.place.rotation @ (cx, cy, 0.0))
        return _Load(sum(times_ns) // len(times_ns), whole_n, own, grip_n, middle_m, self._geometry)


class Side:
    """One finger of the grasp, and where its pad is.

    Args:
        finger: The finger.
        force: Its force sensor.
        place: Pose of its pad.
    """

    def __init__(self, finger: Finger, force: ForceChannel, place: Place) -> None:
        self.finger, self.force, self.place = finger, force, place
        self.noise_n = max(force.noise.force_std_n, LEAST_NOISE_N)
        self._noise_nm = max(force.noise.torque_std_nm, LEAST_NOISE_NM)

    def noise(self, place_m: Array) -> Array:
        """Return the covariance of the noise of force and torque about the origin, shape (6, 6)."""
        lever, force = cross_matrix(place_m), self.noise_n**2
        torque = force * lever @ lever.T + self._noise_nm**2 * np.eye(3)
        return np.block([[force * np.eye(3), force * lever.T], [force * lever, torque]])

    def weight_n(self) -> Array:
        """Return the weight of the finger that is subtracted from its readings, in the gripper frame, shape (3,), N."""
        weight = self.force.gravity.correction
        return np.zeros(3) if weight is None else self.place.rotation @ weight[:3]

    def gravity(self, t_ns: int) -> Array | None:
        """Return the apparent gravity that is known of the finger, in the gripper frame, shape (3,), m/s²."""
        gravity = self.force.gravity.gravity(t_ns)
        return None if gravity is None else self.place.rotation @ gravity


def _geometry(sides: Sequence[Side], width_m: float | None) -> _Geometry:
    places_m = [side.place.nearest_m(width_m) for side in sides]
    return _Geometry(
        width_m,
        [side.place.pose(width_m) for side in sides],
        places_m,
        np.sum([side.noise(place_m) for side, place_m in zip(sides, places_m, strict=True)], axis=0),
        max(float(np.linalg.norm(place_m)) for place_m in places_m),
    )
