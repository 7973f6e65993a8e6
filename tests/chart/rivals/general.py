"""SciPy's general solvers on (5) and on Φ, from the centroid, scaled and with their derivatives."""

from __future__ import annotations

import math

import numpy as np
from chart.rivals.scaled import Scaled
from chart.scenes import Scene
from scipy.optimize import OptimizeResult, minimize, root

TOLERANCE = 1e-10
"""Of the pole for a root, of the slope for a minimum, without units; the torque's error goes with its square."""

OUT_OF_STEPS = 1
"""Status of ``minimize``; the others mean that it came as far as doubles let it."""


def hybr(scene: Scene) -> float:
    """MINPACK's Powell hybrid with the Jacobian (differences fail: the start is an origin that is one to rounding)."""
    return _root(scene, "hybr")


def lm(scene: Scene) -> float:
    """MINPACK's Levenberg–Marquardt with the Jacobian."""
    return _root(scene, "lm")


def bfgs(scene: Scene) -> float:
    """BFGS with the gradient."""
    problem = Scaled.of(scene)
    if problem.ratio() >= 1.0:
        return -math.inf
    start = np.array(problem.about)
    found = minimize(problem.potential, start, jac=problem.gradient, method="BFGS", options={"gtol": TOLERANCE})
    return _value(problem, found)


def trust_exact(scene: Scene) -> float:
    """A trust region with the analytic Hessian."""
    problem = Scaled.of(scene)
    if problem.ratio() >= 1.0:
        return -math.inf
    found = minimize(
        problem.potential,
        np.array(problem.about),
        jac=problem.gradient,
        hess=problem.hessian,
        method="trust-exact",
        options={"gtol": TOLERANCE},
    )
    return _value(problem, found)


def _root(scene: Scene, method: str) -> float:
    problem = Scaled.of(scene)
    if problem.ratio() >= 1.0:
        return -math.inf
    start = np.array(problem.about)
    found = root(problem.residue, start, jac=problem.residue_slope, method=method, tol=TOLERANCE)
    return problem.potential(found.x) * problem.torque_nm if found.success else math.nan


def _value(problem: Scaled, found: OptimizeResult) -> float:
    return math.nan if found.status == OUT_OF_STEPS else float(found.fun) * problem.torque_nm
