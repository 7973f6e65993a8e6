"""Families in which the object slides in the end, most of them on a way that could be foreseen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from evaluate.draw import KINDS, Course, Random, combined, draw_contact, draw_sensors, log_uniform, pull
from evaluate.finger_sensing import PadSensing
from evaluate.scene import Contact, Load, Scene
from simulated_grasp.grasp_parts import FrictionMap

from slipd.tools.sim.emulated_pvdf import PvdfElectronics

BUILD_UP_S = (0.8, 2.5)
"""How long a load takes that builds up, from none to the limit; faster ones are sudden, and a family of their own."""

CREEP_RATIO = (0.9, 0.99)
"""μ_d / μ_s of an object that is pushed and creeps."""

PAD_HALF_M = (0.0256, 0.0128)
"""Half length and half width of a pad of 8 by 16 taxels."""

ARM_N_PER_M = (80.0, 1000.0)
"""Stiffness of a human arm. With a stiff one the object sticks and slips many times."""


def ramp(rng: Random) -> Scene:
    """A hand pulls harder and harder; the object follows it once it slides."""
    contact = draw_contact(rng)
    return _pulled(rng, contact, pull(rng, contact))


def pour(rng: Random) -> Scene:
    """The object becomes heavier until it falls."""
    contact = draw_contact(rng)
    return _loaded(rng, contact, pull(rng, contact))


def torsion(rng: Random) -> Scene:
    """A torque about the contact grows."""
    contact = draw_contact(rng)
    direction = contact.about_centre(0.0, float(rng.choice((-1.0, 1.0))))
    return _pulled(rng, contact, direction) if rng.random() < 0.5 else _loaded(rng, contact, direction)


def combined_ramp(rng: Random) -> Scene:
    """An eccentric load grows."""
    contact = draw_contact(rng)
    direction = combined(rng, contact)
    return _pulled(rng, contact, direction) if rng.random() < 0.5 else _loaded(rng, contact, direction)


def loosen(rng: Random) -> Scene:
    """The grip force falls under a load that stays."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 2.6)
    used = rng.uniform(0.3, 0.65)
    direction = pull(rng, contact) if rng.random() < 0.5 else combined(rng, contact)
    course.add(contact.load(direction, used), course.smooth(course.held_s, course.held_s + 0.2))
    at_s = course.held_s + 0.4
    course.grip *= 1.0 - (1.0 - 0.85 * used) * course.line(at_s, at_s + rng.uniform(0.4, 1.4))
    return course.scene("slips")


def edge(rng: Random) -> Scene:
    """The pads hold the object by an edge, where the pressure rises to one side and moves with the object."""
    contact = draw_contact(rng, kind="edge")
    contact = replace(contact, patch=replace(contact.patch, moves_with_object=True, growth=0.0))
    direction = combined(rng, contact)
    return _pulled(rng, contact, direction) if rng.random() < 0.5 else _loaded(rng, contact, direction)


def few_taxels(rng: Random) -> Scene:
    """A pad of 4 by 4 taxels, of which some feel the object."""
    electronics = PvdfElectronics(rate_hz=100.0)
    pad = PadSensing(rows=4, cols=4, pitch_m=0.0047, electrode_m=0.0035, electronics=electronics)
    sensors = replace(draw_sensors(rng), pad=pad)
    contact = draw_contact(rng, kind=str(rng.choice(("disc", "rectangle", "rounded"))), sensors=sensors)
    length = rng.uniform(0.0045, 0.0075)
    patch = replace(
        contact.patch, half_length_m=length, half_width_m=rng.uniform(0.004, length),
        centre_m=(rng.uniform(-0.0015, 0.0015), rng.uniform(-0.0015, 0.0015)), growth=0.0,
    )  # fmt: skip
    contact = replace(contact, patch=patch)
    direction = combined(rng, contact)
    return _pulled(rng, contact, direction) if rng.random() < 0.5 else _loaded(rng, contact, direction)


def far_pole(rng: Random) -> Scene:
    """A force that nearly passes through the contact: the object would turn about a far pole."""
    contact = draw_contact(rng)
    lever = float(rng.choice((-1.0, 1.0))) * rng.uniform(0.03, 0.2) * contact.reach_m
    direction = contact.about_centre(1.0, lever, rng.uniform(0.0, 2.0 * math.pi))
    return _pulled(rng, contact, direction) if rng.random() < 0.5 else _loaded(rng, contact, direction)


def partial_slip(rng: Random) -> Scene:
    """Soft pads and a slow load: a long time of partial slip before gross slip."""
    contact = draw_contact(rng, kind=str(rng.choice(("disc", "rounded", "ring", "two_strips"))))
    contact = replace(contact, compliance=replace(contact.compliance, stiffness_n_per_m3=4e7))
    course = Course(rng, contact, 3.0)
    direction = combined(rng, contact) if rng.random() < 0.7 else pull(rng, contact)
    begin = course.held_s + 0.2
    course.add(contact.load(direction, 0.8), course.smooth(begin, begin + 0.3))
    course.add(contact.load(direction, 0.3), course.line(begin + 0.4, begin + 0.4 + rng.uniform(1.0, 1.8)))
    return course.scene("slips")


def creep(rng: Random) -> Scene:
    """An object creeps, and its contact with it: it is smaller than the pad, has an edge on it, or is a long bar."""
    kind = str(rng.choice((*KINDS, "edge", "bar")))
    contact = draw_contact(rng, kind="rectangle" if kind == "bar" else kind, ratio=CREEP_RATIO)
    patch = replace(contact.patch, moves_with_object=True, growth=0.0 if kind == "edge" else contact.patch.growth)
    if kind == "bar":  # beyond the pad at both ends, with the pressure of a cylinder across
        patch = replace(patch, half_length_m=0.06, half_width_m=rng.uniform(0.003, 0.006), exponent=0.5)
        length, width = PAD_HALF_M
        contact = replace(contact, compliance=replace(contact.compliance, half_length_m=length, half_width_m=width))
    return _creeping(rng, replace(contact, patch=patch))


