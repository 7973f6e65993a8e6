"""The noise of the sensors of a finger, from readings while nothing touches it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.tools.commission.readings import FingerReadings
from slipd.tools.commission.touches import Mount
from slipd.types.arrays import Array

TOUCHED_N = 0.5
"""Readings that vary by more than this, N, are no noise: the finger was touched, or the gripper moved."""

LEAST_IMAGES = 20
"""Fewest images that show the noise of their taxels."""

NOISES_PER_THRESHOLD = 10.0
"""A threshold is this many times the noise of a taxel (docs/config.md)."""

POSITIVE_MEAN = 1.0 / math.sqrt(2.0 * math.pi)
"""Mean of the positive part of noise about zero, in standard deviations: an image shows no negative load."""

NOISIEST = 0.9
"""Share of the taxels that are less noisy than the one whose noise counts: a broken one is masked, not averaged."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise at rest.

    Attributes:
        force_std_n: Standard deviation of the noisiest force component, N.
        torque_std_nm: The same of the torque about the origin of the pad, N·m.
        threshold: Threshold of a taxel that follows from the images, in their unit; None where they show no noise.
    """

    force_std_n: float
    torque_std_nm: float
    threshold: float | None


def noise_at_rest(rest: FingerReadings, stated: Mount, found: Mount) -> Noise | None:
    """Return the noise of the sensors of one finger; None if it was not at rest, or its readings do not change at all.

    Args:
        rest: Readings while nothing touched.
        stated: Mounting of the force sensor by the config, with which they were published.
        found: Mounting that the config will state.
    """
    raw = np.linalg.solve(stated.matrix, np.array(rest.wrenches).T)
    force_std_n, torque_std_nm = _stds((found.matrix @ raw).T)
    if not (0.0 < force_std_n < TOUCHED_N and torque_std_nm > 0.0):
        return None
    return Noise(force_std_n, torque_std_nm, _threshold(rest))


def _stds(wrenches: Array) -> tuple[float, float]:
    """Return the largest standard deviation of a force and of a torque component about their linear trend."""
    times = np.linspace(-1.0, 1.0, len(wrenches))
    trend = np.outer(times, times @ wrenches / (times @ times))
    stds = np.std(wrenches - wrenches.mean(axis=0) - trend, axis=0, ddof=2)
    return float(stds[:3].max()), float(stds[3:].max())


def _threshold(rest: FingerReadings) -> float | None:
    if len(rest.images) < LEAST_IMAGES:
        return None
    stds = np.mean(rest.images, axis=0) / POSITIVE_MEAN
    noisy = float(np.quantile(stds, NOISIEST))
    return NOISES_PER_THRESHOLD * noisy if noisy > 0.0 else None
