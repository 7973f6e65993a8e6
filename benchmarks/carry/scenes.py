"""Objects that an arm lifts, carries, turns and stops: the motion, and what the pads feel of it.

The motion is in the plane of the pads: the arm accelerates by up to 10 m/s², turns the gripper by up to 180° about the
normal of the pads, stops hard, and rings after each stop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from evaluate.draw import GRAVITY_MPS2, Course, Random, damped, draw_contact, log_uniform
from evaluate.scene import Kind, Scene
from simulated_grasp.grasp_parts import GraspedObject
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.trace import simulate

from slipd.fusion import utilisations
from slipd.types.arrays import Array

SECONDS = 3.2
GYRATION_M = 0.035
"""Radius of gyration of every object about its centre of mass."""
HOLDS, SLIPS = (0.5, 0.9), (1.05, 1.5)
"""Largest share of the friction that the motion uses, where it is meant to hold and where not."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Motion of the gripper in the plane of the pads, in the frame of the left pad, over the steps of a scene.

    Attributes:
        gravity_mps2: Apparent gravity at the origin, x and y, shape (n, 2), m/s².
        omega_radps: Angular velocity about the pad's normal, shape (n,), rad/s.
        alpha_radps2: Angular acceleration, shape (n,), rad/s².
    """

    gravity_mps2: Array
    omega_radps: Array
    alpha_radps2: Array

    def at(self, place_m: Array) -> Array:
        """Return the apparent gravity at a place, shape (n, 2), m/s²."""
        x, y = place_m
        along = self.alpha_radps2[:, None] * np.array((-y, x))
        return self.gravity_mps2 - along + (self.omega_radps**2)[:, None] * place_m


def draw_motion(rng: Random, course: Course, from_s: float) -> Motion:
    """Draw a lift, two straight moves with hard stops, and a turn between them."""
    t, n = course.t, course.t.size
    step_s = t[1] - t[0]
    acceleration, turned = np.zeros((n, 2)), np.zeros(n)
    phase = rng.uniform(0.0, 2.0 * math.pi)
    up = np.array((-math.cos(phase), -math.sin(phase)))
    _move(rng, course, acceleration, up, from_s, rng.uniform(1.0, 4.0))
    _move(rng, course, acceleration, _direction(rng), from_s + 0.6, log_uniform(rng, 2.0, 10.0))
    begin, seconds = from_s + 1.15, rng.uniform(0.5, 0.9)
    part = course.line(begin, begin + seconds)
    turned += (
        math.radians(rng.choice((-1.0, 1.0)) * rng.uniform(30.0, 180.0)) * part**3 * (10 - 15 * part + 6 * part**2)
    )
    turned += _ring(rng, course, begin + seconds, math.radians(rng.uniform(0.0, 0.3)))
    _move(rng, course, acceleration, _direction(rng), from_s + 2.05, log_uniform(rng, 2.0, 10.0))
    omega = np.gradient(turned, step_s)
    felt = -GRAVITY_MPS2 * up - acceleration
    cos, sin = np.cos(turned), np.sin(turned)
    gravity = np.column_stack((cos * felt[:, 0] + sin * felt[:, 1], -sin * felt[:, 0] + cos * felt[:, 1]))
    return Motion(gravity, omega, np.gradient(omega, step_s))


def _move(rng: Random, course: Course, acceleration: Array, along: Array, at_s: float, most_mps2: float) -> None:
    """Add a move from rest to rest: it accelerates, may go on, brakes as hard, and rings."""
    pulse_s, jerk_s, cruise_s = rng.uniform(0.06, 0.15), rng.uniform(0.01, 0.04), rng.uniform(0.0, 0.1)

    def pulse(begin_s: float) -> Array:
        end_s = begin_s + pulse_s
        return course.line(begin_s, begin_s + jerk_s) - course.line(end_s - jerk_s, end_s)

    stop_s = at_s + pulse_s + cruise_s
    ring = _ring(rng, course, stop_s + pulse_s, rng.uniform(0.05, 0.25) * most_mps2)
    acceleration += (most_mps2 * (pulse(at_s) - pulse(stop_s)) + ring)[:, None] * along


def _ring(rng: Random, course: Course, at_s: float, size: float) -> Array:
    """Return the ringing of an arm after a stop: a damped sine."""
    since = np.maximum(course.t - at_s, 0.0)
    return np.asarray(
        size * np.exp(-since / rng.uniform(0.04, 0.12)) * np.sin(2 * math.pi * rng.uniform(8, 25) * since)
    )


def _direction(rng: Random) -> Array:
    angle = rng.uniform(0.0, 2.0 * math.pi)
    return np.array((math.cos(angle), math.sin(angle)))


def carried(seed: int, kind: Kind) -> tuple[Scene, Motion]:
    """Draw a grasp that is carried, and holds ("safe") or slides ("slips"), and the motion."""
    rng = np.random.default_rng((31, seed, len(kind)))
    contact = draw_contact(rng)
    course = Course(rng, contact, SECONDS)
    from_s = course.held_s + rng.uniform(0.1, 0.3)
    motion = draw_motion(rng, course, from_s)
    reach_m, angle = rng.uniform(0.0, 1.5) * contact.reach_m, rng.uniform(0.0, 2.0 * math.pi)
    com = np.array(contact.patch.centre_m) + reach_m * np.array((math.cos(angle), math.sin(angle)))
    force = motion.at(com)
    spin = com[0] * force[:, 1] - com[1] * force[:, 0] - GYRATION_M**2 * motion.alpha_radps2
    lifted = course.smooth(from_s - 0.05, from_s + rng.uniform(0.0, 0.06))
    per_kg = np.column_stack((force, spin)) * lifted[:, None]
    at_rest = LoadHistory(np.zeros(1), np.zeros((1, 2)), np.zeros(1), np.full(1, contact.grip_n))
    cells = simulate(GraspedObject(), contact.patch, contact.friction, contact.compliance, at_rest).pressure(0)
    some = per_kg[::20]
    m = len(some)
    used = utilisations(
        np.tile(cells.x_m, (m, 1)), np.tile(cells.y_m, (m, 1)), np.tile(2.0 * cells.holds_n, (m, 1)),
        contact.friction.mu_s, some[:, :2], some[:, 2], (0.0, 0.0),
    ).value  # fmt: skip
    mass = float(rng.uniform(*(HOLDS if kind == "safe" else SLIPS)) / np.nanmax(used))
    held = GraspedObject(mass_kg=mass, inertia_kgm2=mass * GYRATION_M**2, centre_of_mass_m=(com[0], com[1]))
    scene = course.scene(kind)
    pads = damped(contact.compliance, contact.patch, held)
    return replace(scene, held=held, compliance=pads, load=mass * per_kg), motion