def flat_creep(rng: Random) -> Scene:
    """A flat object larger than the pad creeps: its contact stays on the pad, so only the load shows it."""
    return _creeping(rng, draw_contact(rng, ratio=CREEP_RATIO))


def sudden_weight(rng: Random) -> Scene:
    """Something heavy drops into the object."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 1.8)
    direction = pull(rng, contact) if rng.random() < 0.5 else combined(rng, contact)
    used = rng.uniform(0.2, 0.5)
    course.add(contact.load(direction, used), course.smooth(course.held_s, course.held_s + 0.2))
    at_s = course.held_s + rng.uniform(0.4, 0.8)
    course.add(
        contact.load(direction, rng.uniform(1.1, 1.6) - used), course.line(at_s, at_s + log_uniform(rng, 0.002, 0.02))
    )
    return course.scene("slips")


def wet_patch(rng: Random) -> Scene:
    """Part of the contact is wet; the coefficient of the config is that of the dry surface."""
    contact = draw_contact(rng)
    cx, cy = contact.patch.centre_m
    x = cx + rng.uniform(-0.7, 0.7) * contact.patch.half_length_m
    spot = FrictionMap.spot((x, cy), rng.uniform(0.3, 0.6) * contact.patch.half_length_m, rng.uniform(0.5, 0.85))
    contact = replace(contact, friction=replace(contact.friction, wet=spot))
    direction = pull(rng, contact) if rng.random() < 0.5 else combined(rng, contact)
    return _pulled(rng, contact, direction)


def second_slip(rng: Random) -> Scene:
    """A slip is stopped by more grip; later the load grows until the object slides again."""
    contact = draw_contact(rng)
    course = Course(rng, contact, 4.5)
    direction = pull(rng, contact) if rng.random() < 0.5 else combined(rng, contact)
    begin, up_s = course.held_s + 0.2, rng.uniform(0.4, 0.9)
    course.add(contact.load(direction, 1.04), course.line(begin, begin + up_s))
    more, caught = rng.uniform(1.8, 2.4), begin + up_s + rng.uniform(0.0, 0.03)
    course.grip *= 1.0 + (more - 1.0) * course.smooth(caught, caught + 0.06)
    again = caught + rng.uniform(0.8, 1.2)
    most = contact.used(tuple(contact.load(direction, 1.0)), more * contact.grip_n)
    course.add(contact.load(direction, 1.15 / most - 1.04), course.line(again, again + rng.uniform(0.8, 1.4)))
    return course.scene("slips")


def _creeping(rng: Random, contact: Contact) -> Scene:
    """The object slides at 0.3 to 3 mm/s: pushed by something stiff, or held by friction that grows with speed."""
    speed = log_uniform(rng, 3e-4, 3e-3)
    direction = pull(rng, contact)
    if rng.random() < 0.5:
        contact = replace(contact, friction=replace(contact.friction, viscous_s_per_m=0.02 / 1e-3))
        over = 20.0 * speed / contact.friction.mu_s  # of the limit, which the viscous part carries at that speed
        course = Course(rng, contact, 3.0)
        contact = course.contact = replace(
            contact, friction=replace(contact.friction, mu_d=contact.friction.mu_s * rng.uniform(0.97, 1.0))
        )
        begin = course.held_s + 0.1
        course.add(contact.load(direction, 0.85), course.smooth(begin, begin + 0.4))
        course.add(contact.load(direction, 0.15 + over), course.line(begin + 0.5, begin + 0.5 + rng.uniform(0.3, 0.8)))
        return course.scene("slips")
    contact = replace(contact, friction=replace(contact.friction, viscous_s_per_m=rng.uniform(2.0, 10.0)))
    course = Course(rng, contact, 3.5)
    begin = course.held_s + 0.1
    course.add(contact.load(direction, 0.9), course.smooth(begin, begin + 0.4))
    stiff = log_uniform(rng, 4000.0, 20000.0)
    per_s = speed * stiff / float(np.hypot(*contact.load(direction, 1.0)[:2]))
    return course.scene("slips", hand=course.hand(direction, begin + 0.5, per_s, stiff=stiff))


def _loaded(rng: Random, contact: Contact, direction: Load) -> Scene:
    """A load grows steadily to beyond the limit, from where it drives the object on."""
    course = Course(rng, contact, 3.6)
    used, begin = rng.uniform(0.0, 0.4), course.held_s + 0.1
    course.add(contact.load(direction, used), course.smooth(begin, begin + 0.2))
    seconds = (1.15 - used) * log_uniform(rng, *BUILD_UP_S)
    course.add(contact.load(direction, 1.15 - used), course.line(begin + 0.3, begin + 0.3 + seconds))
    return course.scene("slips")


def _pulled(rng: Random, contact: Contact, direction: Load) -> Scene:
    """A hand pulls through the spring of an arm, and follows."""
    course = Course(rng, contact, 3.6)
    used, begin = rng.uniform(0.0, 0.4), course.held_s + 0.1
    course.add(contact.load(direction, used), course.smooth(begin, begin + 0.2))
    stiff = log_uniform(rng, *ARM_N_PER_M)
    return course.scene(
        "slips", hand=course.hand(direction, begin + 0.3, 1.0 / log_uniform(rng, *BUILD_UP_S), stiff=stiff)
    )
