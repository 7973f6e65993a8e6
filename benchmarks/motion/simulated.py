"""Motions of simulated grasps: the utilisation that was predicted before each, and the one that then occurred."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from motion_grips import DOWN, PITCH_M, STILL, TURNS, Advised, Grip, X
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.general_grasp import GeneralGrasp
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance

from slipd.fusion import contact_from_wrench, matched_loads, utilisation
from slipd.grasp.motion_advice import GYRATION_M
from slipd.types.arrays import Array

STEP_S = 0.005
FINE_M = 0.001
KINDS = ("rounded", "disc", "rectangle", "ring", "two_strips")


class Compared(NamedTuple):
    """A motion, as predicted and as it occurred.

    Attributes:
        predicted: Largest utilisation that was predicted.
        occurred: Largest utilisation that occurred.
        slid: The object slid.
    """

    predicted: float
    occurred: float
    slid: bool


def taxels(pitch_m: float, rows: int, cols: int) -> Any:
    """Return a pad of square taxels."""
    x, y = np.meshgrid(*(pitch_m * (np.arange(n) - 0.5 * (n - 1)) for n in (cols, rows)))
    return _Pad(pitch_m, x.ravel(), y.ravel())


class _Pad(NamedTuple):
    pitch_m: float
    x: Array
    y: Array

    @property
    def electrode_m(self) -> float:
        return self.pitch_m

    def centres(self) -> tuple[Array, Array]:
        return self.x, self.y

    def __hash__(self) -> int:
        return hash((self.pitch_m, self.x.size))

    def __eq__(self, other: object) -> bool:
        return self is other


SEEN, FINE = taxels(PITCH_M, 8, 16), taxels(FINE_M, 40, 60)


def compare(rng: np.random.Generator, build_s: float) -> Compared:
    """Simulate a grasp that holds at rest, and a motion that builds up within about ``build_s``."""
    mass, mu = math.exp(rng.uniform(math.log(0.1), math.log(1.5))), rng.uniform(0.3, 0.9)
    com = rng.normal(0.0, 0.012, 2)
    normal = mass * 9.81 / (2.0 * mu) * rng.uniform(2.0, 6.0) + 1.0
    half = rng.uniform(0.008, 0.014)
    patch = ContactPatch(str(rng.choice(KINDS)), half, half * rng.uniform(0.7, 0.9), exponent=rng.choice((0.1, 0.5)))
    held = GraspedObject(mass, mass * GYRATION_M**2, tuple(com.tolist()))
    law = FrictionLaw(mu, 0.85 * mu)
    grasp = GeneralGrasp(
        held, patch, law, PadCompliance(), grip_n=normal, largest_grip_n=normal, about_m=held.centre_of_mass_m
    )
    com_m = TURNS[0] @ np.array((*com, 0.0))
    advised = Advised(Grip(mass, com_m, mu, normal, np.ones((2, X.size)) / X.size, np.zeros((2, 3))))
    weight = mass * (TURNS[0].T @ DOWN)[:2]
    for k in range(1, 161):
        part = min(k / 60.0, 1.0)
        grasp.advance(STEP_S, tuple((weight * part).tolist()), 0.0, normal)
        if grasp.gross:
            return compare(rng, build_s)
    for _ in range(16):
        advised.move(DOWN, STILL)
        images = [grasp.taxel_loads(SEEN, right=side) for side in (False, True)]
        advised.read([advised.state(grasp.wrench(right=side), images[side]) for side in (0, 1)])
    points = motion(rng, build_s)
    found = advised.check(points)
    if found.utilisation is None or not found.utilisation < 0.95:
        return compare(rng, build_s)
    return _occurs(grasp, points, mass, com_m, normal, mu, found.utilisation)


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


def _occurs(
    grasp: GeneralGrasp, points: Array, mass: float, com_m: Array, normal: float, mu: float, predicted: float
) -> Compared:
    """Carry the motion out; gravity is taken not to turn meanwhile."""
    used, slid = [], False
    for point in points:
        felt = TURNS[0].T @ (point[1:4] - np.cross(point[7:], com_m))
        torque = -mass * GYRATION_M**2 * float(TURNS[0][:, 2] @ point[7:])
        grasp.advance(STEP_S, tuple((mass * felt[:2]).tolist()), torque, normal)
        slid = slid or bool(grasp.gross)
        used.append(max(_true(grasp, mu, right=side) for side in (False, True)))
    return Compared(predicted, max(used), slid)


def _true(grasp: GeneralGrasp, mu: float, *, right: bool) -> float:
    """Return the utilisation of a pad by its true pressure."""
    wrench, image = grasp.wrench(right=right), grasp.taxel_loads(FINE, right=right)
    contact = contact_from_wrench(wrench[:3], wrench[3:])
    on = image > 0.0
    loads = matched_loads(FINE.x[on], FINE.y[on], image[on], contact)
    return utilisation(contact, loads, mu).value
