"""One simulated grasp as data: who holds what, what acts on it over time, and the sensors that feel it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from evaluate.finger_sensing import FingerSensing
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.trace import simulate

from slipd.fusion import utilisation
from slipd.types.arrays import Array

STEP_S = 5e-4
"""Of every history and trace: half the period of the force sensor."""

Load = tuple[float, float, float]
"""Force along x and y on the object, N, and torque about the origin of the left pad's frame, N·m."""

Kind = Literal["safe", "slips", "recovers"]
"""What the load is meant to do: nothing slides, the object slides, or it nearly does and does not. The truth of each
run decides, not this."""


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """A hand that pulls or turns the object through a spring and a damper: its load falls when the object moves.

    Attributes:
        path: Where the hand is relative to where it grasped the object: x, y, m, and angle, rad; shape (n, 3).
        stiffness: N/m, N/m and N·m/rad.
        damping: N·s/m, N·s/m and N·m·s/rad.
    """

    path: Array
    stiffness: tuple[float, float, float]
    damping: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A grasp to be simulated.

    Attributes:
        held: The object.
        patch: The contact.
        friction: Its friction.
        compliance: Of the pads.
        load: What acts on the object beside the hand: force (2), N, and torque, N·m, about the origin of the left pad's
            frame, which moves with the object; shape (n, 3) at steps of `STEP_S`.
        grip_n: Normal force on one pad, shape (n,), N.
        sensors: Of the finger.
        kind: What it is meant to do.
        closed_s: From then on the grip is closed, s.
        steady: From when to when load and grip are at rest, s.
        hand: Pulls on the object, if there is one.
        lost_m: The run ends where the object has slid this far.
    """

    held: GraspedObject
    patch: ContactPatch
    friction: FrictionLaw
    compliance: PadCompliance
    load: Array
    grip_n: Array
    sensors: FingerSensing
    kind: Kind
    closed_s: float
    steady: tuple[float, float] | None = None
    hand: Hand | None = None
    lost_m: float = 0.04

    @property
    def seconds(self) -> float:
        """Longest duration."""
        return (len(self.grip_n) - 1) * STEP_S


@dataclass(frozen=True, slots=True)
class Contact:
    """What a scene is drawn around; loads are scaled by its exact friction limit.

    Attributes:
        patch: The contact.
        friction: Its friction.
        compliance: Of the pads.
        grip_n: The grip force of the hold, N.
        sensors: Of the finger.
    """

    patch: ContactPatch
    friction: FrictionLaw
    compliance: PadCompliance
    grip_n: float
    sensors: FingerSensing

    def load(self, direction: Load, used: float, grip_n: float | None = None) -> Array:
        """Return the load along a direction that uses the share ``used`` of the limit at a grip force, shape (3,)."""
        return np.asarray(direction) * (used / self.used(direction, grip_n))

    def used(self, load: Load, grip_n: float | None = None) -> float:
        """Return λ of a load on both pads at a grip force."""
        grip_n = self.grip_n if grip_n is None else grip_n
        at_rest = LoadHistory(np.zeros(1), np.zeros((1, 2)), np.zeros(1), np.full(1, grip_n))
        cells = simulate(GraspedObject(), self.patch, self.friction, self.compliance, at_rest).pressure(0)
        holds, mu = 2.0 * cells.holds_n, self.friction.mu_s
        return utilisation(cells.x_m, cells.y_m, holds, mu, load[:2], load[2], (0.0, 0.0)).value

    @property
    def reach_m(self) -> float:
        """Rough lever of the friction: torque limit over force limit, m."""
        return self.used((1.0, 0.0, 0.0)) / self.used(self.about_centre(0.0, 1.0))

    def about_centre(self, force: float, torque: float, angle: float = 0.0) -> Load:
        """Return a load whose force acts at the centre of the patch, with a torque about it."""
        fx, fy = force * math.cos(angle), force * math.sin(angle)
        cx, cy = self.patch.centre_m
        return fx, fy, torque + cx * fy - cy * fx
