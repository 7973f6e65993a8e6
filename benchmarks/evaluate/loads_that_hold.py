"""Families in which nothing slides: whatever they report as a slip is false."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from evaluate.draw import Course, Random, combined, draw_contact, log_uniform, pull
from evaluate.scene import Contact, Load, Scene

SWING_DEG = (1.0, 3.0)
"""How far a box turns on its pads while an arm swings it, as in real grips."""


def hold(rng: Random, seconds: float = 4.0) -> Scene:
    """An object at rest in the hand."""
    course, *_ = _held(rng, seconds, 0.2, 0.66)
    return course.scene("safe", steady=(course.held_s + 0.4, seconds))


def lift(rng: Random) -> Scene:
    """The weight comes on while the hand rises, which accelerates and brakes."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 2.0)
    load = contact.load(_some(rng, contact), rng.uniform(0.3, 0.6))
    begin = course.held_s + rng.uniform(0.0, 0.2)
    lifted = begin + rng.uniform(0.05, 0.3)
    course.add(load, course.smooth(begin, lifted))
    extra, seconds = rng.uniform(0.05, 0.25), rng.uniform(0.1, 0.4)
    course.add(load, extra * (course.bump(lifted, seconds) - course.bump(lifted + 2.0 * seconds, seconds)))
    return course.scene("safe")


def shake(rng: Random, seconds: float = 2.5) -> Scene:
    """The hand swings the object."""
    course, contact, used = _held(rng, seconds, 0.25, 0.45)
    course.add(contact.load(_some(rng, contact), rng.uniform(0.1, 0.8 - used)), course.sine(log_uniform(rng, 0.8, 8.0)))
    return course.scene("safe")


def vibrate(rng: Random) -> Scene:
    """A motor at 120 Hz, with its harmonic, in grip and load."""
    course, contact, _ = _held(rng, 2.5, 0.25, 0.55)
    hz, phase = 120.0 * rng.uniform(0.97, 1.03), rng.uniform(0.0, 6.0)
    wave = course.sine(hz, phase) + 0.3 * course.sine(2.0 * hz, 2.0 * phase)
    course.grip *= 1.0 + rng.uniform(0.01, 0.05) * wave
    course.add(contact.load(_some(rng, contact), rng.uniform(0.01, 0.05)), course.sine(hz, phase + 1.0))
    return course.scene("safe")


def collide(rng: Random) -> Scene:
    """The object bumps into something, twice."""
    course, contact, used = _held(rng, 2.0, 0.2, 0.45)
    for at_s in (0.9, 1.4):
        bump = course.bump(at_s + rng.uniform(0.0, 0.2), log_uniform(rng, 0.006, 0.04))
        course.add(contact.load(_some(rng, contact), rng.uniform(0.1, 0.6 * (0.9 - used))), bump)
    return course.scene("safe")


def tighten(rng: Random) -> Scene:
    """The grip force is raised: R falls, the load does not."""
    course, *_ = _held(rng, 2.0, 0.4, 0.9)
    at_s = course.held_s + 0.5
    course.grip *= 1.0 + rng.uniform(0.2, 1.2) * course.smooth(at_s, at_s + log_uniform(rng, 0.03, 0.3))
    return course.scene("safe")


def set_down(rng: Random) -> Scene:
    """The object is put on a table, which takes its weight."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 1.8)
    load = _weigh(course, contact, rng.uniform(0.4, 0.9))
    at_s = course.held_s + rng.uniform(0.5, 0.7)
    course.add(load, -rng.uniform(0.6, 1.0) * course.smooth(at_s, at_s + log_uniform(rng, 0.03, 0.2)))
    return course.scene("recovers")


def grip_closes(rng: Random) -> Scene:
    """The fingers close on an object that they drag along a little, and that then bears its weight soon."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 1.4)
    end = course.held_s
    ringing = np.exp(-np.maximum(course.t - end + 0.05, 0.0) / 0.05) * course.smooth(end - 0.06, end - 0.04)
    course.grip *= 1.0 + rng.uniform(0.0, 0.15) * ringing * np.sin(2.0 * math.pi * rng.uniform(15.0, 40.0) * course.t)
    used = rng.uniform(0.1, 0.5)
    dragged = contact.load(_some(rng, contact), used)
    course.load += (np.minimum(course.grip / contact.grip_n, 1.0) * course.smooth(0.2, end))[:, None] * dragged
    return course.scene("safe")


