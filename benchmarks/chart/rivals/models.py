"""Cheaper models of a contact: no pole is sought, the shape of the contact is one radius or one torque.

The radius of a model that is calibrated by turning an object in the grip (``felt``) is the one that this would find:
the exact limit without force, over μ f_n. Finding it is no part of the model's time.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from chart.scenes import Scene
from numpy.typing import NDArray
from scipy.special import ellipe, ellipk

from slipd.fusion import torque_limit

PRESSURE_EXPONENT = 4
"""Of the circular patch, p ∝ (1 − (r/a)^k)^(1/k): what slipping_control ships."""

TABLE = 512
"""Entries of the power law's curve; linear between them is good to 1e-6 of the torque."""


def translation(scene: Scene) -> float:
    """Eq. (4) alone: any spin is safe while R ≤ μ, none beyond."""
    return math.inf if _ratio(scene) <= 1.0 else -math.inf


def separate(scene: Scene) -> float:
    """Translation and torsion each tested as if the other were not there."""
    return felt_torque(scene) if _ratio(scene) <= 1.0 else -math.inf


def felt_ellipsoid(scene: Scene) -> float:
    """|(f_t, m / radius)| ≤ μ f_n with the felt radius."""
    return _elliptic(felt_torque(scene), _ratio(scene))


def ellipsoid(scene: Scene) -> float:
    """m_max(0) √(1 − ρ²) with the cheap m_max(0): μ Σ F_i |r_i − C|, a turn about the contact centroid."""
    dx, dy = scene.x - scene.about[0], scene.y - scene.about[1]
    return _elliptic(scene.mu * float(scene.loads @ np.hypot(dx, dy)), _ratio(scene))


def power_law(scene: Scene) -> float:
    """The limit surface of a circular patch whose torque without force is the felt one."""
    ratio = _ratio(scene)
    if ratio > 1.0:
        return -math.inf
    root, torque = _curve()
    return felt_torque(scene) * float(np.interp(math.sqrt(1.0 - ratio), root, torque))


@lru_cache(maxsize=8)
def felt_torque(scene: Scene) -> float:
    """m_max(0), N·m: what turning the object without force measures."""
    found = torque_limit(scene.x, scene.y, scene.loads, scene.mu, (0.0, 0.0), scene.about)
    return found.torque_nm


def _ratio(scene: Scene) -> float:
    """ρ = |f_t| / (μ f_n)."""
    return math.hypot(*scene.tangential) / (scene.mu * float(scene.loads.sum()))


def _elliptic(torque: float, ratio: float) -> float:
    return torque * math.sqrt((1.0 - ratio) * (1.0 + ratio)) if ratio <= 1.0 else -math.inf


@lru_cache(maxsize=1)
def _curve() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """√(1 − ρ), rising, and m / m_max(0) of the circular patch, from poles at rising distance of its centre."""
    poles = np.concatenate(([0.0], np.logspace(-3.0, 4.0, TABLE)))
    torque, force = np.array([_patch(pole) for pole in poles]).T
    return (
        np.concatenate(([0.0], np.sqrt(1.0 - force[::-1]))),
        np.concatenate(([0.0], torque[::-1] / torque[0])),
    )


def _patch(pole: float) -> tuple[float, float]:
    """Torque about its centre and force of the patch of radius, load and μ 1 that turns about a pole that far off.

    Ring by ring: the mean of |r − P| over a ring is (2/π)(r + c) E(m) with m = 4 r c / (r + c)², and the force is its
    slope in c.
    """
    edge = min(pole, 1.0)
    node, weight = _gauss()
    u = 0.5 * (node + 1.0)
    smooth, slope = u * u * (3.0 - 2.0 * u), 3.0 * u * (1.0 - u) * weight  # crowds where the integrand is not smooth
    r = np.concatenate((edge * smooth, edge + (1.0 - edge) * smooth))
    w = np.concatenate((edge * slope, (1.0 - edge) * slope)) * r
    w *= (1.0 - np.minimum(r, 1.0) ** PRESSURE_EXPONENT) ** (1.0 / PRESSURE_EXPONENT)
    w /= w.sum()
    if pole == 0.0:
        return float(w @ r), 0.0
    m = np.minimum(4.0 * r * pole / (r + pole) ** 2, np.nextafter(1.0, 0.0))
    e, k = ellipe(m), ellipk(m)
    force = float(w @ (e + (e - k) * (r - pole) / (2.0 * pole))) * 2.0 / math.pi
    return float(w @ ((r + pole) * e)) * 2.0 / math.pi - pole * force, force


@lru_cache(maxsize=1)
def _gauss() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Gauss's nodes and weights on [−1, 1]; an eigenvalue problem, so it is solved once."""
    return np.polynomial.legendre.leggauss(100)
