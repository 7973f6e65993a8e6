"""How fast the arm may go with the object in the grip, so that the grip holds.

The load of each pad under another motion is its mean load now plus the change that the object's mass and centre of mass
explain (`slipd.fusion.held_pad`). What is not known counts against the motion; see "How fast may it go",
``docs/physics.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slipd.config import Grasp
from slipd.finger.finger import Finger
from slipd.finger.trust import is_trusted
from slipd.finger.verdict import danger_reasons
from slipd.fusion.held_pad import UNBOUNDED, HeldPad
from slipd.fusion.motion_limits import nearest_limit, worst_turn
from slipd.fusion.motion_scale import check_points, follow_gravity, largest_scales
from slipd.grasp.arm_history import ERROR_MPS2, ArmGravity, felt_at
from slipd.grasp.arm_motion import ArmMotion
from slipd.grasp.grasp_view import GraspView, Place
from slipd.grasp.motion_answers import Mode, MotionCheck, MotionLimits, unbounded
from slipd.grasp.pad_load import PadLoad, shares_of
from slipd.grasp.swing_estimate import with_swing
from slipd.signals.gravity import MOST_GRAVITY_MPS2, STANDARD_GRAVITY_MPS2
from slipd.types.arrays import Array

LOOK_NS = 40_000_000
"""The loads are read this often."""
OBJECT_STDS = 2.0
"""Mass and centre of mass count with so many standard deviations to the worse side."""
GYRATION_M = 0.05
"""Radius of gyration of the object about its centre of mass, at most: a rod of 0.17 m. It is not measured."""
MOST_TURN_RADPS2 = 200.0
"""Largest angular acceleration that is reported."""
RESTING_MPS2, RESTING_RADPS = 0.1, 0.02
"""A motion whose first point is this close to rest begins at rest."""
LIKE_NOW_MPS2 = 1.0
"""One whose first point feels the same as the gripper now, within this, begins now."""
NO_ARM = "the motion of the arm is not known: the config has no [grasp.arm]"
ARM_SILENT = "the arm stream ([grasp.arm]) is stale, or not believed: see `status`"
NO_GRAVITY = "the direction of gravity is not known before 1 s of the arm stream"
_AXES = np.concatenate((np.eye(3), -np.eye(3)))[[0, 3, 1, 4, 2, 5]]


class _Held(NamedTuple):
    """Both pads with what they hold.

    Attributes:
        pads: The first and the second pad.
        felt: Specific force at the centre of mass under the mean loads, shape (3,), m/s².
        com_m: Centre of mass in the gripper frame, shape (3,).
        middle_m: Point between both contacts, shape (3,).
        gravity: Gravity in the gripper frame, shape (3,), m/s².
    """

    pads: tuple[HeldPad, HeldPad]
    felt: Array
    com_m: Array
    middle_m: Array
    gravity: Array

    def at(self, felt: Array) -> Array:
        """Return the change to a specific force, shape (3,) or (n, 3), without a turn, shape (6,) or (n, 6)."""
        return np.concatenate((felt - self.felt, np.zeros_like(felt)), axis=-1)

    def about(self) -> Array:
        """Return the normal of the first pad times the lever of the object, shape (3,), m."""
        return np.cross(self.pads[0].turn[2], self.com_m - self.middle_m)


class MotionAdvice:
    """Advises how fast the arm may go.

    Args:
        grasp: ``[grasp]``.
        fingers: All fingers by name.
        view: The two fingers as one grasp, with what is known of the object.
        arm: Motion of the arm; None: no stream reports it.

    Attributes:
        safety: Safety factor of the limits: the larger one of both fingers.
        wanted_mps2: Acceleration that is wanted in every direction.
    """

    def __init__(self, grasp: Grasp, fingers: dict[str, Finger], view: GraspView, arm: ArmMotion | None) -> None:
        self.safety = max(fingers[name].config.grip_safety for name in grasp.pads)
        self.wanted_mps2 = grasp.motion.wanted_acceleration_mps2
        self._view, self._arm = view, arm
        self._gravity = ArmGravity() if arm is None else arm.gravity
        self._loads = [PadLoad(fingers[name], Place(place)) for name, place in grasp.pads.items()]
        self._felt = np.zeros(3)
        self._looked_ns = -LOOK_NS

    def follow(self, t_ns: int) -> int:
        """Look at the loads where that is due; return when it is due again."""
        if t_ns < self._looked_ns + LOOK_NS:
            return self._looked_ns + LOOK_NS
        self._looked_ns = t_ns
        lying = self._view.lying
        com_m = (lying or self._view.object).com_m
        known = com_m is not None and self._arm is not None and self._arm.is_used(t_ns)
        states = [load.finger.state for load in self._loads] if known else []
        wrenches = [
            state.wrench
            for state in states
            if state.wrench is not None and state.contact is not None and state.contact.valid
            and is_trusted(state.verdict) and state.verdict.level != "slipping"
        ]  # fmt: skip
        if com_m is None or not states or len(wrenches) < len(states):
            for load in self._loads:
                load.forget()
            return t_ns + LOOK_NS
        for load, wrench in zip(self._loads, wrenches, strict=True):
            part = load.update(wrench)
        if lying is None:
            felt = felt_at(np.array(com_m), np.array([self._row()]))[0]
        else:  # the pads carry only a part of its weight, or nothing
            carried_n = sum(
                load.place.rotation @ wrench[:3] for load, wrench in zip(self._loads, wrenches, strict=True)
            )
            felt = carried_n / (lying.mass_kg or math.inf)
        self._felt = self._felt + part * (felt - self._felt)
        return t_ns + LOOK_NS

    def limits(self, t_ns: int, width_m: float | None) -> MotionLimits:
        """Return how fast the arm may go at ``t_ns``, with a width between the pads (None: unknown)."""
        held = self._held(t_ns, width_m)
        if isinstance(held, str):
            return MotionLimits(held)
        rest, directions = held.at(held.gravity), np.zeros((2, 3))
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
        spun = np.concatenate((held.about(), GYRATION_M**2 * held.pads[0].turn[2]))
        turning = min(self._scales(held, rest, np.array((spun, -spun)), MOST_TURN_RADPS2))
        turns, now = np.empty((2, 3)), held.felt
        for pad, gravity in zip(held.pads, turns, strict=True):
            worst_turn(pad, held.felt, STANDARD_GRAVITY_MPS2, gravity)
        turn_use, worst, _, _ = self._worst(held, turns)
        if self._view.lying is None:
            now = felt_at(held.com_m, np.array([self._row()]))[0]
        limit_mps2 = max(most_mps2 - ERROR_MPS2, 0.0)
        fastest = max(self.wanted_mps2, float(np.linalg.norm(held.gravity - np.array(self._gravity.felt_mps2))))
        return MotionLimits(
            "",
            self._loads[side].finger.name,
            self._mode(held.pads[side], fast - held.felt, used, tips=tips),
            unbounded(self._worst(held, now[None])[0]),
            limit_mps2,
            way,
            tuple(max(limit - ERROR_MPS2, 0.0) for limit in along[2:]),
            unbounded(turn_use),
            turns[worst],
            turning,
            self._grip_needed(max(lack for _, lack in found)),
            min(math.sqrt(limit_mps2 / fastest), 1.0),
        )

    def check(self, points: Array, t_ns: int, width_m: float | None) -> MotionCheck:
        """Return whether the present grip holds a motion.

        Args:
            points: Rows of `slipd_client.messages.schema.request_fields.POINT_COLUMNS`, shape (n, 10). Where the first
                one is at rest, gravity is followed from it; where it is like the motion of now, from now.
            t_ns: Now.
            width_m: Width between the pads, m; None: unknown.
        """
        held = self._held(t_ns, width_m)
        if isinstance(held, str):
            return MotionCheck(held)
        felt, gravity = felt_at(held.com_m, points[:, 1:]), np.zeros((len(points), 3))
        begin = self._gravity_at_begin(points[0], held.gravity)
        if begin is not None:
            follow_gravity(points, begin, gravity)
        return self._checked(held, points, felt, gravity, known=begin is not None)

    def check_acceleration(self, acceleration_mps2: Sequence[float], t_ns: int, width_m: float | None) -> MotionCheck:
        """Return whether the present grip holds an acceleration in the present orientation, without a turn."""
        held = self._held(t_ns, width_m)
        if isinstance(held, str):
            return MotionCheck(held)
        points = np.zeros((1, 10))
        points[0, 1:4] = held.gravity - acceleration_mps2
        return self._checked(held, points, points[:, 1:4], held.gravity[None, :], known=True)

    def _checked(self, held: _Held, points: Array, felt: Array, gravity: Array, *, known: bool) -> MotionCheck:
        """Return whether a motion holds; without ``known`` gravity no time scale."""
        at_rest = held.at(gravity)
        rigid = np.concatenate((felt - gravity, -(GYRATION_M**2) * points[:, 7:]), axis=1)
        times_s, memory = np.ascontiguousarray(points[:, 0]), _memory(held.pads)
        rest, swing = self._with_swing(held, times_s, at_rest, rigid)
        used, at, side, tips, lack, scale = check_points(*held.pads, rest, swing, self.safety, memory)
        if self._view.swing is not None and 0.0 < scale < 1.0:  # a slower motion swings otherwise
            slowed = self._with_swing(held, times_s / math.sqrt(scale), at_rest, scale * rigid)
            scale *= check_points(*held.pads, *slowed, self.safety, memory)[-1]
        return MotionCheck(
            "",
            unbounded(used),
            float(points[at, 0]),
            self._loads[side].finger.name,
            self._mode(held.pads[side], rest[at, :3] + swing[at, :3], used, tips=tips),
            self._grip_needed(lack),
            math.sqrt(scale) if known or scale == 1.0 else None,
        )

    def _with_swing(self, held: _Held, times_s: Array, rest: Array, rigid: Array) -> tuple[Array, Array]:
        """Return ``rest`` and ``rigid``, the ``swing`` of a rigid grip, with that of the object."""
        if self._view.swing is None:
            return rest, rigid
        axis, felt = held.pads[0].turn[2], held.felt + rest[:, :3] + rigid[:, :3]
        spin = felt @ held.about() + rigid[:, 3:] @ axis
        return with_swing(self._view.swing, times_s, spin, float(held.pads[0].mass.mean()), axis, rest, rigid)

    def _gravity_at_begin(self, point: Array, now: Array) -> Array | None:
        """Return gravity at the first point of a motion; None where it might point anywhere."""
        felt, length = point[1:4], float(np.linalg.norm(point[1:4]))
        resting = abs(length - STANDARD_GRAVITY_MPS2) <= RESTING_MPS2 and np.abs(point[4:]).max() <= RESTING_RADPS
        if resting:
            return felt * (STANDARD_GRAVITY_MPS2 / length)
        return now if np.abs(felt - self._gravity.felt_mps2).max() <= LIKE_NOW_MPS2 else None

    def _held(self, t_ns: int, width_m: float | None) -> _Held | str:
        """Return both pads with what they hold; the reason for people where something is not known."""
        if self._arm is None:
            return NO_ARM
        if not self._arm.is_used(t_ns):
            return ARM_SILENT
        gravity, own = self._gravity.gravity(), self._view.lying or self._view.object
        if gravity is None:
            return NO_GRAVITY
        first, second = (load.known(t_ns) for load in self._loads)
        if isinstance(first, str) or isinstance(second, str):
            return first if isinstance(first, str) else str(second)
        if own.mass_kg is None or own.mass_std_kg is None or own.com_m is None or own.com_std_m is None:
            return own.unknown
        doubt_kg = OBJECT_STDS * own.mass_std_kg
        mass = np.array((max(own.mass_kg - doubt_kg, 0.0), own.mass_kg + doubt_kg))
        wholes = [load.whole(width_m) for load in self._loads]
        middle, com = 0.5 * (wholes[0].centre_m + wholes[1].centre_m), np.array(own.com_m)
        share, spin_share = shares_of(*wholes)
        error = OBJECT_STDS * np.array(own.com_std_m)
        pads = (
            self._loads[0].held(first, mass, com - middle, error, share, spin_share),
            self._loads[1].held(second, mass, com - middle, error, 1.0 - share, 1.0 - spin_share),
        )
        return _Held(pads, self._felt, com, middle, np.array(gravity))

    def _row(self) -> Array:
        """Return gravity minus acceleration, angular velocity and angular acceleration of now, shape (9,)."""
        arm = self._gravity
        return np.array((*arm.felt_mps2, *arm.velocity_radps, *arm.acceleration_radps2))

    def _scales(self, held: _Held, rest: Array, swings: Array, most: float) -> list[float]:
        """Return the largest factor on each of ``swings``, shape (n, 6), with which the grip holds."""
        found = np.empty(len(swings))
        largest_scales(*held.pads, rest, swings, self.safety, most, _memory(held.pads), found)
        return found.tolist()

    def _worst(self, held: _Held, felt: Array) -> tuple[float, int, int, bool]:
        """Return the largest utilisation under specific forces, shape (n, 3); which has it, its pad, and if it tips."""
        changes = held.at(felt)
        found = check_points(*held.pads, changes, np.zeros_like(changes), self.safety, _memory(held.pads))
        return found[:4]

    def _mode(self, pad: HeldPad, change: Array, used: float, *, tips: bool) -> Mode:
        """Return what would happen first on a pad whose utilisation is known, under a change of the specific force."""
        if tips:
            return "tipping"
        felt = pad.turn @ change
        tangential = pad.load[:2] + pad.mass.mean() * pad.shares.mean() * felt[:2]
        normal = max(pad.normal - 0.5 * pad.mass.mean() * felt[2], 1e-9)
        translation = float(np.hypot(*tangential)) / (pad.mu * normal)
        return "rotation" if "rotation" in danger_reasons(unbounded(used), translation, 0.0) else "translation"

    def _grip_needed(self, lack_n: float) -> float:
        """Return the grip force that is needed where the pads lack so much; inf where none would hold."""
        return math.inf if lack_n >= UNBOUNDED else max(min(load.normal_n for load in self._loads) + lack_n, 0.0)


def _memory(pads: tuple[HeldPad, HeldPad]) -> Array:
    return np.empty(max(pad.twists.shape[1] for pad in pads))