def pull_released(rng: Random) -> Scene:
    """Somebody pulls nearly to the limit, and lets go."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 1.8)
    used = rng.uniform(0.1, 0.4)
    direction = _some(rng, contact)
    course.add(contact.load(direction, used), course.smooth(course.held_s, course.held_s + 0.2))
    at_s, up_s = course.held_s + 0.3, rng.uniform(0.2, 0.6)
    pulled = course.smooth(at_s, at_s + up_s) - course.smooth(at_s + up_s + 0.05, at_s + up_s + 0.05 + _short(rng))
    course.add(contact.load(direction, rng.uniform(0.82, 0.97) - used), pulled)
    return course.scene("recovers")


def swing(rng: Random) -> Scene:
    """An arm swings a box: soft pads let it turn by 1 to 3 degrees, and it springs back."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 3.0)
    used, most = rng.uniform(0.05, 0.25), rng.uniform(0.45, 0.8)
    course.add(contact.load(pull(rng, contact), used), course.smooth(course.held_s, course.held_s + 0.2))
    angle, torque_n = rng.uniform(0.0, 2.0 * math.pi), contact.reach_m * rng.uniform(2.0, 6.0)
    swung = contact.load(contact.about_centre(1.0, float(rng.choice((-1.0, 1.0))) * torque_n, angle), most - used)
    at_s, seconds = course.held_s + 0.4, log_uniform(rng, 0.25, 0.9)
    course.add(swung, course.bump(at_s, seconds) - rng.uniform(0.0, 0.8) * course.bump(at_s + seconds, seconds))
    a, b = contact.patch.half_length_m, contact.patch.width_m
    x, y = contact.patch.centre_m
    torque = abs(swung[2] - x * swung[1] + y * swung[0])
    stiffness = torque / (math.radians(rng.uniform(*SWING_DEG)) * math.pi * a * b * (a * a + b * b) / 2.0)
    course.contact = replace(contact, compliance=replace(contact.compliance, stiffness_n_per_m3=float(stiffness)))
    return course.scene("recovers")


def micro_slip(rng: Random) -> Scene:
    """The rim of the contact slides, and the load goes back before all of it does."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 2.0)
    direction = _some(rng, contact)
    used = rng.uniform(0.3, 0.6)
    course.add(contact.load(direction, used), course.smooth(course.held_s, course.held_s + 0.2))
    at_s, up_s, down_s = course.held_s + 0.3, log_uniform(rng, 0.08, 0.5), log_uniform(rng, 0.05, 0.3)
    swing = course.smooth(at_s, at_s + up_s) - course.smooth(at_s + up_s + 0.05, at_s + up_s + 0.05 + down_s)
    course.add(contact.load(direction, rng.uniform(0.9, 0.985) - used), swing)
    return course.scene("recovers")


def actuation_noise(rng: Random) -> Scene:
    """The drive of the gripper and the arm are noisy."""
    course, contact, _ = _held(rng, 3.0, 0.3, 0.65)
    fade = course.smooth(course.held_s, course.held_s + 0.2)
    course.grip *= 1.0 + fade * rng.uniform(0.005, 0.03) * course.noise(log_uniform(rng, 10.0, 100.0))
    shaken = contact.load(_some(rng, contact), rng.uniform(0.01, 0.06))
    course.add(shaken, fade * course.noise(log_uniform(rng, 5.0, 60.0)))
    return course.scene("safe")


def change_of_grip(rng: Random) -> Scene:
    """The grip force goes to another value and back, and still holds the load."""
    course, _, used = _held(rng, 2.5, 0.3, 0.7)
    change = rng.uniform(0.2, 0.8) if rng.random() < 0.5 else -rng.uniform(0.1, 1.0 - used / 0.88)
    at_s, seconds = course.held_s + 0.4, log_uniform(rng, 0.02, 0.3)
    course.grip *= 1.0 + change * (
        course.smooth(at_s, at_s + seconds) - course.smooth(at_s + 0.8, at_s + 0.8 + seconds)
    )
    return course.scene("safe")


def change_of_load(rng: Random) -> Scene:
    """The load goes to another value and back, and the grip still holds it."""
    course, contact, used = _held(rng, 2.5, 0.2, 0.5)
    at_s, seconds = course.held_s + 0.4, log_uniform(rng, 0.01, 0.3)
    there = course.smooth(at_s, at_s + seconds) - course.smooth(at_s + 0.8, at_s + 0.8 + seconds)
    course.add(contact.load(_some(rng, contact), rng.uniform(0.1, 0.88 - used)), there)
    return course.scene("safe")


def _some(rng: Random, contact: Contact) -> Load:
    """Draw a direction: mostly force, mostly torque, or both."""
    return pull(rng, contact) if rng.random() < 0.4 else combined(rng, contact)


def _short(rng: Random) -> float:
    return log_uniform(rng, 0.005, 0.05)


def _held(rng: Random, seconds: float, least: float, most: float) -> tuple[Course, Contact, float]:
    """Draw a contact, and a course in which a load comes on that uses from ``least`` to ``most`` of the friction.

    Returns:
        The course, the contact, and the share that is used.
    """
    contact = draw_contact(rng)
    course = Course(rng, contact, seconds)
    used = rng.uniform(least, most)
    _weigh(course, contact, used)
    return course, contact, used


def _weigh(course: Course, contact: Contact, used: float) -> np.ndarray:
    """Let a load come on once the grip is closed, and return it."""
    load = contact.load(_some(course.rng, contact), used)
    course.add(load, course.smooth(course.held_s, course.held_s + course.rng.uniform(0.1, 0.3)))
    return load
