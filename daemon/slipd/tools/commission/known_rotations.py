"""Rotations that a person may have meant, so that the measured one need not be exact."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.tools.commission.touches import Mount

KEEP_RAD = math.radians(12.0)
"""A hand pushes about as exactly as this: a known rotation within it is taken instead of the measured one."""

STATED = "as the config states"


def nearest_known(rotation: Rotation, present: Mount) -> tuple[tuple[float, float, float, float], str]:
    """Return the quaternion x, y, z, w of the nearest known rotation, and how it is known; else the measured one."""
    nearest, how = min(_known_rotations(present), key=lambda each: float((rotation * each[0].inv()).magnitude()))
    if (rotation * nearest.inv()).magnitude() > KEEP_RAD:
        nearest, how = rotation, "as measured, about ±5°"
    if how == STATED:
        return present.quat_xyzw, how
    x, y, z, w = (float(f"{part:.7f}") + 0.0 for part in nearest.as_quat(canonical=True))
    return (x, y, z, w), how


def _known_rotations(present: Mount) -> Iterator[tuple[Rotation, str]]:
    """Yield the likely rotations, and how each is known; of equal ones the likeliest comes first."""
    x, y, z, w = present.quat_xyzw
    stated = Rotation.from_quat((x, y, z, w))
    yield stated, STATED
    yield Rotation.from_quat((y, z, w, x)), "that of the config read as w, x, y, z"
    yield stated.inv(), "the inverse of that of the config"
    for turn, text in _right_angles():
        yield stated * turn, f"that of the config, with the sensor turned by {text}"
    yield Rotation.identity(), "by 0° from the pad"
    for turn, text in _right_angles():
        yield turn, f"by {text} from the pad"


def _right_angles() -> Iterator[tuple[Rotation, str]]:
    """Yield the rotations that take axes to axes, but for the identity."""
    for each in Rotation.create_group("O"):
        if each.magnitude() > 1e-6:
            axis = each.as_rotvec() / each.magnitude()
            text = ", ".join(f"{part:.0f}" for part in np.round(axis / np.abs(axis).max()) + 0.0)
            yield each, f"{math.degrees(each.magnitude()):.0f}° about ({text})"
