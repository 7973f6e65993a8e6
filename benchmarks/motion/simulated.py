"""Motions of simulated grasps: the utilisation that was predicted before each, and the one that then occurred."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from motion_grips import COLS, DOWN, GRAVITY_MPS2, NOTHING, PITCH_M, ROWS, STILL, TURNS, Advised, Grip, X
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.general_grasp import GeneralGrasp
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance

from slipd.fusion import contact_from_wrench, matched_loads, utilisation
from slipd.grasp.motion_advice import GYRATION_M
from slipd.grasp.object_swing import SwingEstimate
from slipd.tools.sim.scene_parts import Pad
from slipd.types.arrays import Array

STEP_S = 0.005
FINE_M = 0.001
LIFT_M, LIFT_STEPS = 0.1, 100
"""The lift: its height, m, and the steps that it takes."""
KINDS = ("rounded", "disc", "rectangle", "ring", "two_strips")


class Compared(NamedTuple):
    """A motion, as predicted and as it occurred.

    Attributes:
        predicted: Largest utilisation that was predicted.
        rigid: Likewise as if the pads were not soft.
        seen: The swing of the object was seen before.
        occurred: Largest utilisation that occurred.
        slid: The object slid.
    """

    predicted: float
    rigid: float
    seen: bool
    occurred: float
    slid: bool


SEEN = Pad(ROWS, COLS, PITCH_M, electrode_m=PITCH_M)
FINE = Pad(40, 60, FINE_M, electrode_m=FINE_M)
FINE_X, FINE_Y = FINE.positions()


class Carried:
    """A simulated grasp that an arm carries, and what slipd learns of its swing.

    Args:
        rng: Draws the grasp.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.mass_kg, self.mu = math.exp(rng.uniform(math.log(0.1), math.log(1.5))), rng.uniform(0.3, 0.9)
        com = rng.normal(0.0, 0.012, 2)
        self.normal_n = self.mass_kg * 9.81 / (2.0 * self.mu) * rng.uniform(2.0, 6.0) + 1.0
        half = rng.uniform(0.008, 0.014)
        patch = ContactPatch(
            str(rng.choice(KINDS)), half, half * rng.uniform(0.7, 0.9), exponent=rng.choice((0.1, 0.5))
        )
        held = GraspedObject(self.mass_kg, self.mass_kg * GYRATION_M**2, tuple(com.tolist()))
        self.grasp = GeneralGrasp(
            held, patch, FrictionLaw(self.mu, 0.85 * self.mu), PadCompliance(), grip_n=self.normal_n,
            largest_grip_n=self.normal_n, about_m=held.centre_of_mass_m,
        )  # fmt: skip
        self.com_m = TURNS[0] @ np.array((*com, 0.0))
        self.swing, self.slid, self._steps = SwingEstimate(), False, 0

    def feel(self, felt: Array, turning: Array = NOTHING, *, learns: bool = True) -> None:
        """Advance by `STEP_S` in which the gripper feels this, with an angular acceleration; its orientation stays."""
        at_com = TURNS[0].T @ (felt - np.cross(turning, self.com_m))
        torque = -self.mass_kg * GYRATION_M**2 * float(TURNS[0][:, 2] @ turning)
        self.grasp.advance(STEP_S, tuple((self.mass_kg * at_com[:2]).tolist()), torque, self.normal_n)
        self.slid = self.slid or bool(self.grasp.gross)
        self._steps += 1
        if learns and self._steps % 4 == 0:
            x, y, _ = TURNS[0].T @ self.com_m
            rigid_nm = self.mass_kg * float(x * at_com[1] - y * at_com[0])
            self.swing.update(self._steps * round(STEP_S * 1e9), 2.0 * self.grasp.wrench().item(5), rigid_nm)

    def use(self) -> float:
        """Return the utilisation of the worse pad by its true pressure."""
        return max(_true(self.grasp, self.mu, right=side) for side in (False, True))


def compare(rng: np.random.Generator, build_s: float) -> Compared:
    """Simulate a grasp that holds at rest and is lifted, and a motion that builds up within about ``build_s``."""
    carried = Carried(rng)
    for k in range(60):  # from the table
        carried.feel(DOWN * (k + 1) / 60.0, learns=False)
    for k in range(LIFT_STEPS):
        part = (k + 1) / LIFT_STEPS
        up_mps2 = LIFT_M / (LIFT_STEPS * STEP_S) ** 2 * (60.0 * part - 180.0 * part**2 + 120.0 * part**3)
        carried.feel(DOWN * (1.0 + up_mps2 / GRAVITY_MPS2))
    patches = np.ones((2, X.size)) / X.size
    advised = Advised(Grip(carried.mass_kg, carried.com_m, carried.mu, carried.normal_n, patches, np.zeros((2, 3))))
    for _ in range(16):
        for _ in range(8):
            carried.feel(DOWN)
        advised.move(DOWN, STILL)
        sides = [(carried.grasp.wrench(right=side), carried.grasp.taxel_loads(SEEN, right=side)) for side in (0, 1)]
        advised.read([advised.state(*side) for side in sides])
    points = motion(rng, build_s)
    rigid = advised.check(points).utilisation
    advised.held.swing = carried.swing.swing()
    predicted = advised.check(points).utilisation
    if carried.slid or rigid is None or predicted is None or not rigid < 0.95:
        return compare(rng, build_s)
    used = []
    for point in points:
        carried.feel(point[1:4], point[7:])
        used.append(carried.use())
    return Compared(predicted, rigid, carried.swing.swing() is not None, max(used), carried.slid)


def motion(rng: np.random.Generator, build_s: float) -> Array:
    """Return a motion that builds up and stays, in the plane of the pads and about their normal."""
    count = round(2.0 * build_s / STEP_S)
    points = np.zeros((count, 10))
    points[:, 0] = np.arange(count) * STEP_S
    part = np.clip(points[:, 0] / (build_s * rng.uniform(0.7, 1.3)), 0.0, 1.0)
    build = part**3 * (10 - 15 * part + 6 * part**2)
    along = rng.uniform(-1.0, 1.0, 3) * (1.0, 0.0, 1.0)
    points[:, 1:4] = DOWN - build[:, None] * along / np.linalg.norm(along) * rng.uniform(1.0, 10.0)
    points[:, 8] = build * rng.uniform(-15.0, 15.0) * rng.integers(2)
    return points


def _true(grasp: GeneralGrasp, mu: float, *, right: bool) -> float:
    """Return the utilisation of a pad by its true pressure."""
    wrench, image = grasp.wrench(right=right), grasp.taxel_loads(FINE, right=right)
    contact = contact_from_wrench(wrench[:3], wrench[3:])
    on = image > 0.0
    loads = matched_loads(FINE_X[on], FINE_Y[on], image[on], contact)
    return utilisation(contact, loads, mu).value
