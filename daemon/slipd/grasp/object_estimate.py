"""Mass and centre of mass of the object in a grasp, by the load on both pads and the motion of the gripper.

Both pads together carry F = m γ + A m c and, about the origin of the gripper frame, M = m c × γ: γ is the apparent
gravity at the origin (gravity minus acceleration), c the centre of mass, and A = −[α]× − [ω]×[ω]× the turn of the
gripper. This is linear in m and m c, so a Kalman filter without motion of its state is recursive least squares. The
moment J α + ω × J ω of the inertia J is not estimated: readings of a fast turn count less instead, and those after it
give c.

Zero, scale and mounting of the sensors are off by amounts that stay while the grip does. They are part of the state, so
that the stated uncertainty contains them, and a turn, which changes the load but not them, separates both.

Source: Atkeson, An and Hollerbach, "Estimation of Inertial Parameters of Manipulator Loads and Links", Int. J. Robotics
    Research 5(3), 1986.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from slipd.types.arrays import Array, cross_matrix


@dataclass(slots=True, frozen=True)
class ObjectState:
    """Mass and centre of mass of the object, as `slipd.grasp.held_object.HeldObject.state` holds them.

    All in the gripper frame. None is unknown.

    Attributes:
        mass_kg: Mass, kg.
        mass_std_kg: Its standard deviation, kg.
        com_m: Centre of mass from the origin of the gripper frame, m; None also while only a part of it is known.
        com_std_m: Standard deviation of each component, m.
        unknown: Why mass or centre of mass is unknown, for people; "" where both are known.
    """

    mass_kg: float | None = None
    mass_std_kg: float | None = None
    com_m: tuple[float, ...] | None = None
    com_std_m: tuple[float, ...] | None = None
    unknown: str = ""


NOTHING_HELD = ObjectState(unknown="nothing is held")
NO_SENSOR = ObjectState(unknown="a force sensor is needed in both fingers")
NOT_TARED = ObjectState(unknown="a finger is not tared")
NO_MOTION = ObjectState(
    unknown="what the gripper feels is unknown: no arm stream ([grasp.arm]), and no gravity (gravity.set)"
)


@dataclass(slots=True)
class NamedObject:
    """Keeps the name of the object in the grip, as clients state it: friction is learned for each name.

    Attributes:
        name: Name of the object; None: none is named.
        set_by: Client that named it, or took its name back; None: no client of this run did.
        set_t_ns: When that client did, CLOCK_MONOTONIC; None likewise.
    """

    name: str | None = None
    set_by: str | None = None
    set_t_ns: int | None = None

    def set(self, name: str | None, by: str, t_ns: int) -> None:
        """Use the name that a client states, for every finger and the rest of the run."""
        self.name, self.set_by, self.set_t_ns = name, by, t_ns


def gripped_again(known: ObjectState, regrip_std_m: float) -> ObjectState:
    """Return what an earlier grasp showed of an object for another grasp of it.

    Args:
        known: Mass and centre of mass, both known.
        regrip_std_m: How far it may be gripped from where it was then, as a standard deviation of each component, m.
    """
    return replace(known, com_std_m=tuple(math.hypot(std, regrip_std_m) for std in known.com_std_m or ()))


SCALE_STD = 0.01
"""Error of scale and axes of a force sensor, as a part of its load."""
MODEL_STD = 0.02
"""What the model of a rigid object leaves out, as a part of the load: soft pads let it swing."""
CORRELATED = 10.0
"""Such errors last for about so many readings."""
LEVER_M = 0.05
"""Lever with which an error of the force becomes one of the torque, and the largest radius of gyration, m."""
FREE_MASS_KG, FREE_COM_M = 10.0, 0.3
"""Standard deviations before the first reading."""
REJECTED = 36.0
"""A reading further from the prediction, as a squared Mahalanobis distance of six components, is not explained: chance
gives one in 300,000."""
MOST_REJECTED = 5
"""This many in a row (0.1 s) mean a different load: the estimate is reset."""
MOVED_MPS2 = 0.7
"""Change of the apparent gravity that shows the object free: a turn by 4°, or that acceleration. Until then a table may
carry a part of it."""
SIGNIFICANT = 4.0
"""A lighter object than so many standard deviations is not known."""
KNOWN_COM_M = 0.02
"""A component of the centre of mass with a larger standard deviation is unknown."""
AXES = "xyz"

WAITING = "the load is weighed"
NOT_MOVED = "the gripper has not moved since the load changed: the object may rest on something"
UNEXPLAINED = "the load does not follow the motion: the object touches something, or moves in the grip"
LIGHT = "the load is too small to weigh"
NO_WIDTH = "the centre of mass is unknown: the width between the pads is"


class GripperMotion(NamedTuple):
    """Motion of the gripper at a time, in its frame.

    Attributes:
        gravity_mps2: Apparent gravity γ at the origin, shape (3,).
        velocity_radps: Angular velocity ω, shape (3,).
        acceleration_radps2: Angular acceleration α, shape (3,).
        std_mps2: Standard deviation of γ by the error of its time.
    """

    gravity_mps2: Array
    velocity_radps: Array
    acceleration_radps2: Array
    std_mps2: float


class ObjectEstimate:
    """Learns mass and centre of mass in one grasp.

    Attributes:
        state: What is known.
        recognised: It goes on with what an earlier grasp showed.
    """

    def __init__(self) -> None:
        self.forget(WAITING)

    def forget(self, why: str) -> None:
        """Reset the estimate; ``why`` is the reason, for people."""
        free = FREE_MASS_KG * FREE_COM_M
        self._mean = np.zeros(10)
        self._covariance = np.diag([FREE_MASS_KG**2, free**2, free**2, free**2, *[0.0] * 6])
        self._begun, self._rejected, self.recognised = False, 0, False
        self._least, self._most = np.full(3, math.inf), np.full(3, -math.inf)
        self.state = ObjectState(unknown=why)

    def recognise(self, known: ObjectState) -> None:
        """Go on with what an earlier grasp showed of the object: its weight shows that nothing else carries it.

        Args:
            known: Mass and centre of mass, as `gripped_again` returns them.
        """
        mass, mass_std, com = known.mass_kg or 0.0, known.mass_std_kg or 0.0, np.array(known.com_m)
        slope = np.block([[np.ones((1, 1)), np.zeros((1, 3))], [com[:, None], mass * np.eye(3)]])
        self._mean[:4] = mass, *(mass * com)
        self._covariance[:4, :] = 0.0
        self._covariance[:, :4] = 0.0
        self._covariance[:4, :4] = slope @ np.diag([mass_std**2, *np.square(known.com_std_m or ())]) @ slope.T
        self.recognised = True

    def update(self, load: Array, motion: GripperMotion, noise: Array, rise: float, lever_m: float) -> None:
        """Learn from one reading.

        Args:
            load: Force on both pads and torque about the origin, shape (6,), N and N·m; NaN where the torque is not
                known.
            motion: Motion of the gripper at its time.
            noise: Covariance of the noise of ``load``, shape (6, 6); that of the zero before `SCALE_STD`.
            rise: By how much the errors of scale raise the errors of the zero: 1 + `SCALE_STD` · grip / noise.
            lever_m: Distance of the pads from the origin, m.
        """
        if not self._begun:
            self._covariance[4:, 4:] = noise
            self._begun = True
        known = np.isfinite(load)
        rows = self._rows(motion, rise)[known]
        expected = noise + np.diag(self._model_variance(load, motion))
        error = load[known] - rows @ self._mean
        spread = rows @ self._covariance @ rows.T + expected[np.ix_(known, known)]
        inverse = np.linalg.inv(spread)
        if not error @ inverse @ error <= REJECTED:  # NaN is rejected too
            self._rejected += 1
            if self._rejected >= MOST_REJECTED:
                self.forget(UNEXPLAINED)
            return
        self._rejected = 0
        gain = self._covariance @ rows.T @ inverse
        self._mean = self._mean + gain @ error
        kept = np.eye(10) - gain @ rows
        self._covariance = kept @ self._covariance @ kept.T + gain @ expected[np.ix_(known, known)] @ gain.T
        self._least = np.minimum(self._least, motion.gravity_mps2)
        self._most = np.maximum(self._most, motion.gravity_mps2)
        self.state = self._summary(placed=bool(known[3]), lever_m=lever_m)

    def expected(self, motion: GripperMotion) -> Array:
        """Return the load of the object without the errors of the sensors, as that of `update`, shape (6,)."""
        load: Array = self._rows(motion, 1.0)[:, :4] @ self._mean[:4]
        return load

    def _rows(self, motion: GripperMotion, rise: float) -> Array:
        """Return how the load depends on m, m c and the errors of zero and scale, shape (6, 10)."""
        rows = np.zeros((6, 10))
        turn = cross_matrix(motion.velocity_radps)
        rows[:3, 0] = motion.gravity_mps2
        rows[:3, 1:4] = -cross_matrix(motion.acceleration_radps2) - turn @ turn
        rows[3:, 1:4] = -cross_matrix(motion.gravity_mps2)
        rows[:, 4:] = rise * np.eye(6)
        return rows

    def _model_variance(self, load: Array, motion: GripperMotion) -> Array:
        """Return the variance of what the model leaves out: soft pads, timing, inertia; shape (6,)."""
        mass_kg = float(np.linalg.norm(load[:3])) / max(float(np.linalg.norm(motion.gravity_mps2)), 1.0)
        force = (MODEL_STD * float(np.linalg.norm(load[:3]))) ** 2 + (mass_kg * motion.std_mps2) ** 2
        fast = float(np.linalg.norm(motion.acceleration_radps2) + motion.velocity_radps @ motion.velocity_radps)
        torque = LEVER_M**2 * force + (mass_kg * LEVER_M**2 * fast) ** 2
        return CORRELATED * np.repeat((force, torque), 3)

    def _summary(self, *, placed: bool, lever_m: float) -> ObjectState:
        """Return what is known, with the errors of scale that no turn can show."""
        if not self.recognised and float(np.linalg.norm(self._most - self._least)) < MOVED_MPS2:
            return ObjectState(unknown=NOT_MOVED)
        mass, own = float(self._mean[0]), self._covariance
        mass_std = math.hypot(math.sqrt(own[0, 0]), SCALE_STD * mass)
        if mass < SIGNIFICANT * mass_std:
            return ObjectState(unknown=LIGHT)
        if not placed:
            return ObjectState(mass, mass_std, unknown=NO_WIDTH)
        com = self._mean[1:4] / mass
        slope = np.column_stack((-com, np.eye(3))) / mass
        spread = slope @ own[:4, :4] @ slope.T
        scale = SCALE_STD**2 * (com @ com + lever_m**2)
        std = np.sqrt(np.diag(spread) + scale)
        if std.max() > KNOWN_COM_M:
            axis = AXES[int(np.argmax(std))]
            why = f"the centre of mass is unknown along {axis} of the gripper: turn the gripper"
            return ObjectState(mass, mass_std, unknown=why)
        return ObjectState(mass, mass_std, tuple(com.tolist()), tuple(std.tolist()))
