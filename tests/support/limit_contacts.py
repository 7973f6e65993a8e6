"""Contacts for the tests of the friction limit."""

from __future__ import annotations

import math

import numpy as np

MU = 0.5


def disc(radius: float, cells: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    grid = (np.arange(cells) + 0.5) / cells * 2.0 * radius - radius
    x, y = (a.ravel() for a in np.meshgrid(grid, grid))
    inside = x**2 + y**2 <= radius**2
    return x[inside], y[inside], np.full(inside.sum(), 1.0 / inside.sum())


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
