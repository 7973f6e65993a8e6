"""Clarabel on the cone form: min Σ F_i s_i + (P − C) × f_t with |r_i − P| ≤ s_i, one second-order cone a taxel."""

from __future__ import annotations

import math
from time import perf_counter_ns

import clarabel
import numpy as np
from chart.rivals.scaled import Scaled
from chart.scenes import Scene
from scipy import sparse

TOLERANCE = 1e-9
"""Asked of gap and feasibility: of 1e-8 (its own) to 1e-12 the one that fails least on the scenes."""


def limit(scene: Scene) -> float:
    """Set-up and solve; NaN unless it says that it solved: "almost" is mostly wrong by more than 1e-6."""
    problem = Scaled.of(scene)
    if problem.ratio() >= 1.0:
        return -math.inf
    found = _solver(problem).solve()
    if str(found.status) != "Solved":
        return math.nan
    x, y = problem.about
    return (found.obj_val - (x * problem.tangential[1] - y * problem.tangential[0])) * problem.torque_nm


def solver_seconds(scene: Scene) -> float:
    """Time of the solver alone, s."""
    solver = _solver(Scaled.of(scene))
    start = perf_counter_ns()
    solver.solve()
    return (perf_counter_ns() - start) / 1e9


def _solver(problem: Scaled) -> clarabel.DefaultSolver:
    """Variables P and s; row 3i.. says (s_i, x_i − P_x, y_i − P_y) is in the cone."""
    n = problem.x.size
    row, taxel = np.arange(3 * n), np.repeat(np.arange(n), 3)
    column = np.where(row % 3 == 0, 2 + taxel, row % 3 - 1)
    value = np.where(row % 3 == 0, -1.0, 1.0)
    lines = sparse.csc_matrix((value, (row, column)), shape=(3 * n, n + 2))
    right = np.stack((np.zeros(n), problem.x, problem.y), axis=1).ravel()
    cost = np.concatenate(((problem.tangential[1], -problem.tangential[0]), problem.share))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    cones = [clarabel.SecondOrderConeT(3)] * n
    return clarabel.DefaultSolver(sparse.csc_matrix((n + 2, n + 2)), cost, lines, right, cones, settings)
