"""What the families have in common: random contacts, and courses of load and grip."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from evaluate.finger_sensing import FingerSensing, ForceSensing, PadSensing
from evaluate.scene import STEP_S, Contact, Hand, Kind, Load, Scene
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance

from slipd.types.arrays import Array

Random = np.random.Generator

FREE_S = 0.15
"""Every run begins with open fingers for so long."""

GRAVITY_MPS2 = 9.81
GYRATION_M = 0.025
"""Radius of gyration of every object."""

LOSS = 0.2
"""Loss factor of the pads where the object turns on them, its slowest oscillation; that of soft silicone."""

KINDS = ("disc", "ring", "rectangle", "square", "two_strips", "rounded")


def log_uniform(rng: Random, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def draw_contact(
    rng: Random,
    *,
    kind: str | None = None,
    ratio: tuple[float, float] = (0.6, 0.97),
    sensors: FingerSensing | None = None,
) -> Contact:
    """Draw pads, friction, sensors and a grip force.

    Args:
        rng: Source of the draw.
        kind: Shape of the contact; None draws it.
        ratio: Range of μ_d / μ_s.
        sensors: None draws their noise.
    """
    kind = str(rng.choice(KINDS)) if kind is None else kind
    mu = rng.uniform(0.3, 0.9)
    length = rng.uniform(0.007, 0.0095 if kind == "square" else 0.017)
    width = length if kind == "square" else rng.uniform(0.005, 0.0095)
    patch = ContactPatch(
        kind=kind,
        half_length_m=length,
        half_width_m=width,
        inner=rng.uniform(0.3, 0.6),
        exponent=float(rng.choice((0.0, 0.3, 0.5))),
        growth=float(rng.choice((0.0, 0.0, 0.0, 1.0 / 3.0))) if kind in ("disc", "rounded") else 0.0,
        centre_m=(rng.uniform(-0.005, 0.005), rng.uniform(-0.0025, 0.0025)),
        reference_n=20.0,
        moves_with_object=False,
    )
    friction = FrictionLaw(
        mu_s=mu, mu_d=mu * rng.uniform(*ratio), stribeck_mps=log_uniform(rng, 0.002, 0.02), memory_s=0.001
    )
    soft = log_uniform(rng, 0.5, 2.0)
    return Contact(
        patch=patch,
        friction=friction,
        compliance=PadCompliance(1.5e8 * soft),
        grip_n=log_uniform(rng, 5.0, 25.0),
        sensors=draw_sensors(rng) if sensors is None else sensors,
    )


def draw_sensors(rng: Random) -> FingerSensing:
    """Draw the noise of good to middling sensors."""
    force = ForceSensing(noise_n=log_uniform(rng, 0.01, 0.03), noise_nm=log_uniform(rng, 1e-4, 3e-4))
    return FingerSensing(force, PadSensing())


def damped(pads: PadCompliance, patch: ContactPatch, held: GraspedObject) -> PadCompliance:
    """Return pads whose loss factor is `LOSS` at about the frequency of the object's slowest oscillation."""
    a, b = patch.half_length_m, patch.width_m
    spring = 2.0 * pads.stiffness_n_per_m3 * math.pi * a * b * (a * a + b * b) / 4.0
    rate = math.sqrt(spring / held.inertia_kgm2)
    return replace(pads, damping_ns_per_m3=LOSS * pads.stiffness_n_per_m3 / rate)


def pull(rng: Random, contact: Contact) -> Load:
    """Draw the direction of a force through the centre of the contact."""
    return contact.about_centre(1.0, 0.0, rng.uniform(0.0, 2.0 * math.pi))


def combined(rng: Random, contact: Contact) -> Load:
    """Draw a direction in which force and torque both use a good part of the limit."""
    part = math.radians(rng.uniform(25.0, 65.0))
    torque = float(rng.choice((-1.0, 1.0))) * contact.reach_m * math.sin(part)
    return contact.about_centre(math.cos(part), torque, rng.uniform(0.0, 2.0 * math.pi))


