"""The project's own answers as a method among the others: the public call, its batch form, the bounds of one pass."""

from __future__ import annotations

import math
from time import perf_counter_ns

import numpy as np
from chart.scenes import Array, Scene

from slipd.fusion import TorqueLimit, TorqueLimits, torque_limit, torque_limits

FRAMES = 256
"""Of a batch that is timed: as many as make the one call's own cost vanish beside theirs."""

FORCE_STEP = 1e-3
"""By how much f_t differs over the frames of a batch, of itself: none is the one before."""


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
    """A batch of one frame."""
    return float(_batch(*_frames(scene, 1)).torque_nm[0])


def batch_safe(scene: Scene, spin: float) -> bool | None:
    """As in the public call."""
    found = _batch(*_frames(scene, 1))
    if found.kind[0] == "translating":
        return False
    return None if math.isnan(found.torque_nm[0]) else bool(spin <= found.torque_nm[0])


def batch_seconds(scene: Scene) -> float:
    """Time of one frame among many, s."""
    frames = _frames(scene, FRAMES)
    start = perf_counter_ns()
    _batch(*frames)
    return (perf_counter_ns() - start) / 1e9 / FRAMES


def _limit(scene: Scene) -> TorqueLimit:
    return torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about)


def _one_pass(scene: Scene) -> TorqueLimit:
    return torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about, passes=1)


def _frames(scene: Scene, count: int) -> tuple[Scene, Array, Array]:
    """The scene, and loads and forces of so many frames of it; the last is the scene itself."""
    loads = np.ascontiguousarray(np.broadcast_to(scene.loads, (count, scene.loads.size)))
    return scene, loads, scene.tangential * (1.0 - FORCE_STEP * np.arange(count)[::-1, None] / FRAMES)


def _batch(scene: Scene, loads: Array, tangential: Array) -> TorqueLimits:
    return torque_limits(scene.x, scene.y, loads, scene.mu, tangential, scene.about)


def _verdict(found: TorqueLimit, spin: float, *, bounds: bool) -> bool | None:
    if found.kind == "translating":
        return False
    if math.isnan(found.torque_nm):
        return None
    if not bounds:
        return spin <= found.torque_nm
    return True if spin <= found.lower_nm else False if spin > found.upper_nm else None
