"""Contacts for the tests of the friction limit, and a minimiser that shares nothing with the daemon's."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import minimize

MU = 0.5


def disc(radius: float, cells: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    grid = (np.arange(cells) + 0.5) / cells * 2.0 * radius - radius
    x, y = (a.ravel() for a in np.meshgrid(grid, grid))
    inside = x**2 + y**2 <= radius**2
    return x[inside], y[inside], np.full(inside.sum(), 1.0 / inside.sum())


def gyration(x: np.ndarray, y: np.ndarray, loads: np.ndarray) -> float:
    cx, cy = loads @ x / loads.sum(), loads @ y / loads.sum()
    return math.sqrt(loads @ ((x - cx) ** 2 + (y - cy) ** 2) / loads.sum())


def dual(x, y, loads, mu, f, about, sense) -> float:
    """Φ minimised by a method that shares nothing with ours, from the best taxel and from the centroid."""

    def phi(p: np.ndarray) -> float:
        lever = (p[0] - about[0]) * f[1] - (p[1] - about[1]) * f[0]
        return float(mu * (loads @ np.hypot(x - p[0], y - p[1])) + sense * lever)

    starts = sorted([(phi(np.array(p)), p) for p in zip(x, y, strict=True)])[:2]
    starts.append((0.0, (loads @ x / loads.sum(), loads @ y / loads.sum())))
    options = {"xatol": 1e-12, "fatol": 1e-15, "maxiter": 4000, "maxfev": 8000}
    found = [minimize(phi, p, method="Nelder-Mead", options=options).fun for _, p in starts]
    return min(*found, starts[0][0])


def random_contact(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Taxels of an 8×16 pad, some families of loads, a force within the friction circle, and a spin."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    taxels = rng.choice(128, n, replace=False)
    x, y = (taxels % 16) * 3.2e-3, (taxels // 16) * 3.2e-3
    family = rng.integers(4)
    loads = rng.random(n) + 0.01
    if family == 1:
        loads = 10.0 ** rng.uniform(-12, 0, n)
    if family == 2:
        y = np.zeros(n)
        x = np.arange(n) * 3.2e-3
    if family == 3:
        loads[0] = 100.0
    ratio = rng.choice([0.0, rng.random(), 1.0 - 10.0 ** rng.uniform(-9, 0)])
    angle = rng.uniform(0, 2 * math.pi)
    f = ratio * MU * loads.sum() * np.array((math.cos(angle), math.sin(angle)))
    return x, y, loads, f, float(rng.normal())