@dataclass
class Course:
    """A run under construction: it begins with open fingers, which then close.

    Args:
        rng: Source of what it draws.
        contact: Of the hold.
        seconds: Duration.

    Attributes:
        t: Times, shape (n,), s.
        grip: Grip force, shape (n,), N.
        load: Load, shape (n, 3).
        held_s: From then on the grip is closed.
    """

    rng: Random
    contact: Contact
    seconds: float

    def __post_init__(self) -> None:
        self.t = np.arange(round(self.seconds / STEP_S) + 1) * STEP_S
        closing_s = self.rng.uniform(0.1, 0.25)
        self.held_s = FREE_S + closing_s + 0.05
        self.grip = self.contact.grip_n * self.smooth(FREE_S, FREE_S + closing_s)
        self.load = np.zeros((self.t.size, 3))

    def line(self, from_s: float, to_s: float) -> Array:
        """Return 0 before, 1 after, and a line between two times."""
        return np.clip((self.t - from_s) / (to_s - from_s), 0.0, 1.0)

    def smooth(self, from_s: float, to_s: float) -> Array:
        """Return 0 before, 1 after, and a curve without kinks between two times."""
        part = self.line(from_s, to_s)
        return part * part * (3.0 - 2.0 * part)

    def bump(self, at_s: float, seconds: float) -> Array:
        """Return half a sine of height 1."""
        part = self.line(at_s, at_s + seconds)
        return np.sin(math.pi * part)

    def sine(self, hz: float, phase: float = 0.0) -> Array:
        """Return a sine of height 1 that fades in once the grip is closed."""
        return np.sin(2.0 * math.pi * hz * self.t + phase) * self.smooth(self.held_s, self.held_s + 0.1)

    def noise(self, cutoff_hz: float) -> Array:
        """Return low-pass noise of variance 1."""
        spectrum = np.fft.rfft(self.rng.standard_normal(self.t.size))
        hz = np.fft.rfftfreq(self.t.size, STEP_S)
        found = np.fft.irfft(spectrum / np.sqrt(1.0 + (hz / cutoff_hz) ** 4), self.t.size)
        return np.asarray(found / found.std())

    def add(self, load: Array, course: Array) -> None:
        """Add a load, shape (3,), that follows a course, shape (n,)."""
        self.load += course[:, None] * load

    def scene(self, kind: Kind, *, steady: tuple[float, float] | None = None, hand: Hand | None = None) -> Scene:
        """Return the scene; its mass is that of a weight at the largest load, so that it falls as fast as real ones."""
        heaviest = float(np.hypot(*self.load[:, :2].T).max()) / GRAVITY_MPS2
        mass = min(max(heaviest, 0.05), 3.0)
        held = GraspedObject(mass_kg=mass, inertia_kgm2=mass * GYRATION_M**2)
        contact = self.contact
        pads = damped(contact.compliance, contact.patch, held)
        return Scene(
            held, contact.patch, contact.friction, pads, self.load, np.maximum(self.grip, 0.0), contact.sensors, kind,
            self.held_s, steady, hand,
        )  # fmt: skip

    def hand(self, direction: Load, begin_s: float, used_per_s: float, *, stiff: float) -> Hand:
        """Return a hand whose spring would load the object along a direction by ``used_per_s`` of its limit a second.

        Args:
            direction: Of the load, with its force through the centre of the patch.
            begin_s: When it begins to pull.
            used_per_s: Speed of the load.
            stiff: Stiffness, N/m; about the patch the same times the square of its reach.
        """
        contact = self.contact
        fx, fy, torque = contact.load(direction, 1.0)
        cx, cy = contact.patch.centre_m
        torque -= cx * fy - cy * fx
        turning = stiff * (2.0 * contact.reach_m) ** 2
        rate = np.array((fx / stiff, fy / stiff, torque / turning)) * used_per_s
        path = np.maximum(self.t - begin_s, 0.0)[:, None] * rate
        mass = 0.3
        along, about = 0.3 * math.sqrt(stiff * mass), 0.3 * math.sqrt(turning * mass * GYRATION_M**2)
        return Hand(path, (stiff, stiff, turning), (along, along, about))
