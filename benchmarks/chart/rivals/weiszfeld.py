"""Weiszfeld's iteration for Φ, with the step of Vardi and Zhang where it lands on a taxel.

The linear term of Φ enters the fixed point as it does the gradient: P = (Σ w_i r_i − g) / Σ w_i with
w_i = F_i / |r_i − P| and g = (f_y, −f_x). Without f_t it is the iteration for the weighted geometric median.
"""

from __future__ import annotations

import math

import numpy as np
from chart.rivals.scaled import Array, Scaled
from chart.scenes import Scene

MOST_SWEEPS = 300
STILL = 1e-12
"""A step this short, in units of the contact's spread, ends it."""


def limit(scene: Scene) -> float:
    """Φ where the sweeps end: its users take what they have then, for any pole bounds the limit from above."""
    problem = Scaled.of(scene)
    if problem.ratio() >= 1.0:
        return -math.inf
    pole = np.array(problem.about)
    for _ in range(MOST_SWEEPS):
        ahead = _sweep(problem, pole)
        step = math.hypot(ahead[0] - pole[0], ahead[1] - pole[1])
        pole = ahead
        if step <= STILL:
            break
    return problem.potential(pole) * problem.torque_nm


def _sweep(problem: Scaled, pole: Array) -> Array:
    dx, dy = problem.x - pole[0], problem.y - pole[1]
    distance = np.sqrt(dx * dx + dy * dy)
    here = distance == 0.0
    if not here.any():
        weight = problem.share / distance
        return pole + _pull(problem, weight, dx, dy) / weight.sum()
    weight = np.where(here, 0.0, problem.share / np.where(here, 1.0, distance))
    own, pull = float(problem.share[here].sum()), _pull(problem, weight, dx, dy)
    size = math.hypot(*pull)
    if size <= own:
        return pole  # (7): the hinge holds
    return pole + (1.0 - own / size) * pull / weight.sum()


def _pull(problem: Scaled, weight: Array, dx: Array, dy: Array) -> Array:
    """−∇Φ without the taxel underfoot."""
    return np.array((weight @ dx - problem.tangential[1], weight @ dy + problem.tangential[0]))
