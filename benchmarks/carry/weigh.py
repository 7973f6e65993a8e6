"""Objects that an arm lifts, carries and turns in space, through the bytes of sensors and arm to the engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from grasp_table import grasp_table
from gripper_registers import GripperLine
from nanoseconds import MS, T0
from scipy.spatial.transform import Rotation

from slipd import config
from slipd.devices import bota
from slipd.devices.external import encode_reading
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkUp, Publish, Request, Tick, Write
from slipd.types.arrays import Array

READ_MS, FORCE_MS, ARM_MS = 4, 2, 4
G = np.array((0.0, 0.0, -9.80665))
NOISE_N, NOISE_NM = 0.02, 0.0005
NOISE = np.repeat((NOISE_N, NOISE_NM), 3)
SCALE, TILT_RAD, DRIFT = 0.006, 0.004, np.repeat((0.01, 0.0001), 3)
"""Errors of scale and of axes of a sensor, and of its zero after the tare, as standard deviations."""
ZERO = np.repeat((0.3, 0.01), 3)
TIMING_S = 0.003
"""Zero of a sensor before the tare, and error of the arm's times, likewise."""
FINGER_KG, FINGER_COM_M = 0.08, (0.002, -0.001, -0.02)
CLOSE_S, LIFT_S, END_S = 1.6, 2.1, 4.6
BOOT = "weigh"

FINGER = """
[finger.{name}]
mu = 0.8
[finger.{name}.wrench]
device = "bota"
port = "/dev/{name}"
rate_hz = 500.0
force_std_n = {force}
torque_std_nm = {torque}
mass_kg = {mass}
com_m = {com}
"""
GRIPPER = """
[gripper]
device = "robotiq_2f"
port = "/dev/gripper"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 28.5]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
speed_table = [[0, 0.02], [255, 0.15]]
max_force_n = 25.0
"""
ARM = """
[grasp.arm]
device = "external"
port = "ipc:///tmp/arm"
sensor = "arm"
rate_hz = 250.0
"""
Distortion = Callable[[Array, Array, Array], tuple[Array, Array, Array]]
"""How a sender is wrong: about apparent gravity, angular velocity and acceleration over time, each of shape (n, 3)."""


def rig() -> str:
    """Return the config."""
    own = {"force": NOISE_N, "torque": NOISE_NM, "mass": FINGER_KG, "com": list(FINGER_COM_M)}
    return "".join(FINGER.format(name=name, **own) for name in ("left", "right")) + GRIPPER + grasp_table() + ARM


