"""Rotations that a person may have meant, so that the measured one need not be exact."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.commission.touches import Mount

KEEP_RAD = math.radians(12.0)
"""A hand pushes about as exactly as this: a known rotation within it is taken instead of the measured one."""

STATED = "as the config states"


def nearest_known(rotation: Rotation, present: Mount) -> tuple[tuple[float, float, float, float], str]:
    """Return the quaternion x, y, z, w of the nearest known rotation, and how it is known; else the measured one."""
    x, y, z, w = present.quat_xyzw
    named = [((x, y, z, w), "as the config states"), ((y, z, w, x), "that of the config read as w, x, y, z")]
    named += [((-x, -y, -z, w), "the inverse of that of the config")]
    known = [(Rotation.from_quat(quaternion), how) for quaternion, how in named]
    stated = known[0][0]
    known += [
        (stated * each, f"that of the config, with the sensor turned by {text}") for each, text in _right_angles()
    ]
    known += [(each, f"by {text} from the pad") for each, text in [(Rotation.identity(), "0°"), *_right_angles()]]
    angle, number = min(((rotation * each.inv()).magnitude(), number) for number, (each, _) in enumerate(known))
    nearest, how = known[number] if angle <= KEEP_RAD else (rotation, "as measured, about ±5°")
    first, second, third, fourth = (float(f"{part:.7f}") + 0.0 for part in nearest.as_quat(canonical=True))
    if number == 0 and angle <= KEEP_RAD:
        return present.quat_xyzw, how
    return (first, second, third, fourth), how


def _right_angles() -> Iterator[tuple[Rotation, str]]:
    """Yield the rotations that take axes to axes, but for the identity."""
    for each in Rotation.create_group("O"):
        if each.magnitude() > 1e-6:
            axis = each.as_rotvec() / each.magnitude()
            text = ", ".join(f"{part:.0f}" for part in np.round(axis / np.abs(axis).max()) + 0.0)
            yield each, f"{math.degrees(each.magnitude()):.0f}° about ({text})"
