"""How far the readings in the poses of a weighing are from those of any weight, and the pose to blame. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from slipd.signals.gravity import STANDARD_GRAVITY_MPS2
from slipd.tools.commission.sensor_position import cross_matrix
from slipd.types.arrays import Array

MOST_MISFIT = 0.2
"""Largest residual of the force, as a share of the weight, root mean square over the poses: hands hold a pose to about
5° (0.1)."""

LEAST_LEVER_M = 0.02
"""Added to the levers with which residuals of the torque are compared, m: the torque of a light finger is near the
noise of the sensor."""

Misfit = Callable[[Array, Array], float]


def force_misfit(wrenches: Array, gravities: Array) -> float:
    """Return how far the forces are from those of the best weight, as a share of it, root mean square over the poses.

    Args:
        wrenches: In the pad frame, shape (poses, 6), N and N·m.
        gravities: Shape (poses, 3), m/s².
    """
    weight_n, d_force, d_gravity = _centred(wrenches, gravities)
    if weight_n <= 0.0:
        return math.inf
    residual_n = float(np.linalg.norm(d_force - weight_n / STANDARD_GRAVITY_MPS2 * d_gravity))
    return residual_n / math.sqrt(len(gravities)) / weight_n


def torque_misfit(wrenches: Array, gravities: Array, sensor_m: float) -> float:
    """Return how far the torques are from those of the best centre of mass, as a share of the weight times its levers.

    Args:
        wrenches: In the pad frame, shape (poses, 6), N and N·m.
        gravities: Shape (poses, 3), m/s².
        sensor_m: Distance of the sensor from the pad, m.
    """
    weight_n, _, _ = _centred(wrenches, gravities)
    if weight_n <= 0.0:
        return math.inf
    matrix = np.vstack([np.hstack((-cross_matrix(each), np.eye(3))) for each in gravities])  # p × g + b
    torques = wrenches[:, 3:].ravel()
    found = np.linalg.lstsq(matrix, torques, rcond=None)[0]
    com_m = float(np.linalg.norm(found[:3])) * STANDARD_GRAVITY_MPS2 / weight_n
    residual_nm = float(np.linalg.norm(torques - matrix @ found)) / math.sqrt(len(gravities))
    return residual_nm / (weight_n * (com_m + sensor_m + LEAST_LEVER_M))


def worst_pose(misfit: Misfit, wrenches: Array, gravities: Array) -> int | None:
    """Return the pose without which the others fit; None where all fit, or no single one is to blame.

    Args:
        misfit: Of some poses.
        wrenches: In the pad frame, shape (poses, 6), N and N·m.
        gravities: Shape (poses, 3), m/s².
    """
    without = [
        misfit(np.delete(wrenches, number, axis=0), np.delete(gravities, number, axis=0))
        for number in range(len(gravities))
    ]
    if misfit(wrenches, gravities) <= MOST_MISFIT or min(without) > MOST_MISFIT:
        return None
    return int(np.argmin(without))


def _centred(wrenches: Array, gravities: Array) -> tuple[float, Array, Array]:
    """Return the best weight, N, and forces and gravities less their means."""
    d_force, d_gravity = wrenches[:, :3] - wrenches[:, :3].mean(axis=0), gravities - gravities.mean(axis=0)
    scatter = float(np.sum(d_gravity**2))
    mass_kg = float(np.sum(d_gravity * d_force)) / scatter if scatter > 0.0 else 0.0
    return mass_kg * STANDARD_GRAVITY_MPS2, d_force, d_gravity
