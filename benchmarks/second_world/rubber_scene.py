"""Scenes of the second world: those of `evaluate.families` with other pads, other friction and worse sensors."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, field, replace

import numpy as np
from evaluate import families
from evaluate.draw import Random, log_uniform
from evaluate.finger_sensing import FingerSensing
from evaluate.scene import STEP_S, Contact, Scene
from second_world.rubber_grasp import Rubber, RubberGrasp

from slipd.fusion import utilisation
from slipd.types.arrays import Array

RATIO = (0.7, 0.92)
"""μ_d / μ_s of every scene but those that creep."""

CREEP_RATIO, CREEP_RATE = (0.97, 1.0), (0.04, 0.1)
"""μ_d / μ_s, and growth of friction with the logarithm of the speed, where the object creeps."""

RECOVERS = 0.88
"""Factor on loads that come near the limit and go back: junctions that weaken as they slide let go before it."""


@dataclass(frozen=True, slots=True)
class Faults:
    """How the sensors of the second world are wrong, beyond `evaluate.finger_sensing`.

    Attributes:
        ring_hz: Resonance of the finger behind the force sensor.
        ring_damping: Its damping ratio.
        coupling: Share of the normal force that shows as force along x and along y.
        step_n: Quantisation of the force; of the torque a hundredth of it, in N·m.
        wander_n: Drift of the force sensor, standard deviation after a second.
        spread_pitch: Width of the load under a taxel's cover, in pitches.
        crosstalk: Share of it that reaches the neighbours.
        play: Hysteresis of the taxels: share of the reading that lags.
        play_n: How far it lags.
        creep: Growth of the reading under a load that stays.
        creep_s: Its time constant.
    """

    ring_hz: float = 150.0
    ring_damping: float = 0.1
    coupling: tuple[float, float] = (0.01, -0.01)
    step_n: float = 0.01
    wander_n: float = 0.01
    spread_pitch: float = 0.4
    crosstalk: float = 0.1
    play: float = 0.05
    play_n: float = 0.05
    creep: float = 0.05
    creep_s: float = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class RubberScene(Scene):
    """A scene with what only the second world has; ``seed`` draws its elements and the wander of its sensors."""

    rubber: Rubber = field(default_factory=Rubber)
    faults: Faults = field(default_factory=Faults)
    seed: int = 0

    @property
    def closed_n(self) -> float:
        """Grip force once the grip is closed."""
        return float(self.grip_n[round(self.closed_s / STEP_S)])

    def grasp(self) -> RubberGrasp:
        """Return the grasp before anything presses."""
        return RubberGrasp(self, self.rubber, self.closed_n, np.random.default_rng(self.seed))


def draw(family: str, seed: int) -> RubberScene:
    """Draw a grasp of a family; its loads use the same share of the friction limit as in the first world."""
    return transposed(families.draw(family, seed), zlib.crc32(f"second {family} {seed}".encode()))


def transposed(first: Scene, number: int) -> RubberScene:
    """Return a scene of the first world as one of the second; a number seeds what only that one has."""
    rng = np.random.default_rng(number)
    creeps = first.friction.viscous_s_per_m > 0.0
    ratio = rng.uniform(*(CREEP_RATIO if creeps else RATIO))
    friction = replace(first.friction, mu_d=first.friction.mu_s * ratio, viscous_s_per_m=0.0)
    rubber = draw_rubber(rng)
    if creeps:
        rubber = replace(rubber, rate=rng.uniform(*CREEP_RATE))
    scene = RubberScene(
        first.held, replace(first.patch, growth=0.0), friction, first.compliance, first.load, first.grip_n,
        worse(rng, first.sensors), first.kind, first.closed_s, first.steady, first.hand, first.lost_m,
        rubber, draw_faults(rng), number,
    )  # fmt: skip
    factor = _scale(first, scene) * (RECOVERS if first.kind == "recovers" else 1.0)
    hand = None if first.hand is None else replace(first.hand, path=factor * first.hand.path)
    return replace(scene, load=factor * first.load, hand=hand)


def draw_rubber(rng: Random) -> Rubber:
    """Draw the material of the pads."""
    return Rubber(
        branch=(rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.6)),
        relax_s=(log_uniform(rng, 0.05, 2.0), log_uniform(rng, 0.1, 3.0)),
        distance_m=log_uniform(rng, 3e-5, 5e-4),
        heal_s=log_uniform(rng, 0.03, 0.3),
        rate=rng.uniform(0.003, 0.012),
        roughness=rng.uniform(0.02, 0.1),
        scatter=rng.uniform(0.05, 0.15),
        loss=rng.uniform(0.05, 0.25),
    )


def draw_faults(rng: Random) -> Faults:
    """Draw the faults of the sensors."""
    return Faults(
        ring_hz=log_uniform(rng, 80.0, 300.0),
        ring_damping=rng.uniform(0.05, 0.2),
        coupling=(rng.normal(0.0, 0.01), rng.normal(0.0, 0.01)),
        step_n=log_uniform(rng, 0.002, 0.03),
        wander_n=log_uniform(rng, 0.002, 0.02),
        spread_pitch=rng.uniform(0.3, 0.5),
        crosstalk=rng.uniform(0.03, 0.2),
        play=rng.uniform(0.02, 0.1),
        play_n=log_uniform(rng, 0.02, 0.1),
        creep=rng.uniform(0.0, 0.08),
        creep_s=log_uniform(rng, 1.0, 5.0),
    )


def worse(rng: Random, sensors: FingerSensing) -> FingerSensing:
    """Return sensors that are a little turned, off their place and out of calibration."""
    force = replace(
        sensors.force, turn_rad=tuple(rng.normal(0.0, 0.01, 3)), off_m=tuple(rng.normal(0.0, 3e-4, 3)),
        gain=1.0 + rng.normal(0.0, 0.01),
    )  # fmt: skip
    pad = sensors.pad
    if pad is not None:
        pad = replace(pad, electronics=replace(pad.electronics, gain_spread=rng.uniform(0.05, 0.12)))
    return FingerSensing(force, pad)


def _scale(first: Scene, second: RubberScene) -> float:
    """Return the factor with which the largest load uses the same share of friction in both worlds."""
    loads, grips = first.load.copy(), first.grip_n
    if first.hand is not None:
        pulled = first.hand.path * np.array(first.hand.stiffness)
        x, y = first.patch.centre_m
        loads += pulled
        loads[:, 2] += x * pulled[:, 1] - y * pulled[:, 0]
    peak = int(np.hypot(np.hypot(*loads[:, :2].T), loads[:, 2] / 0.01).argmax())
    grip = float(grips[peak]) if grips[peak] > 0.2 * second.closed_n else second.closed_n
    fx, fy, torque = loads[peak].tolist()
    used = Contact(first.patch, first.friction, first.compliance, grip, first.sensors).used((fx, fy, torque))
    grasp = second.grasp()
    grasp.press(grip, math.inf)
    uses = used_of(grasp, second.friction.mu_s, np.array((fx, fy, torque)) / 2.0)
    return used / uses if math.isfinite(used) and 0.0 < uses < math.inf else 1.0


def used_of(grasp: RubberGrasp, mu: float, load: Array) -> float:
    """Return λ of a load on one pad: force (2) and torque about the origin of the pad's frame, shape (3,)."""
    (x, y), (fx, fy, torque) = grasp.places, load.tolist()
    return float(utilisation(x, y, grasp.loads * grasp.factors, mu, (fx, fy), torque, (0.0, 0.0)).value)
