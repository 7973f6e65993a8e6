"""Find rotation and origin of a force sensor in the pad frame; a rotation that was probably meant is taken. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.tools.commission.touches import CENTRE, NAMES, PUSHES, Doubt, Mount, Symmetry, Touch
from slipd.types.arrays import Array, cross_matrix

KEEP_RAD = math.radians(12.0)
"""A hand pushes about as exactly as this: a known rotation within it is taken instead of the measured one."""

SAME_RAD = math.radians(1.0)
"""Known rotations within this of each other are one: a measured half turn is its own inverse but for its noise."""

STATED = "as the config states"


def nearest_known(rotation: Rotation, present: Mount) -> tuple[tuple[float, float, float, float], str]:
    """Return the quaternion x, y, z, w of the nearest known rotation, and how it is known; else the measured one."""
    known = [(float((rotation * each.inv()).magnitude()), each, how) for each, how in _known_rotations(present)]
    least_rad = min(away_rad for away_rad, _, _ in known)
    nearest, how = next((each, how) for away_rad, each, how in known if away_rad <= least_rad + SAME_RAD)
    if (rotation * nearest.inv()).magnitude() > KEEP_RAD:
        nearest, how = rotation, "as measured, about ±5°"
    if how == STATED:
        return present.quat_xyzw, how
    x, y, z, w = (float(f"{part:.7f}") + 0.0 for part in nearest.as_quat(canonical=True))
    return (x, y, z, w), how


def _known_rotations(present: Mount) -> Iterator[tuple[Rotation, str]]:
    """Yield the likely rotations, and how each is known, the likeliest first."""
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


MOST_MISFIT_M = 0.005
"""Largest distance between the place of a touch by torque and by the image, m: taxels of some millimetres, and an image
that ends at the edge of the pad, explain less."""

MOST_BY_HAND_M = 0.010
"""The same without an image, m: a hand meets the centre by some millimetres."""

Loads = Mapping[str, tuple[Array, Array]]
"""Force and torque of each touch in the axes of the pad, about the origin of the sensor."""

_Equation = tuple[Array, Array]
"""Matrix and right side of one touch for the origin, divided by the force, so that the residual is a length."""


def find_position(touches: Mapping[str, Touch], loads: Loads, symmetry: Symmetry | None) -> tuple[Array, float]:
    """Return the origin of the sensor by least squares over M = (p − r) × F.

    Args:
        touches: By step.
        loads: The same touches in the axes of the pad.
        symmetry: Orientation of the image, which shows the places p; None without an image: then the touches at the
            centre count alone.

    Returns:
        The origin in the pad frame, shape (3,), and the root mean square of the residuals of the places, m.

    Raises:
        Doubt: A residual is larger than sensors and hand explain.
    """
    equations: dict[str, _Equation] = {}
    for step, (force, torque) in loads.items():
        scan_m = touches[step].scan_m
        if symmetry is not None and scan_m is not None:
            place = np.append(symmetry.place(scan_m), 0.0)
        elif step in (CENTRE, *PUSHES):
            place = np.zeros(3)
        else:
            continue
        size = float(np.linalg.norm(force))
        equations[step] = cross_matrix(force) / size, (torque - np.cross(place, force)) / size  # r × F = −F × r
    xyz_m, residuals = _solve(equations)
    misfit_m = float(np.linalg.norm(residuals, axis=1).max())
    if not misfit_m <= (MOST_BY_HAND_M if symmetry is None else MOST_MISFIT_M):
        rests = {step: {other: each for other, each in equations.items() if other != step} for step in equations}
        worst = min(rests, key=lambda step: float(np.linalg.norm(_solve(rests[step])[1])))
        raise Doubt(
            f"the places by torque miss by up to {1e3 * misfit_m:.1f} mm, wherever the sensor is; {NAMES[worst]} fits "
            "the others worst: was the finger touched beside the pad, or does a cable pull at it?",
            worst,
        )
    return np.round(xyz_m, 4) + 0.0, float(np.sqrt(np.mean(residuals**2)))


def _solve(equations: Mapping[str, _Equation]) -> tuple[Array, Array]:
    """Return the origin, m, and the residual of each touch, shape (touches, 3), m."""
    matrix = np.vstack([each for each, _ in equations.values()])
    side = np.concatenate([each for _, each in equations.values()])
    xyz_m = np.linalg.lstsq(matrix, side, rcond=None)[0]
    return np.asarray(xyz_m), np.asarray((matrix @ xyz_m - side).reshape(-1, 3))