@dataclass(eq=False)
class Carry:
    """One grasp and its motion.

    Args:
        rng: Source of all that is drawn.
        mass_kg: Mass of the object; 0: nothing is gripped.
        distort: How its sender is wrong.
        turns: The gripper is turned once.
        about: Axis of that turn, of length 1; None: any.
        size: Factor on the radius of gyration, which is 28 to 71 mm.
    """

    rng: np.random.Generator
    mass_kg: float
    distort: Distortion | None = None
    turns: bool = True
    about: Array | None = None
    size: float = 1.0
    com_m: Array = field(init=False)

    def __post_init__(self) -> None:
        rng = self.rng
        self.com_m = rng.uniform((-0.03, -0.015, -0.02), (0.03, 0.015, 0.05))
        spread = (self.size * rng.uniform(0.02, 0.05, 3)) ** 2
        self._inertia = self.mass_kg * np.diag(spread[[1, 0, 0]] + spread[[2, 2, 1]])
        self.inertia_kgm2 = float(self._inertia[1, 1])
        self._inertia += self.mass_kg * (self.com_m @ self.com_m * np.eye(3) - np.outer(self.com_m, self.com_m))
        self._start = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3)) * Rotation.from_rotvec((math.pi, 0.0, 0.0))
        axis = _unit(rng.normal(size=3))
        self._axis = axis if self.about is None else self.about
        self._angle = math.radians(rng.uniform(60.0, 180.0)) * self.turns
        self._turn_s = rng.uniform(0.6, 1.2)
        up = np.array((0.0, 0.0, 1.0))
        self._moves = [
            (LIFT_S, rng.uniform(0.8, 3.0), up),
            (LIFT_S + 0.5, log_uniform(rng, 1.0, 10.0), _unit(rng.normal(size=3))),
        ]
        self._moves.append((LIFT_S + 2.0, log_uniform(rng, 1.0, 10.0), _unit(rng.normal(size=3))))
        self._pulses = rng.uniform(0.08, 0.2, len(self._moves))
        self._lift_s = rng.uniform(0.03, 0.1)
        self._grip_n = max(8.0, 8.0 * self.mass_kg) * rng.uniform(1.0, 1.4)
        self._offset_m = rng.uniform(-0.005, 0.005, 2)

    def acceleration(self, t_s: Array) -> Array:
        """Return the acceleration of the origin in the world, shape (n, 3), m/s²: moves that brake and ring."""
        found = np.zeros((t_s.size, 3))
        for (at_s, most, along), pulse_s in zip(self._moves, self._pulses, strict=True):
            part = np.clip((t_s - at_s) / pulse_s, 0.0, 2.0)
            since = np.maximum(t_s - at_s - 2.0 * pulse_s, 0.0)
            ring = 0.15 * np.exp(-since / 0.06) * np.sin(90.0 * since)
            found += (most * (np.sin(math.pi * part) + ring))[:, None] * along
        return found

    def turned(self, t_s: Array) -> Rotation:
        """Return the orientations of the gripper in the world."""
        part = np.clip((t_s - LIFT_S - 1.0) / self._turn_s, 0.0, 1.0)
        angle = self._angle * part**3 * (10 - 15 * part + 6 * part**2)
        return self._start * Rotation.from_rotvec(angle[:, None] * self._axis)

    def felt(self, t_s: Array) -> tuple[Array, Array, Array]:
        """Return apparent gravity, angular velocity and acceleration in the gripper frame, shapes (n, 3)."""
        h = 1e-4
        before, now, after = (self.turned(t_s + step) for step in (-h, 0.0, h))
        first, second = (before.inv() * now).as_rotvec() / h, (now.inv() * after).as_rotvec() / h
        return now.inv().apply(G - self.acceleration(t_s)), (first + second) / 2.0, (second - first) / h

    def load(self, t_s: Array) -> Array:
        """Return force and torque about the origin that the object exerts, shape (n, 6)."""
        part = np.clip((t_s - LIFT_S) / self._lift_s, 0.0, 1.0)
        gravity, omega, alpha = self.felt(t_s)
        c, inertia = self.com_m, self._inertia
        force = self.mass_kg * (gravity - np.cross(alpha, c) - np.cross(omega, np.cross(omega, c)))
        torque = self.mass_kg * np.cross(c, gravity) - alpha @ inertia - np.cross(omega, omega @ inertia)
        return np.asarray(part[:, None] * np.hstack((force, torque)))

    def grip_n(self, t_s: Array) -> Array:
        """Return the grip force, shape (n,), N."""
        return np.asarray(self._grip_n * np.clip((t_s - CLOSE_S) / 0.2, 0.0, 1.0) * (self.mass_kg > 0.0))

    def readings(self, t_s: Array, rng: np.random.Generator, settings: config.Config) -> list[Array]:
        """Return what both sensors report at some times, each of shape (n, 6), with their errors."""
        pads = [] if settings.grasp is None else list(settings.grasp.pads.values())
        turns = [Rotation.from_quat(pad.quat_xyzw) for pad in pads]
        places = [np.array(pad.positions)[-1, 1:] for pad in pads]
        load, grip_n = self.load(t_s), self.grip_n(t_s)
        gravity, omega, alpha = self.felt(t_s)
        share = rng.uniform(0.35, 0.65)
        presses = [turn.apply(np.outer(grip_n, (0.0, 0.0, -1.0))) for turn in turns]
        forces = [part * load[:, :3] + press for part, press in zip((share, 1.0 - share), presses, strict=True)]
        spare = load[:, 3:] - sum(np.cross(place, force) for place, force in zip(places, forces, strict=True))
        offset = turns[0].apply((*self._offset_m, 0.0))
        found = []
        for turn, place, force, press in zip(turns, places, forces, presses, strict=True):
            at = place + turn.apply(FINGER_COM_M)
            own = gravity - np.cross(alpha, at) - np.cross(omega, np.cross(omega, at))
            weight = FINGER_KG * turn.inv().apply(own)
            on_pad, about_pad = turn.inv().apply(force), turn.inv().apply(spare / 2.0 + np.cross(offset, press))
            tilt = Rotation.from_rotvec(rng.normal(0.0, TILT_RAD, 3))
            wrench = np.hstack((tilt.apply(on_pad + weight), tilt.apply(about_pad + np.cross(FINGER_COM_M, weight))))
            wrench *= 1.0 + rng.normal(0.0, SCALE, 6)
            wrench += rng.normal(0.0, ZERO) + np.outer(t_s > CLOSE_S, rng.normal(0.0, DRIFT))
            found.append(wrench + rng.normal(0.0, NOISE, wrench.shape))
        return found


