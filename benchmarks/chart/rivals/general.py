"""SciPy's general solvers on (5) and on Φ, from the centroid, scaled and with their derivatives."""

from __future__ import annotations

import math

import numpy as np
from chart.rivals.scaled import Scaled
from chart.scenes import Scene
from scipy.optimize import OptimizeResult, minimize, root

TOLERANCE = 1e-10
"""Of the slope for a minimum, without units: the torque's error goes with its square. Roots keep SciPy's own 1.5e-8."""

ORIGIN = np.array((1.0, 1.0))
"""Where the start is put: MINPACK takes its first step bound from the length of the start, which must not vanish."""

OUT_OF_STEPS = 1
"""Status of ``minimize``; the others mean that it came as far as doubles let it."""


def hybr(scene: Scene) -> float:
    """MINPACK's Powell hybrid with the Jacobian."""
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
    found = root(
        lambda at: problem.residue(at - ORIGIN),
        ORIGIN + problem.about,
        jac=lambda at: problem.residue_slope(at - ORIGIN),
        method=method,
    )
    return problem.potential(found.x - ORIGIN) * problem.torque_nm if found.success else math.nan


def _value(problem: Scaled, found: OptimizeResult) -> float:
    return math.nan if found.status == OUT_OF_STEPS else float(found.fun) * problem.torque_nm
