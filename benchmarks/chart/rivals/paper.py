"""The paper's procedure: every taxel tried as a hinge (7), then a search for the pole of (5) from the centroid.

The paper leaves open: the first step, how the step is adapted, and the tolerance. Here the step grows while the
residue falls and is cut where it does not; first step, rates and tolerance are the best of those tried on the scenes.
"""

from __future__ import annotations

import math

import numpy as np
from chart.rivals.scaled import Scaled
from chart.scenes import Scene

FIRST_STEP = 0.3
"""Of the contact's spread."""

GROWTH, CUT = 1.5, 0.3
TOLERANCE = 1e-6
"""Of the residue of (5), in units of μ f_n; its square is about the error of the torque, and less of it finds less."""

MOST_STEPS = 1000
"""The search creeps where it converges slowly; what is not there by then gets no answer."""


def printed(scene: Scene) -> float:
    """(6) as it stands: friction's torque about the pole, read as one about C."""
    if (found := _sliding_or_pole(scene)) is None:
        return -math.inf
    problem, pole = found
    return problem.about_pole(*pole) * problem.torque_nm


def corrected(scene: Scene) -> float:
    """The same pole, with the torque about it moved to C."""
    if (found := _sliding_or_pole(scene)) is None:
        return -math.inf
    problem, pole = found
    return problem.potential(pole) * problem.torque_nm


def _sliding_or_pole(scene: Scene) -> tuple[Scaled, np.ndarray] | None:
    """None where (4) fails; else the pole, NaN where none was found."""
    problem = Scaled.of(scene)
    if problem.ratio() >= 1.0:
        return None
    hinge = _hinge(problem)
    return problem, _search(problem) if hinge is None else hinge


def _hinge(problem: Scaled) -> np.ndarray | None:
    """The taxel that carries as a hinge what the others leave of f_t, by (7)."""
    dx, dy = problem.x - problem.x[:, None], problem.y - problem.y[:, None]
    distance = np.sqrt(dx * dx + dy * dy)
    distance[distance == 0.0] = np.inf
    left_x = problem.tangential[0] + (dy / distance) @ problem.share
    left_y = problem.tangential[1] - (dx / distance) @ problem.share
    hinges = np.flatnonzero(np.hypot(left_x, left_y) <= problem.share)
    return np.array((problem.x[hinges[0]], problem.y[hinges[0]])) if hinges.size else None


def _search(problem: Scaled) -> np.ndarray:
    """Steps normal to the residue, by a length that follows the residue's modulus."""
    pole, step = np.array(problem.about), FIRST_STEP
    residue = problem.residue(pole)
    size = math.hypot(*residue)
    for _ in range(MOST_STEPS):
        if size <= TOLERANCE:
            return pole
        trial = pole + (step / size) * np.array((residue[1], -residue[0]))
        ahead = problem.residue(trial)
        if (new_size := math.hypot(*ahead)) < size:
            pole, residue, size, step = trial, ahead, new_size, step * GROWTH
        else:
            step *= CUT
    return np.full(2, math.nan)
