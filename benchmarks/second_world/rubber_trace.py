"""Play a scene of the second world: what happened, and what the sensors of the fingers see of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from evaluate.finger_sensing import PadSensing
from evaluate.playing import SAFETY, load_at
from evaluate.scene import STEP_S
from evaluate.truth import Truth
from numpy.typing import ArrayLike
from scipy.signal import lfilter
from second_world.rubber_grasp import RubberGrasp
from second_world.rubber_scene import Faults, RubberScene, used_of

from slipd.types.arrays import Array

IMAGE_EVERY, USED_EVERY = 10, 4
"""Steps of `STEP_S` from one image to the next, and from one λ to the next."""

GROSS_SHARE = 0.95
"""As in the first world, see `evaluate.truth`."""

RIGHT = np.array((1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
"""Signs of a wrench in the frame of the right pad, which mirrors the left one."""


@dataclass(eq=False)
class RubberTrace:
    """The course of a grasp at n times.

    Attributes:
        t_s: Times, shape (n,), s.
        normal_n: Normal force on one pad, shape (n,), N.
        wrench_left: What the force sensor behind the left pad is given, about the centre of the pad, shape (n, 6).
        slid: True relative sliding of the contact, elastic motion apart: x, y, m, and angle, rad; shape (n, 3).
        displacement: Motion of the object over the pad, elastic motion included, shape (n, 3).
        gross: Whether the contact slides as a whole, shape (n,).
        used: True λ, shape (n,).
        gyration_m: Of the pressure, shape (n,).
        images: Places (2, n) and loads (n,) of the elements at every `IMAGE_EVERY` samples.
        faults: Of the sensors.
    """

    t_s: Array
    normal_n: Array
    wrench_left: Array
    slid: Array
    displacement: Array
    gross: np.ndarray
    used: Array
    gyration_m: Array
    images: list[tuple[Array, Array]]
    faults: Faults
    _read: dict[tuple[PadSensing, bool], Array] = field(default_factory=dict)

    @property
    def wrench_right(self) -> Array:
        """Likewise behind the right pad, in its frame."""
        return self.wrench_left * RIGHT

    def taxel_loads(self, pad: PadSensing, times_s: ArrayLike, *, right: bool = False) -> Array:
        """Return the readings of a pad's taxels at some times, shape (m, taxels), N."""
        key = pad, right
        if key not in self._read:
            self._read[key] = readings(self.images, pad, self.faults, right=right)
        at = (np.asarray(times_s) - self.t_s[0]) / (IMAGE_EVERY * STEP_S)
        return self._read[key][np.clip(at.astype(int), 0, len(self.images) - 1)]


def play(scene: RubberScene, used_every: int = USED_EVERY) -> RubberTrace:
    """Simulate a scene, with λ at every so many steps; the trace ends where the object is lost."""
    grasp, n = scene.grasp(), len(scene.grip_n)
    rows, images = [], []
    begin = n if scene.hand is None else int(scene.hand.path.any(axis=1).argmax())
    held_at, used = np.zeros(3), 0.0
    for i in range(n):
        if i == begin:
            held_at = grasp.displacement()
        if i:
            load = load_at(scene, i, scene.load[i].tolist(), grasp, held_at if i >= begin else None)
            grasp.advance(STEP_S, load, float(scene.grip_n[i]))
        if i % used_every == 0:
            used = _used(grasp, scene.friction.mu_s)
        if i % IMAGE_EVERY == 0:
            images.append((grasp.places.copy(), grasp.loads.copy()))
        moved = grasp.displacement()
        gross = grasp.gross_share >= GROSS_SHARE and grasp.normal_n > 0.0
        rows.append((grasp.normal_n, *grasp.wrench(), *grasp.slid, *moved, gross, used, grasp.gyration_m()))
        if math.hypot(moved[0], moved[1]) > scene.lost_m or abs(moved[2]) > 1.0:
            break
    found = np.array(rows)
    wrench = found[:, 1:7]
    rng = np.random.default_rng(scene.seed + 1)
    return RubberTrace(
        np.arange(len(found)) * STEP_S, found[:, 0], felt(wrench, scene.faults, rng), found[:, 7:10],
        found[:, 10:13], found[:, 13] > 0.0, found[:, 14], found[:, 15], images, scene.faults,
    )  # fmt: skip


def _used(grasp: RubberGrasp, mu: float) -> float:
    if grasp.normal_n <= 0.0:
        return 0.0
    found = used_of(grasp, mu, grasp.wrench()[[0, 1, 5]])
    return found if math.isfinite(found) else 9.9


def truth_of(scene: RubberScene, trace: RubberTrace) -> Truth:
    """Return the truth that metrics are held against; its speed is that of the junctions, without elastic motion."""
    rate = np.gradient(trace.slid, trace.t_s, axis=0)
    speed = np.hypot(np.hypot(rate[:, 0], rate[:, 1]), np.abs(rate[:, 2]) * trace.gyration_m)
    return Truth(
        trace.t_s, trace.used, speed, trace.gross, trace.normal_n, SAFETY * trace.used * trace.normal_n,
        scene.friction.mu_s,
    )  # fmt: skip


def felt(wrench: Array, faults: Faults, rng: np.random.Generator) -> Array:
    """Return what a force sensor is given: the finger rings, normal force couples over, the zero wanders, in steps."""
    w, z = 2.0 * math.pi * faults.ring_hz * STEP_S, faults.ring_damping
    decay, turn = math.exp(-z * w), math.cos(w * math.sqrt(1.0 - z * z))
    poles = (1.0, -2.0 * decay * turn, decay * decay)
    rung = lfilter((sum(poles),), poles, wrench, axis=0)
    rung[:, :2] += rung[:, 2:3] * np.array(faults.coupling)
    step = faults.step_n * np.array((1.0, 1.0, 1.0, 0.01, 0.01, 0.01))
    walk = np.cumsum(rng.standard_normal(wrench.shape), axis=0) * math.sqrt(STEP_S)
    return np.asarray(np.rint((rung + walk * faults.wander_n * step / faults.step_n) / step) * step)


def readings(images: list[tuple[Array, Array]], pad: PadSensing, faults: Faults, *, right: bool) -> Array:
    """Return what taxels with crosstalk, hysteresis and creep read of the pressure, shape (images, taxels), N."""
    x, y = pad.positions()
    points = np.stack((x, -y if right else y))
    seen, before, weights = [], None, np.zeros(0)
    lag, slow = np.zeros(x.size), np.zeros(x.size)
    follow = IMAGE_EVERY * STEP_S / faults.creep_s
    for places, loads in images:
        if before is None or not np.array_equal(places, before):
            weights, before = _weights(points, places, pad.pitch_m, faults), places
        load = weights @ loads
        lag = np.clip(lag, load - faults.play_n, load + faults.play_n)
        slow += follow * (load - slow)
        seen.append((1.0 - faults.play) * load + faults.play * lag + faults.creep * slow)
    return np.clip(np.array(seen), 0.0, None)


def _weights(points: Array, places: Array, pitch_m: float, faults: Faults) -> Array:
    """Return the share of each element's load under each taxel, shape (taxels, n), and what leaks to its neighbours."""
    square = ((points[:, :, None] - places[:, None, :]) ** 2).sum(axis=0) / pitch_m**2

    def bell(width: float) -> Array:
        return np.asarray(np.exp(-square / (2.0 * width**2)) / (2.0 * math.pi * width**2))

    near = faults.spread_pitch
    return (1.0 - faults.crosstalk) * bell(near) + faults.crosstalk * bell(near + 0.7)
