"""An object between two visco-elastic pads of many independent elements; it is advanced under any load."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from evaluate.scene import Scene
from second_world.rubber_kernels import AGE, Law, press, slide, stored
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionMap

from slipd.types.arrays import Array

ELEMENT_M = 0.001
LONGEST_STEP_S = 1.25e-4
RADIANS_PER_STEP = 0.25
"""Longest step as an angle of the fastest oscillation of the object on the pads."""

OVERSIZE = 1.3
"""Elements lie up to so many half lengths: the contact grows with force and time."""

EDGES = {"disc": 2, "rounded": 4, "rectangle": 8, "square": 8}
"""How flat the pad is: the depth of a point grows with this power of its distance from the centre."""


@dataclass(frozen=True, slots=True)
class Rubber:
    """What a pad of the second world is made of; drawn by `second_world.rubber_scene`.

    Attributes:
        branch: Stiffness of the Maxwell branch over that at rest, across the normal; and along it.
        relax_s: Its time constant, likewise.
        distance_m: Sliding over which a junction weakens.
        heal_s: Time in which it heals.
        rate: Growth of friction with the logarithm of the speed, over its value at ``rate_mps``.
        rate_mps: See ``rate``.
        roughness: Mean height of the asperities over the depth of the closed grip.
        scatter: Relative spread of the friction of the elements.
        loss: Loss factor of the bulk.
    """

    branch: tuple[float, float] = (0.4, 0.3)
    relax_s: tuple[float, float] = (0.4, 0.8)
    distance_m: float = 1e-4
    heal_s: float = 0.1
    rate: float = 0.01
    rate_mps: float = 1e-3
    roughness: float = 0.05
    scatter: float = 0.1
    loss: float = 0.15


def gaps_of(patch: ContactPatch, u: Array, v: Array) -> Array:
    """Return the depth at which a smooth pad touches at points in half lengths; 1 is that of the closed grip."""
    if patch.kind == "edge":
        return 0.5 * (1.0 - u) + np.abs(u) ** 16 + np.abs(v) ** 8
    if patch.kind == "ring":
        return _across(np.hypot(u, v), patch.inner) ** 2
    if patch.kind == "two_strips":
        return _across(np.abs(v), patch.inner) ** 2 + np.abs(u) ** 8
    power = EDGES[patch.kind]
    return np.abs(u) ** power + np.abs(v) ** power


def _across(away: Array, inner: float) -> Array:
    return (2.0 * away - 1.0 - inner) / (1.0 - inner)


class RubberGrasp:
    """The grasp; coordinates are those of the frame of the left pad, and the right pad mirrors it.

    Args:
        scene: Object, contact, friction and compliance; its loads are ignored.
        rubber: Material of the pads.
        grip_n: Normal force of the closed grip on one pad, N.
        rng: Source of places, heights and friction of the elements.

    Attributes:
        motion: Centre of mass (at the origin before it moves), angle, and their rates.
        places: Elements on the pad, shape (2, n), m.
        loads: Normal force on each element, shape (n,), N.
        factors: Friction of each element over that of the law, shape (n,).
        normal_n: Normal force on one pad, N.
        slid: True relative sliding of the contact, without the elastic motion: x, y of its centroid, m, and angle.
        gross_share: Share of the frictional power at elements that slide.
    """

    def __init__(self, scene: Scene, rubber: Rubber, grip_n: float, rng: np.random.Generator) -> None:
        self._patch, pads, held = scene.patch, scene.compliance, scene.held
        halves = np.array(((self._patch.half_length_m,), (self._patch.width_m,)))
        counts = np.maximum(np.ceil(2.0 * OVERSIZE * halves[:, 0] / ELEMENT_M), 8).astype(int)
        axes = [(np.arange(n) + 0.5) * (2.0 * OVERSIZE / n) - OVERSIZE for n in counts]
        grid = np.stack(np.meshgrid(*axes)).reshape(2, -1)
        grid += rng.uniform(-0.3, 0.3, grid.shape) * (2.0 * OVERSIZE / counts)[:, None]
        heights = rng.exponential(rubber.roughness, grid.shape[1])
        gaps = gaps_of(self._patch, *grid) + heights
        near = gaps < 3.0
        self._gaps = gaps[near]
        self._local = np.ascontiguousarray(halves * grid[:, near] + np.array(self._patch.centre_m)[:, None])
        self._bounds = np.array(((pads.half_length_m,), (pads.half_width_m,)))
        self._moves, self._wet = self._patch.moves_with_object, scene.friction.wet
        touching = np.clip(1.0 - self._gaps, 0.0, None)
        self._stiff = grip_n / touching.sum()
        spread = np.exp(rubber.scatter * rng.standard_normal(self._gaps.size))
        self._spread = spread * touching.sum() / (touching @ spread)
        area = 4.0 * OVERSIZE**2 * float(halves.prod()) / counts.prod()
        soft = pads.stiffness_n_per_m3 * float(area)
        fastest = self._fastest(soft * (1.0 + rubber.branch[0]), held.mass_kg, held.inertia_kgm2)
        self._law = Law(
            scene.friction.mu_s, scene.friction.mu_d, rubber.distance_m, rubber.heal_s, rubber.rate, rubber.rate_mps,
            soft, soft * rubber.branch[0], rubber.relax_s[0], rubber.loss * soft / fastest,
        )  # fmt: skip
        self._rubber, self._mass, self._inertia = rubber, held.mass_kg, held.inertia_kgm2
        self._step_s = min(LONGEST_STEP_S, RADIANS_PER_STEP / fastest)
        self.normal_n, self.gross_share, self._depth = 0.0, 0.0, 0.0
        self.motion, self._carried, self.slid, self._energy = np.zeros(6), np.zeros(3), np.zeros(3), np.zeros(4)
        self.loads, self._dents = np.zeros(self._gaps.size), np.zeros((2, self._gaps.size))
        self._state = np.zeros((5, self._gaps.size))
        self._state[AGE] = 1.0
        self._load = np.zeros(3)
        self._place()

    def _fastest(self, stiff: float, mass: float, inertia: float) -> float:
        inside = self._local[:, self._gaps < OVERSIZE]
        turning = float((inside**2).sum())
        return math.sqrt(2.0 * stiff * (inside.shape[1] / mass + turning / inertia))

    def _place(self) -> None:
        """Find where the elements are on the pad, and the friction of each."""
        x, y, angle = self.motion[:3].tolist()
        turn = np.array(((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))))
        offset = np.array(((x,), (y,)))
        self.places = turn @ self._local + offset if self._moves else self._local
        on_object = self._local if self._moves else turn.T @ (self._local - offset)
        self.factors = self._spread if self._wet is None else self._spread * wetness(self._wet, on_object)

    def press(self, grip_n: float, dt_s: float) -> None:
        """Press with a force for a time; inf lets the pads relax."""
        gaps = np.where((np.abs(self.places) <= self._bounds).all(axis=0), self._gaps, math.inf)
        ratio, relax_s = self._rubber.branch[1], self._rubber.relax_s[1]
        self._depth = press(grip_n, gaps, dt_s, self._stiff, ratio, relax_s, self._depth, self._dents, self.loads)
        self.normal_n = grip_n if self.loads.any() else 0.0

    def advance(self, dt_s: float, load: tuple[float, float, float], grip_n: float) -> None:
        """Advance under a load that changes linearly from the last one: force on the object, N, and torque, N·m."""
        self._place()
        self.press(grip_n, dt_s)
        begin, self._load = self._load, np.array(load)
        steps = math.ceil(dt_s / self._step_s - 1e-6)
        self.gross_share = slide(
            self._law, self._mass, self._inertia, steps, dt_s / steps, begin, self._load,
            self.places - self.motion[:2, None], self.loads, self.factors, self._state, self.motion, self._carried,
            self.slid, self._energy,
        )  # fmt: skip

    def wrench(self) -> Array:
        """Return force and torque of the object on the left finger, about the centre of its pad, shape (6,)."""
        fx, fy, spin = self._carried.tolist()
        (cx, cy), normal = self.centroid().tolist(), self.normal_n
        spin += self.motion.item(0) * fy - self.motion.item(1) * fx
        return np.array((fx, fy, -normal, -cy * normal, cx * normal, spin))

    def centroid(self) -> Array:
        """Return the centroid of the pressure on the pad, shape (2,), m."""
        total = self.loads.sum()
        return self.places @ self.loads / total if total > 0.0 else np.zeros(2)

    def gyration_m(self) -> float:
        """Return the radius of gyration of the pressure."""
        total = self.loads.sum()
        away = ((self.places - self.centroid()[:, None]) ** 2).sum(axis=0)
        return math.sqrt(float(away @ self.loads / total)) if total > 0.0 else 0.0

    def displacement(self) -> Array:
        """Return how far the object has moved over the pad, elastic motion included: x, y at the patch, and angle."""
        x, y, angle = self.motion[:3].tolist()
        (cx, cy), cos, sin = self._patch.centre_m, math.cos(angle), math.sin(angle)
        return np.array((x + cos * cx - sin * cy - cx, y + sin * cx + cos * cy - cy, angle))

    def velocity(self) -> Array:
        """Return the rates of `displacement`."""
        vx, vy, rate = self.motion[3:].tolist()
        (cx, cy), cos, sin = self._patch.centre_m, math.cos(self.motion[2]), math.sin(self.motion[2])
        return np.array((vx - rate * (sin * cx + cos * cy), vy + rate * (cos * cx - sin * cy), rate))

    def energy(self) -> tuple[Array, float, float]:
        """Return the energies of `rubber_kernels.WORK` and its neighbours, and those of stretch and motion, J."""
        vx, vy, rate = self.motion[3:].tolist()
        moving = 0.5 * (self._mass * (vx * vx + vy * vy) + self._inertia * rate * rate)
        return self._energy.copy(), stored(self._law, self._state), moving


def wetness(wet: FrictionMap, points: Array) -> Array:
    """Return the factor on friction at points of the object, shape (n,), from the nearest point of a map."""
    last = np.array(wet.factor.shape[::-1])[:, None] - 1
    at = np.rint((points - np.array(((wet.x0_m,), (wet.y0_m,)))) / wet.cell_m)
    column, row = np.clip(at, 0, last).astype(int)
    return wet.factor[row, column]
