"""Alternatives for the timing of the friction limit: the shortest code a user could write, and our algorithm in C."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from chart.rivals.scaled import Scaled
from chart.scenes import Scene
from scipy.optimize import root

from slipd.types.arrays import Array

SOURCE = Path(__file__).with_name("limit.c")
FLAGS = ("-std=c99", "-O3", "-ffp-contract=off")
NATIVE = ("-march=native", "-fno-math-errno")
"""Without errno a square root needs no call, and GCC uses vector instructions for it; no result changes."""

LIMIT_OUT, USE_OUT = 6, 9
"""Numbers the C program writes for each frame: torque or value, lower, upper, pole (2), twist (3, of a use), kind."""

NEAREST_M = 1e-15
"""Distances are at least so much: at a taxel (5) divides by nothing."""


@dataclass(frozen=True, slots=True)
class InC:
    """The C program's ``torque_limits`` and ``utilisations`` of all frames: arguments as of ours, all shaped alike."""

    limits: Callable[[Array, Array, Array, float, Array, Array, int], Array]
    uses: Callable[[Array, Array, Array, float, Array, Array, Array], Array]


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


def compiled_c(folder: Path) -> dict[str, InC]:
    """The same algorithm in C, with the compiler's ordinary settings, and for this processor as fast as exact C gets.

    Returns:
        Nothing where there is no C compiler.
    """
    compiler = shutil.which("cc")
    if compiler is None or not SOURCE.exists():
        return {}
    return {
        "C": _built(compiler, folder / "limit.so"),
        "C, native": _built(compiler, folder / "limit-native.so", *NATIVE),
    }


def _built(compiler: str, library: Path, *more: str) -> InC:
    subprocess.run([compiler, *FLAGS, *more, "-shared", "-fPIC", "-o", library, SOURCE, "-lm"], check=True)
    found = ctypes.CDLL(str(library))
    doubles = [np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")]
    problem: list[Any] = [ctypes.c_long, ctypes.c_long, *doubles * 3, ctypes.c_double, *doubles]
    found.torque_limits.argtypes = [*problem, *doubles, ctypes.c_int, *doubles]
    found.utilisations.argtypes = [*problem, *doubles * 3]
    found.torque_limits.restype = found.utilisations.restype = None

    def limits(x: Array, y: Array, loads: Array, mu: float, tangential: Array, about: Array, sense: int) -> Array:
        out = np.full((len(loads), LIMIT_OUT), math.nan)
        found.torque_limits(*loads.shape, x, y, loads, mu, tangential, about, sense, out)
        return out

    def uses(x: Array, y: Array, loads: Array, mu: float, tangential: Array, spin: Array, about: Array) -> Array:
        out = np.full((len(loads), USE_OUT), math.nan)
        found.utilisations(*loads.shape, x, y, loads, mu, tangential, spin, about, out)
        return out

    return InC(limits, uses)
