"""Grips with a known truth, as the advice on motion sees them: two pads, their loads, friction and object."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from slipd.config import Grasp, PadPlace
from slipd.finger.finger_state import FingerState, LoadDistribution, distribute
from slipd.finger.verdict import GRIP_HOLDS
from slipd.friction.friction_state import FrictionState
from slipd.fusion import tipping_margin, utilisation
from slipd.fusion.contact import contact_of
from slipd.fusion.contact_state import WrenchUncertainty
from slipd.fusion.rows import TOUCHING
from slipd.fusion.streaming import new_readings
from slipd.grasp.arm_gravity import ArmGravity
from slipd.grasp.grasp_fingers import Place, place_fingers
from slipd.grasp.motion_advice import LOOK_NS, MotionAdvice
from slipd.grasp.motion_answers import MotionCheck, MotionLimits
from slipd.grasp.object_estimate import ObjectState
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample

PITCH_M, ROWS, COLS = 0.003, 8, 16
WIDTH_M = 0.05
PLACES = {
    "left": {"positions": [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.05, 0.0]], "quat_xyzw": [0.5, -0.5, 0.5, 0.5]},
    "right": {"positions": [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, -0.05, 0.0]], "quat_xyzw": [-0.5, -0.5, -0.5, 0.5]},
}
"""Poses of the pads of the virtual gripper, which close along y."""
GRAVITY_MPS2 = 9.80665
DOWN = np.array((0.0, 0.0, GRAVITY_MPS2))
NOTHING, STILL = np.zeros(3), np.zeros(6)


@dataclass(frozen=True, eq=False)
class Grip:
    """A grip of an object, with its truth.

    Attributes:
        mass_kg: Mass of the object.
        com_m: Its centre of mass in the gripper frame, shape (3,).
        mu: Coefficient of friction.
        normal_n: Grip force, N on one pad.
        patches: Normal force of 1 N on the taxels of each pad, shape (2, taxels).
        preload: Tangential force and spin on each pad without any load, shape (2, 3); they cancel in the gripper frame.
    """

    mass_kg: float
    com_m: Array
    mu: float
    normal_n: float
    patches: Array
    preload: Array

    def middle(self) -> Array:
        """Return the point between both contacts, in the gripper frame, shape (3,)."""
        places = zip(MIDDLES, TURNS, self.patches, strict=True)
        return np.asarray(np.mean([at + turn @ (patch @ X, patch @ Y, 0.0) for at, turn, patch in places], axis=0))


X, Y = (each.ravel() for each in np.meshgrid(*(PITCH_M * (np.arange(n) - 0.5 * (n - 1)) for n in (COLS, ROWS))))
TURNS = [Place(PadPlace.model_validate(place)).rotation for place in PLACES.values()]
MIDDLES = [Place(PadPlace.model_validate(place)).nearest_m(WIDTH_M) for place in PLACES.values()]


def random_grip(rng: np.random.Generator) -> Grip:
    """Return a random grip whose load at rest is well below the limit."""
    centre, radius = rng.normal(0.0, 0.002, 2), rng.uniform(0.004, 0.011)
    patches = []
    for side in (1.0, -1.0):  # the pads face each other: the same patch, mirrored
        away = np.hypot((X - centre[0]) / rng.uniform(0.7, 1.4), Y - side * centre[1]) / radius
        patch = np.where(away < 1.0, (1.0 - np.minimum(away, 1.0) ** 2) ** rng.choice((0.1, 0.5, 1.0)), 0.0)
        patches.append(patch * rng.uniform(0.8, 1.2, patch.size))
    shares = np.array([patch / patch.sum() for patch in patches])
    mass, mu = math.exp(rng.uniform(math.log(0.05), math.log(1.5))), rng.uniform(0.25, 1.0)
    normal = mass * GRAVITY_MPS2 / (2.0 * mu) * rng.uniform(2.5, 8.0) + 1.0
    shear, twist = rng.normal(0.0, 0.05 * mu * normal, 2), rng.normal(0.0, 0.03 * mu * normal * radius)
    preload = np.array(((shear[0], shear[1], twist), (-shear[0], shear[1], twist)))  # opposite in the gripper frame
    com = np.array((rng.normal(0.0, 0.01), rng.normal(0.0, 0.003), rng.normal(0.0, 0.02)))
    return Grip(mass, com, mu, normal, shares, preload)


def pad_loads(grip: Grip, felt: Array, couple: Array) -> list[tuple[Array, Array, Array]]:
    """Return force and spin (3), normal force and tilting moment (3) and contact centroid (2) of each pad.

    Args:
        grip: The grip.
        felt: Specific force at the centre of mass in the gripper frame, shape (3,).
        couple: Moment on the object about its centre of mass, shape (3,), N·m.
    """
    centres = [np.array((patch @ X, patch @ Y, 0.0)) for patch in grip.patches]
    found = []
    for turn, centre, preload in zip(TURNS, centres, grip.preload, strict=True):
        force, lever, moment = turn.T @ (grip.mass_kg * felt), turn.T @ (grip.com_m - grip.middle()), turn.T @ couple
        torque = 0.5 * (np.cross(lever, force) + moment)
        normal = grip.normal_n - 0.5 * force[2]
        load = np.array((0.5 * force[0], 0.5 * force[1], torque[2])) + preload
        at = centre[:2] + np.array((torque[1], -torque[0])) / normal
        found.append((load, np.array((normal, torque[0], torque[1])), at))
    return found


def pressure(patch: Array, centroid: Array) -> LoadDistribution:
    """Return the pressure on a pad: its patch, tilted so that its centroid is where the moments want it."""
    cx, cy = centroid.tolist()
    tilted = distribute("matched", X, Y, patch, contact_of((0.0, 0.0, -1.0, -cy, cx, 0.0), 0.1))
    assert tilted is not None, "no taxel is loaded"
    return tilted


def true_use(grip: Grip, felt: Array, couple: Array = NOTHING) -> float:
    """Return the utilisation of the worse pad, by the exact solver with the true numbers."""
    used = []
    for (load, (normal, _, _), at), patch in zip(pad_loads(grip, felt, couple), grip.patches, strict=True):
        on = pressure(patch, at)
        about = (float(patch @ X), float(patch @ Y))
        used.append(utilisation(on.x, on.y, on.shares * normal, grip.mu, load[:2], float(load[2]), about).value)
    return max(used)


def true_room(grip: Grip, felt: Array, safety: float, still: Array) -> float:
    """Return how far the contact centroids stay within the outline, m, with a safety on the change from ``still``."""
    room = []
    moved, rested = pad_loads(grip, felt, np.zeros(3)), pad_loads(grip, still, np.zeros(3))
    for (_, (normal, mx, my), _), (_, (_, bx, by), at), patch in zip(moved, rested, grip.patches, strict=True):
        on = patch > 0.0
        shift = safety * np.array((my - by, bx - mx)) / normal
        room.append(tipping_margin(X[on], Y[on], at + shift) + 0.5 * PITCH_M)
    return min(room)


class Advised:
    """The advice on a grip that a motion of the arm has brought to now.

    Args:
        grip: The grip.
        gravity: Gravity in the gripper frame, shape (3,), m/s².
        mu_low: Low bound of friction that slipd knows; None: the truth.
        own: What slipd knows of the object; None: the truth.
        noise: Standard deviations of force and torque, N and N·m.
        rng: Draws the noise.
    """

    def __init__(
        self, grip: Grip, gravity: Array = DOWN, mu_low: float | None = None, own: ObjectState | None = None,
        noise: tuple[float, float] = (0.0, 0.0), rng: np.random.Generator | None = None,
    ) -> None:  # fmt: skip
        self.grip, self._noise, self._rng = grip, noise, rng or np.random.default_rng(0)
        self.own = own or ObjectState(grip.mass_kg, 0.0, tuple(grip.com_m.tolist()), (0.0, 0.0, 0.0), "")
        self.held: Any = SimpleNamespace(state=self.own, supported=None, swing=None)
        self._mu = grip.mu if mu_low is None else mu_low
        self.fingers = {name: self._finger(name) for name in PLACES}
        self._config = Grasp.model_validate({"pads": PLACES})
        self._placed = place_fingers(self._config, self.fingers)
        self.arm: Any = SimpleNamespace(is_used=lambda t_ns: True, gravity=ArmGravity())
        self.advice = MotionAdvice(self._config, self._placed, self.held, self.arm)
        self.t_ns = 10_000_000_000
        for _ in range(27):
            self.move(gravity, STILL)
        for _ in range(10):
            self.feel(gravity, NOTHING)

    def move(self, gravity: Array, turning: Array) -> None:
        """Let 40 ms pass in which the arm reports this."""
        self.t_ns += LOOK_NS
        sample = ArmSample(self.t_ns, None, tuple(gravity), tuple(turning[:3]), tuple(turning[3:]))
        self.arm.gravity.update(sample, self.t_ns)

    def limits(self) -> MotionLimits:
        """Return the advice now."""
        return self.advice.limits(self.t_ns, WIDTH_M)

    def check(self, points: Array) -> MotionCheck:
        """Check a motion now."""
        return self.advice.check(points, self.t_ns, WIDTH_M)

    def arm_is_missing(self) -> None:
        """Begin anew with a config that names no arm."""
        self.advice = MotionAdvice(self._config, self._placed, self.held, None)

    def look(self) -> None:
        """Let 40 ms pass without a new reading."""
        self.t_ns += LOOK_NS
        self.advice.follow(self.t_ns)

    def _finger(self, name: str) -> Any:
        force = SimpleNamespace(
            gravity=SimpleNamespace(state=lambda t_ns: "none"), noise=WrenchUncertainty(*self._noise)
        )
        config = SimpleNamespace(grip_safety=1.5, pad=SimpleNamespace(pitch_m=PITCH_M))
        return SimpleNamespace(name=name, force=force, config=config, state=None)

    def feel(self, gravity: Array, couple: Array, turning: Array = STILL, carried: float = 1.0) -> None:
        """Let 40 ms pass in which the gripper feels this, with angular velocity and acceleration.

        A table carries the rest of the object.
        """
        self.move(gravity, turning)
        felt = gravity - np.cross(turning[3:], self.grip.com_m)
        felt -= np.cross(turning[:3], np.cross(turning[:3], self.grip.com_m))
        loads = pad_loads(self.grip, carried * felt, couple)
        self.read([self._state(load, patch) for load, patch in zip(loads, self.grip.patches, strict=True)])

    def read(self, states: Iterable[FingerState]) -> None:
        """Look at the loads, with these states of the fingers."""
        for finger, state in zip(self.fingers.values(), states, strict=True):
            finger.state = state
        self.advice.follow(self.t_ns)

    def _state(self, load: tuple[Array, Array, Array], patch: Array) -> FingerState:
        (fx, fy, spin), (normal, _, _), (cx, cy) = (each.tolist() for each in load)
        tilted = pressure(patch, load[2])
        image = np.zeros(patch.size)
        image[np.flatnonzero(patch)] = tilted.shares
        mx, my = -cy * normal, cx * normal
        centre = (float(patch @ X), float(patch @ Y))
        mz = spin + centre[0] * fy - centre[1] * fx
        noise = self._rng.normal(0.0, 1.0, 6) * np.repeat(self._noise, 3)
        wrench = np.array((fx, fy, -normal, mx, my, mz)) + noise
        return self.state(wrench, image)

    def state(self, wrench: Array, image: Array) -> FingerState:
        """Return the state of a finger with this wrench on its pad, and this image."""
        contact = contact_of(wrench.tolist(), 0.1)
        reading = new_readings([wrench.tolist()], [self.t_ns])
        reading["phase"], reading["contact"] = TOUCHING, contact
        pressed = distribute("matched", X, Y, image, contact)
        return FingerState(
            self.t_ns,
            GRIP_HOLDS,
            reading=reading,
            load_distribution=pressed,
            friction=FrictionState(self._mu, "config", self._mu),
        )
