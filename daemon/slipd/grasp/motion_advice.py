"""How fast the arm may go with the object in the grip, so that the grip holds.

The load of each pad under another motion is its mean load now and what the change adds (`slipd.fusion.held_pad`). What
is not known counts against the motion. See "How fast may it go", ``docs/physics.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slipd.config import Grasp
from slipd.finger.verdict import danger_reasons
from slipd.fusion.held_pad import UNBOUNDED, HeldPad
from slipd.fusion.motion_limits import nearest_limit, worst_turn
from slipd.fusion.motion_scale import check_points, follow_gravity, largest_scales
from slipd.grasp.arm_gravity import ERROR_MPS2, ArmGravity
from slipd.grasp.arm_motion import ArmMotion
from slipd.grasp.grasp_fingers import PlacedFinger
from slipd.grasp.held_object import HeldObject
from slipd.grasp.motion_answers import Mode, MotionCheck, MotionLimits, NotKnownError, unbounded
from slipd.grasp.object_estimate import GYRATION_M
from slipd.grasp.object_swing import with_swing
from slipd.grasp.pad_load import MEMORY_READINGS, PadLoad, shares_of
from slipd.signals.gravity import MOST_GRAVITY_MPS2, STANDARD_GRAVITY_MPS2, gravities_at
from slipd.types.arrays import Array

LOOK_NS = 40_000_000
"""The loads are read this often."""
OBJECT_STDS = 2.0
"""Mass, centre of mass and inertia count with so many standard deviations to the worse side."""
MOST_TURN_RADPS2 = 200.0
"""Largest angular acceleration that is reported."""
RESTING_MPS2, RESTING_RADPS = 0.1, 0.02
"""A motion whose first point is this close to rest begins at rest."""
LIKE_NOW_MPS2 = 1.0
"""One whose first point has the apparent gravity of now, within this, begins now."""
NO_ARM = "the motion of the arm is not known: the config has no [grasp.arm]"
ARM_SILENT = "the arm stream ([grasp.arm]) is stale, or not believed: see `status`"
NO_GRAVITY = "the direction of gravity is not known before 1 s of the arm stream"
_AXES = np.concatenate((np.eye(3), -np.eye(3)))[[0, 3, 1, 4, 2, 5]]


class _Held(NamedTuple):
    """Both pads with what they hold.

    Attributes:
        pads: The first and the second pad.
        apparent: Apparent gravity at the centre of mass under the mean loads, shape (3,), m/s².
        com_m: Centre of mass in the gripper frame, shape (3,).
        middle_m: Point between both contacts, shape (3,).
        gravity: Gravity in the gripper frame, shape (3,), m/s².
        gyration_m2: Square of the radius of gyration about the normal of the pads, at most, m².
    """

    pads: tuple[HeldPad, HeldPad]
    apparent: Array
    com_m: Array
    middle_m: Array
    gravity: Array
    gyration_m2: float

    def change_to(self, apparent: Array) -> Array:
        """Return the change to an apparent gravity, shape (3,) or (n, 3), without a turn, shape (6,) or (n, 6)."""
        return np.concatenate((apparent - self.apparent, np.zeros_like(apparent)), axis=-1)

    def spin_lever(self) -> Array:
        """Return what times the apparent gravity is the spin of 1 kg about the normal of the first pad, shape (3,)."""
        return np.cross(self.pads[0].turn[2], self.com_m - self.middle_m)

    def couple(self, alpha: Array) -> Array:
        """Return the torque of inertia of 1 kg under angular accelerations, shape (n, 3), rad/s²; m²/s²."""
        normal = self.pads[0].turn[2]
        about_normal = np.outer(alpha @ normal, normal)
        return -(GYRATION_M**2) * (alpha - about_normal) - self.gyration_m2 * about_normal


class MotionAdvice:
    """Advises how fast the arm may go.

    Args:
        grasp: ``[grasp]``.
        placed: Both fingers, with the places of their pads.
        held: The object in the grasp.
        arm: Motion of the arm; None: no stream reports it.

    Attributes:
        safety: Safety factor of the limits: the larger one of both fingers.
        wanted_mps2: Acceleration that is wanted in every direction.
    """

    def __init__(self, grasp: Grasp, placed: Sequence[PlacedFinger], held: HeldObject, arm: ArmMotion | None) -> None:
        self.safety = max(finger.config.grip_safety for finger, _ in placed)
        self.wanted_mps2 = grasp.motion.wanted_acceleration_mps2
        self._object, self._arm = held, arm
        self._gravity = ArmGravity() if arm is None else arm.gravity
        self._loads = [PadLoad(each) for each in placed]
        self._apparent = np.zeros(3)  # at the centre of mass, in the mean over the same looks as the loads
        self._looks = 0  # in these means

    def follow(self, t_ns: int) -> int:
        """Look at the loads; return when that is due again."""
        supported, arm = self._object.supported, self._arm
        com_m = (supported or self._object.state).com_m
        if com_m is None or arm is None or not arm.is_used(t_ns):
            self._looks = 0
            return t_ns + LOOK_NS
        wrenches = [wrench for load in self._loads if (wrench := load.held_wrench()) is not None]
        if len(wrenches) < len(self._loads):
            self._looks = 0
            return t_ns + LOOK_NS
        self._looks = min(self._looks + 1, MEMORY_READINGS)
        for load, wrench in zip(self._loads, wrenches, strict=True):
            load.update(wrench, self._looks)
        if supported is None:
            apparent = self._apparent_now(np.array(com_m))
        else:  # the pads carry only a part of its weight, or nothing
            forces_n = [load.place.rotation @ wrench[:3] for load, wrench in zip(self._loads, wrenches, strict=True)]
            apparent = np.sum(forces_n, axis=0) / (supported.mass_kg or math.inf)
        self._apparent = self._apparent + (1.0 / self._looks) * (apparent - self._apparent)
        return t_ns + LOOK_NS

    def limits(self, t_ns: int, width_m: float | None) -> MotionLimits:
        """Return how fast the arm may go at ``t_ns``, with a width between the pads (None: unknown)."""
        try:
            held = self._held(t_ns, width_m)
        except NotKnownError as why:
            return MotionLimits(str(why))
        rest, directions = held.change_to(held.gravity), np.zeros((2, 3))
        found = [
            nearest_limit(pad, rest, self.safety, self.wanted_mps2, direction)
            for pad, direction in zip(held.pads, directions, strict=True)
        ]
        ways = np.concatenate((directions, _AXES))
        along = self._scales(held, rest, np.concatenate((-ways, np.zeros((8, 3))), axis=1), MOST_GRAVITY_MPS2)
        least = int(np.argmin(along))
        most_mps2, way = min(along[least], *(limit for limit, _ in found)), ways[least]
        fast = held.gravity - way * max(most_mps2, 1e-3)
        used, _, side, tips = self._worst(held, fast[None])
        spun = np.concatenate((held.spin_lever(), held.gyration_m2 * held.pads[0].turn[2]))
        now = self._apparent_now(held.com_m) if self._object.supported is None else held.apparent
        turn_use, turned = self._worst_orientation(held)
        limit_mps2 = max(most_mps2 - ERROR_MPS2, 0.0)
        fastest = max(self.wanted_mps2, float(np.linalg.norm(held.gravity - np.array(self._gravity.apparent_mps2))))
        return MotionLimits(
            finger=self._loads[side].finger.name,
            mode=self._mode(held.pads[side], fast - held.apparent, used, tips=tips),
            utilisation=unbounded(self._worst(held, now[None])[0]),
            acceleration_mps2=limit_mps2,
            worst_direction=way,
            accelerations_mps2=tuple(max(limit - ERROR_MPS2, 0.0) for limit in along[2:]),
            turn_utilisation=unbounded(turn_use),
            worst_gravity_mps2=turned,
            angular_acceleration_radps2=min(self._scales(held, rest, np.array((spun, -spun)), MOST_TURN_RADPS2)),
            grip_needed_n=self._grip_needed(max(lack for _, lack in found)),
            speed_scale=min(math.sqrt(limit_mps2 / fastest), 1.0),
        )

    def _worst_orientation(self, held: _Held) -> tuple[float, Array]:
        """Return the largest utilisation of a gripper at rest in any orientation, and gravity in that one."""
        gravities = np.empty((2, 3))
        for pad, gravity in zip(held.pads, gravities, strict=True):
            worst_turn(pad, held.apparent, STANDARD_GRAVITY_MPS2, gravity)
        used, worst, _, _ = self._worst(held, gravities)
        return used, gravities[worst]

    def check(self, points: Array, t_ns: int, width_m: float | None) -> MotionCheck:
        """Return whether the present grip holds a motion.

        Args:
            points: Rows of `slipd_client.messages.request_fields.POINT_COLUMNS`, shape (n, 10). Where the first
                one is at rest, gravity is followed from it; where it is like the motion of now, from now.
            t_ns: Now.
            width_m: Width between the pads, m; None: unknown.
        """
        try:
            held = self._held(t_ns, width_m)
        except NotKnownError as why:
            return MotionCheck(str(why))
        apparent, gravity = gravities_at(held.com_m, points[:, 1:]), np.zeros((len(points), 3))
        begin = self._gravity_at_begin(points[0], held.gravity)
        if begin is not None:
            follow_gravity(points, begin, gravity)
        return self._checked(held, points, apparent, gravity, known=begin is not None)

    def check_acceleration(self, acceleration_mps2: Sequence[float], t_ns: int, width_m: float | None) -> MotionCheck:
        """Return whether the present grip holds an acceleration in the present orientation, without a turn."""
        try:
            held = self._held(t_ns, width_m)
        except NotKnownError as why:
            return MotionCheck(str(why))
        points = np.zeros((1, 10))
        points[0, 1:4] = held.gravity - acceleration_mps2
        return self._checked(held, points, points[:, 1:4], held.gravity[None, :], known=True)

    def _checked(self, held: _Held, points: Array, apparent: Array, gravity: Array, *, known: bool) -> MotionCheck:
        """Return whether a motion with this apparent gravity at the centre of mass holds; see `check` for the rest.

        Without ``known`` gravity at each point, shape (n, 3), there is no time scale.
        """
        at_rest = held.change_to(gravity)
        rigid = np.concatenate((apparent - gravity, held.couple(points[:, 7:])), axis=1)
        times_s, memory = np.ascontiguousarray(points[:, 0]), _memory(held.pads)
        rest, moving = self._with_swing(held, times_s, at_rest, rigid)
        used, at, side, tips, lack, scale = check_points(*held.pads, rest, moving, self.safety, memory)
        if self._object.swing is not None and 0.0 < scale < 1.0:  # a slower motion swings otherwise
            slowed = self._with_swing(held, times_s / math.sqrt(scale), at_rest, scale * rigid)
            scale *= check_points(*held.pads, *slowed, self.safety, memory)[-1]
        return MotionCheck(
            utilisation=unbounded(used),
            at_s=float(points[at, 0]),
            finger=self._loads[side].finger.name,
            mode=self._mode(held.pads[side], rest[at, :3] + moving[at, :3], used, tips=tips),
            grip_needed_n=self._grip_needed(lack),
            time_scale=math.sqrt(scale) if known or scale == 1.0 else None,
        )

    def _with_swing(self, held: _Held, times_s: Array, rest: Array, rigid: Array) -> tuple[Array, Array]:
        """Return rest and motion of a rigid grip, as of `check_points`, with the swing of the object added."""
        if self._object.swing is None:
            return rest, rigid
        axis, apparent = held.pads[0].turn[2], held.apparent + rest[:, :3] + rigid[:, :3]
        spin = apparent @ held.spin_lever() + rigid[:, 3:] @ axis
        return with_swing(self._object.swing, times_s, spin, float(held.pads[0].mass.mean()), axis, rest, rigid)

    def _gravity_at_begin(self, point: Array, now: Array) -> Array | None:
        """Return gravity at the first point of a motion; None where it might point anywhere."""
        apparent, length = point[1:4], float(np.linalg.norm(point[1:4]))
        resting = abs(length - STANDARD_GRAVITY_MPS2) <= RESTING_MPS2 and np.abs(point[4:]).max() <= RESTING_RADPS
        if resting:
            return apparent * (STANDARD_GRAVITY_MPS2 / length)
        return now if np.abs(apparent - self._gravity.apparent_mps2).max() <= LIKE_NOW_MPS2 else None

    def _held(self, t_ns: int, width_m: float | None) -> _Held:
        """Return both pads with what they hold.

        Raises:
            NotKnownError: Something of it is not known.
        """
        if self._arm is None:
            raise NotKnownError(NO_ARM)
        if not self._arm.is_used(t_ns):
            raise NotKnownError(ARM_SILENT)
        gravity, own = self._gravity.gravity(), self._object.supported or self._object.state
        if gravity is None:
            raise NotKnownError(NO_GRAVITY)
        first, second = (load.contact(t_ns, self._looks) for load in self._loads)
        if own.mass_kg is None or own.mass_std_kg is None or own.com_m is None or own.com_std_m is None:
            raise NotKnownError(own.unknown)
        doubt_kg = OBJECT_STDS * own.mass_std_kg
        mass = np.array((max(own.mass_kg - doubt_kg, 0.0), own.mass_kg + doubt_kg))
        carried = [load.carried(width_m) for load in self._loads]
        middle, com = 0.5 * (carried[0].centre_m + carried[1].centre_m), np.array(own.com_m)
        share, spin_share = shares_of(*carried)
        error = OBJECT_STDS * np.array(own.com_std_m)
        pads = (
            self._loads[0].held(first, mass, com - middle, error, share, spin_share),
            self._loads[1].held(second, mass, com - middle, error, 1.0 - share, 1.0 - spin_share),
        )
        return _Held(pads, self._apparent, com, middle, np.array(gravity), own.gyration_m2(OBJECT_STDS))

    def _apparent_now(self, com_m: Array) -> Array:
        """Return the apparent gravity at a place of the gripper now, shape (3,), m/s²."""
        arm = self._gravity
        now = np.array((*arm.apparent_mps2, *arm.velocity_radps, *arm.acceleration_radps2))
        found: Array = gravities_at(com_m, now[None])[0]
        return found

    def _scales(self, held: _Held, rest: Array, motions: Array, most: float) -> list[float]:
        """Return the largest factor on each of ``motions``, shape (n, 6), with which the grip holds."""
        found = np.empty(len(motions))
        largest_scales(*held.pads, rest, motions, self.safety, most, _memory(held.pads), found)
        return found.tolist()

    def _worst(self, held: _Held, apparent: Array) -> tuple[float, int, int, bool]:
        """Return the largest utilisation under apparent gravities, shape (n, 3); which, its pad, and if that tips."""
        changes = held.change_to(apparent)
        found = check_points(*held.pads, changes, np.zeros_like(changes), self.safety, _memory(held.pads))
        return found[:4]

    def _mode(self, pad: HeldPad, change: Array, used: float, *, tips: bool) -> Mode:
        """Return what would happen first on a pad whose utilisation is known, under a change of apparent gravity."""
        if tips:
            return "tipping"
        along = pad.turn @ change
        tangential = pad.load[:2] + pad.mass.mean() * pad.shares.mean() * along[:2]
        normal = max(pad.normal - 0.5 * pad.mass.mean() * along[2], 1e-9)
        translation = float(np.hypot(*tangential)) / (pad.mu * normal)
        return "rotation" if "rotation" in danger_reasons(unbounded(used), translation, 0.0) else "translation"

    def _grip_needed(self, lack_n: float) -> float:
        """Return the grip force that is needed where the pads lack so much; inf where none would hold."""
        return math.inf if lack_n >= UNBOUNDED else max(min(load.normal_n for load in self._loads) + lack_n, 0.0)


def _memory(pads: tuple[HeldPad, HeldPad]) -> Array:
    return np.empty(max(pad.twists.shape[1] for pad in pads))
