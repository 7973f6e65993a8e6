"""The project's own answers as a method among the others: the public call, its batch form, the bounds of one pass."""

from __future__ import annotations

import math
from time import perf_counter_ns

import numpy as np
from chart.scenes import Scene

from slipd.fusion import limit_surface

FRAMES = 256
"""Of a batch that is timed: as many as make the one call's own cost vanish beside theirs."""

FORCE_STEP = 1e-3
"""By how much f_t differs between neighbouring frames, of itself: no frame of the batch is the one before."""


def limit(scene: Scene) -> float:
    """The public call."""
    return _limit(scene).torque_nm


def safe(scene: Scene, spin: float) -> bool | None:
    """R ≥ μ slides whatever the spin is."""
    return _verdict(_limit(scene), spin, bounds=False)


def bounds_limit(scene: Scene) -> float:
    """What one pass vouches for: its lower bound."""
    return _one_pass(scene).lower_nm


def bounds_safe(scene: Scene, spin: float) -> bool | None:
    """Between the bounds of one pass nothing is said."""
    return _verdict(_one_pass(scene), spin, bounds=True)


def batch_limit(scene: Scene) -> float:
    """A batch of one frame; NaN for one that slides whatever the spin is."""
    return float(_batch(scene, scene.tangential[None, :])[0])


def batch_safe(scene: Scene, spin: float) -> bool | None:
    """By (4) and the limit, as one does with arrays."""
    ratio = math.hypot(*scene.tangential) / (scene.mu * math.fsum(scene.loads))
    return False if ratio >= 1.0 else None if math.isnan(limit := batch_limit(scene)) else spin <= limit


def batch_seconds(scene: Scene) -> float:
    """Time of one frame among many, s."""
    tangential = scene.tangential * np.linspace(1.0 - FORCE_STEP, 1.0, FRAMES)[:, None]
    start = perf_counter_ns()
    _batch(scene, tangential)
    return (perf_counter_ns() - start) / 1e9 / FRAMES


def _limit(scene: Scene) -> limit_surface.TorqueLimit:
    return limit_surface.torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about)


def _one_pass(scene: Scene) -> limit_surface.TorqueLimit:
    return limit_surface.torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about, passes=1)


def _batch(scene: Scene, tangential: np.ndarray) -> np.ndarray:
    loads = np.ascontiguousarray(np.broadcast_to(scene.loads, (len(tangential), scene.loads.size)))
    return limit_surface.torque_limits(scene.x, scene.y, loads, scene.mu, tangential, scene.about).torque_nm


def _verdict(found: limit_surface.TorqueLimit, spin: float, *, bounds: bool) -> bool | None:
    if found.kind == "translating":
        return False
    if math.isnan(found.torque_nm):
        return None
    if not bounds:
        return spin <= found.torque_nm
    return True if spin <= found.lower_nm else False if spin > found.upper_nm else None
