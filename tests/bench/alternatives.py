"""The shortest that a user could write, and the same algorithm in C: what the timed figures need beyond the chart."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
from chart.rivals.scaled import Scaled
from chart.scenes import Scene
from numpy.typing import NDArray
from scipy.optimize import root

SOURCE = Path(__file__).with_name("limit.c")
OUT = 6
"""Numbers the C program writes for each frame: torque, lower, upper, pole (2), kind."""

NEAREST_M = 1e-15
"""Distances are at least so much: at a taxel (5) divides by nothing."""

Array = NDArray[np.float64]
Batch = Callable[[Array, Array, Array, float, Array, Array], Array]


def plain_hybr(scene: Scene) -> float:
    """Eq. (5) as it is read, handed to SciPy's root in metres, from C; the torque at the pole it ends at, N·m."""
    grip, (fx, fy) = scene.mu * scene.loads, scene.tangential

    def residual(pole: Array) -> tuple[float, float]:
        dx, dy = pole[0] - scene.x, pole[1] - scene.y
        pull = grip / np.maximum(np.hypot(dx, dy), NEAREST_M)
        return pull @ dx + fy, pull @ dy - fx

    px, py = root(residual, scene.about, method="hybr").x
    lever = (px - scene.about[0]) * fy - (py - scene.about[1]) * fx
    return float(grip @ np.hypot(px - scene.x, py - scene.y) + lever)


def hybr(scene: Scene) -> float:
    """The same in the contact's own units, with the Jacobian, from the load centroid.

    The start is 0 exactly: MINPACK takes its first step in proportion to it, and gets nowhere from 1e-17.
    """
    problem = Scaled.of(scene)
    pole = root(problem.residue, np.zeros(2), jac=problem.residue_slope, method="hybr").x
    return problem.potential(pole) * problem.torque_nm


def compiled_c(folder: Path) -> dict[str, Batch]:
    """The same algorithm in C, with the compiler's ordinary settings and for this processor.

    Returns:
        Nothing where there is no C compiler.
    """
    compiler = shutil.which("cc")
    if compiler is None or not SOURCE.exists():
        return {}
    return {
        "C": _built(compiler, folder / "limit.so"),
        "C, -march=native": _built(compiler, folder / "limit-native.so", "-march=native"),
    }


def _built(compiler: str, library: Path, *more: str) -> Batch:
    subprocess.run([compiler, "-O3", *more, "-shared", "-fPIC", "-o", library, SOURCE, "-lm"], check=True)
    limits = ctypes.CDLL(str(library)).torque_limits
    limits.restype = None
    doubles = [np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")]
    limits.argtypes = [
        ctypes.c_long,
        ctypes.c_long,
        *doubles * 3,
        ctypes.c_double,
        *doubles * 2,
        ctypes.c_int,
        *doubles,
    ]

    def batch(x: Array, y: Array, loads: Array, mu: float, tangential: Array, about: Array) -> Array:
        frames, taxels = loads.shape
        out = np.full((frames, OUT), math.nan)
        limits(frames, taxels, x, y, loads, mu, tangential, about, 1, out)
        return out

    return batch