def play(carry: Carry, seed: int, *, stream: bool = True) -> Iterator[tuple[float, str, dict[str, Any]]]:
    """Yield when each message leaves the engine, s from the start, its topic and its body."""
    rng = np.random.default_rng((7, seed))
    settings = config.parse(rig(), "config of a carry")
    engine, line, unheard = Engine(settings, boot=BOOT, wall_minus_monotonic_ns=0), GripperLine(), b""
    exact, asked = rng.random() < 0.5, 0
    n = round(END_S * 1000 / READ_MS)
    felt_s = np.arange(n) * READ_MS * 1e-3 - 0.002 - rng.normal(0.0, TIMING_S)
    gravity, omega, alpha = carry.felt(felt_s)
    gravity, omega = gravity + rng.normal(0.0, 0.02, gravity.shape), omega + rng.normal(0.0, 0.002, omega.shape)
    if carry.distort is not None:
        gravity, omega, alpha = carry.distort(gravity, omega, alpha)
    each = READ_MS // FORCE_MS
    left, right = carry.readings(np.arange(1, n * each + 1) * FORCE_MS * 1e-3, rng, settings)

    def handle(event: Event, t_ns: int) -> Iterator[tuple[float, str, dict[str, Any]]]:
        nonlocal unheard
        for output in engine.handle(event, t_ns):
            if isinstance(output, Write) and output.link == "gripper":
                unheard += output.data
            elif isinstance(output, Publish):
                yield (t_ns - T0) * 1e-9, output.topic, output.body

    for name in engine.links:
        yield from handle(LinkUp(name, f"opened {name}"), T0)
    for step in range(1, n):
        t_ns = T0 + step * READ_MS * MS
        if stream and np.isfinite(gravity[step]).all():
            more = {"angular_acceleration_radps2": alpha[step].tolist()} if exact else {}
            sent = {"gravity_mps2": gravity[step].tolist(), "angular_velocity_radps": omega[step].tolist()} | more
            yield from handle(Bytes("arm", encode_reading("arm", t_ns - 2 * MS, **sent)), t_ns)
        for name, wrenches in (("left", left), ("right", right)):
            frames = []
            for k in range((step - 1) * each, step * each):
                at_us = T0 // 1000 + (k + 1) * FORCE_MS * 1000
                frames.append(bota.encode_frame(wrenches[k, :3], wrenches[k, 3:], at_us))
            yield from handle(Bytes(f"{name}.wrench", b"".join(frames)), t_ns)
        yield from handle(Tick(), t_ns)
        if step % 5 == 0:
            heard, unheard = unheard, b""
            if answer := line.answer(heard):
                yield from handle(Bytes("gripper", answer), t_ns)
        if step == 275:
            for name in ("left", "right"):
                asked += 1
                body = {"v": 1, "id": asked, "op": "tare", "boot": BOOT, "deadline_ns": t_ns + 100 * MS}
                yield from handle(Request(b"lab", body | {"finger": name, "seconds": 0.3}), t_ns)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))
