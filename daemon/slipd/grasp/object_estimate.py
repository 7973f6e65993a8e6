"""Mass, centre of mass and inertia of the object in a grasp, by the load on both pads and the motion of the gripper.

Both pads together carry F = m γ + A m c and, about the origin of the gripper frame, M = m c × γ: γ is the apparent
gravity at the origin (gravity minus acceleration), c the centre of mass, and A = −[α]× − [ω]×[ω]× the turn of the
gripper. Once c is known, c × A m c is added to M, and −J α for the part of α about the normal of the pads, with the
inertia J about that line through c. This is linear in m, m c and J, so a Kalman filter without motion of its state is
recursive least squares. Of the inertia for other turns nothing is known: readings of a fast one count less.

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
        inertia_kgm2: Moment of inertia about the line through its centre of mass along the normal of the pads, kg·m²;
            None: no turn about it has shown it.
        inertia_std_kgm2: Its standard deviation, kg·m².
    """

    mass_kg: float | None = None
    mass_std_kg: float | None = None
    com_m: tuple[float, ...] | None = None
    com_std_m: tuple[float, ...] | None = None
    unknown: str = ""
    inertia_kgm2: float | None = None
    inertia_std_kgm2: float | None = None

    def gyration_m2(self, stds: float) -> float:
        """Return the square of the radius of gyration about the normal of the pads, with some deviations more, m².

        Where inertia or mass is unknown, it is that of `GYRATION_M`.
        """
        if self.inertia_kgm2 is None or self.inertia_std_kgm2 is None or not self.mass_kg:
            return GYRATION_M**2
        return (self.inertia_kgm2 + stds * self.inertia_std_kgm2) / self.mass_kg


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
"""Lever with which an error of the force becomes one of the torque, m."""
GYRATION_M = 0.05
"""Largest radius of gyration of an object about its centre of mass, until a turn has shown more, m: a rod of 0.17 m."""
TURN_PART, ASIDE_PART = 0.1, 0.5
"""What the model leaves out of the moment about the normal of the pads: of a turn about it the first part, for the pads
are soft; of a turn aside the second part of what the same inertia about its axis would ask for."""
FREE_MASS_KG, FREE_COM_M = 10.0, 0.3
"""Standard deviations before the first reading; that of the inertia is of the former mass at the latter radius."""
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
KNOWN_COM_M, KNOWN_GYRATION_M = 0.02, 0.03
"""A component of the centre of mass with a larger standard deviation is unknown, and so is an inertia with a larger one
than that of the mass at the second radius, unless it is `SIGNIFICANT`."""
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
        self._mean = np.zeros(11)  # m, m c, errors of zero and scale, J
        stds = [FREE_MASS_KG, free, free, free, *[0.0] * 6, free * FREE_COM_M]
        self._covariance = np.diag(np.square(stds))
        self._begun, self._rejected, self.recognised = False, 0, False
        self._least, self._most = np.full(3, math.inf), np.full(3, -math.inf)
        self.state = ObjectState(unknown=why)

    def recognise(self, known: ObjectState) -> None:
        """Go on with what an earlier grasp showed of the object: its weight shows that nothing else carries it.

        Args:
            known: Mass, centre of mass and inertia, as `gripped_again` returns them.
        """
        mass, mass_std, com = known.mass_kg or 0.0, known.mass_std_kg or 0.0, np.array(known.com_m)
        slope = np.block([[np.ones((1, 1)), np.zeros((1, 3))], [com[:, None], mass * np.eye(3)]])
        self._mean[:4] = mass, *(mass * com)
        self._covariance[:4, :] = 0.0
        self._covariance[:, :4] = 0.0
        self._covariance[:4, :4] = slope @ np.diag([mass_std**2, *np.square(known.com_std_m or ())]) @ slope.T
        if known.inertia_kgm2 is not None and known.inertia_std_kgm2 is not None:
            self._mean[10] = known.inertia_kgm2
            self._covariance[10, :], self._covariance[:, 10] = 0.0, 0.0
            self._covariance[10, 10] = known.inertia_std_kgm2**2
        self.recognised = True

    def update(
        self, load: Array, motion: GripperMotion, noise: Array, rise: float, lever_m: float, normal: Array
    ) -> None:
        """Learn from one reading.

        Args:
            load: Force on both pads and torque about the origin, shape (6,), N and N·m; NaN where the torque is not
                known.
            motion: Motion of the gripper at its time.
            noise: Covariance of the noise of ``load``, shape (6, 6); that of the zero before `SCALE_STD`.
            rise: By how much the errors of scale raise the errors of the zero: 1 + `SCALE_STD` · grip / noise.
            lever_m: Distance of the pads from the origin, m.
            normal: Normal of the pads, shape (3,).
        """
        if not self._begun:
            self._covariance[4:10, 4:10] = noise
            self._begun = True
        known = np.isfinite(load)
        rows = self._rows(motion, rise)
        moved, com = load - rows @ self._mean, self.state.com_m
        if com is not None:
            rows[3:, 10] = -(normal @ motion.acceleration_radps2) * normal
            moved[3:] -= np.cross(com, rows[:3, 1:4] @ self._mean[1:4]) + rows[3:, 10] * self._mean[10]
        rows, error = rows[known], moved[known]
        expected = noise + self._model_covariance(load, motion, None if com is None else normal)
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
        kept = np.eye(11) - gain @ rows
        self._covariance = kept @ self._covariance @ kept.T + gain @ expected[np.ix_(known, known)] @ gain.T
        self._least = np.minimum(self._least, motion.gravity_mps2)
        self._most = np.maximum(self._most, motion.gravity_mps2)
        self.state = self._summary(placed=bool(known[3]), lever_m=lever_m)

    def expected(self, motion: GripperMotion) -> Array:
        """Return the load of the object without the errors of the sensors, as that of `update`, shape (6,)."""
        load: Array = self._rows(motion, 1.0)[:, :4] @ self._mean[:4]
        return load

    def _rows(self, motion: GripperMotion, rise: float) -> Array:
        """Return how the load depends on m, m c and the errors of zero and scale, shape (6, 11); not yet on J."""
        rows = np.zeros((6, 11))
        turn = cross_matrix(motion.velocity_radps)
        rows[:3, 0] = motion.gravity_mps2
        rows[:3, 1:4] = -cross_matrix(motion.acceleration_radps2) - turn @ turn
        rows[3:, 1:4] = -cross_matrix(motion.gravity_mps2)
        rows[:, 4:10] = rise * np.eye(6)
        return rows

    def _model_covariance(self, load: Array, motion: GripperMotion, normal: Array | None) -> Array:
        """Return the covariance of what the model leaves out: soft pads, timing, inertia; shape (6, 6).

        With a ``normal`` of the pads, the inertia of a turn about it is in the model.
        """
        mass_kg = float(np.linalg.norm(load[:3])) / max(float(np.linalg.norm(motion.gravity_mps2)), 1.0)
        force = (MODEL_STD * float(np.linalg.norm(load[:3]))) ** 2 + (mass_kg * motion.std_mps2) ** 2
        alpha, omega, inertia = motion.acceleration_radps2, motion.velocity_radps, mass_kg * GYRATION_M**2
        fast = inertia * float(np.linalg.norm(alpha) + omega @ omega)
        found = np.diag(np.repeat((force, LEVER_M**2 * force + fast**2), 3))
        if normal is not None:
            turn, tilt = float(normal @ alpha), omega - float(normal @ omega) * normal
            aside = float(np.linalg.norm(alpha - turn * normal) + np.linalg.norm(tilt) * np.linalg.norm(omega))
            left = max(inertia, float(self._mean[10])) * (TURN_PART * abs(turn) + ASIDE_PART * aside)
            found[3:, 3:] += (left**2 - fast**2) * np.outer(normal, normal)
        return CORRELATED * found

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
        inertia = max(float(self._mean[10]), 0.0)
        inertia_std = math.hypot(math.sqrt(own[10, 10]), MODEL_STD * inertia)
        if inertia_std > max(mass * KNOWN_GYRATION_M**2, inertia / SIGNIFICANT):
            return ObjectState(mass, mass_std, tuple(com.tolist()), tuple(std.tolist()))
        return ObjectState(mass, mass_std, tuple(com.tolist()), tuple(std.tolist()), "", inertia, inertia_std)
