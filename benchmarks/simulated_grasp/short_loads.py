"""Short load histories for the simulated grasp."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.trace import GraspTrace
from simulated_grasp.trace import simulate as simulate_grasp

Load = tuple[float, float, float]

BOX = GraspedObject()
PAD = PadCompliance()
STEADY = FrictionLaw(mu_s=0.5, mu_d=0.5)
"""Without a drop from static to dynamic friction."""

GRIP_N = 10.0


def history(
    loads: Sequence[Load], times_s: Sequence[float], grip_n: float | Sequence[float] = GRIP_N, dt_s: float = 0.001
) -> LoadHistory:
    """Return a history whose load, and grip force, goes linearly through the given ones at the given times."""
    t = np.arange(round(times_s[-1] / dt_s) + 1) * dt_s
    fx, fy, torque = (np.interp(t, times_s, column) for column in zip(*loads, strict=True))
    grip = np.interp(t, times_s, np.broadcast_to(grip_n, len(times_s)))
    return LoadHistory(t, np.stack((fx, fy), axis=1), torque, grip)


def ramp(load: Load, seconds: float = 1.0) -> LoadHistory:
    """Return a history that grows from nothing to a load."""
    return history([(0.0, 0.0, 0.0), load], [0.0, seconds])


def simulate(
    patch: ContactPatch, friction: FrictionLaw, load: LoadHistory, *, held: GraspedObject = BOX,
    pad: PadCompliance = PAD, cell_m: float = 0.001, step_s: float = 2.5e-4,
) -> GraspTrace:  # fmt: skip
    """Simulate a grasp with defaults."""
    return simulate_grasp(held, patch, friction, pad, load, cell_m=cell_m, step_s=step_s)


def onset(trace: GraspTrace) -> int:
    """Return the first sample at which the object slides as a whole."""
    assert trace.gross.any(), "the object never slides"
    return int(np.argmax(trace.gross))


def kinetic_j(trace: GraspTrace, held: GraspedObject = BOX) -> float:
    """Return the kinetic energy at the end."""
    vx, vy, rate = trace.motion[-1, 3:]
    return float(held.mass_kg * math.hypot(vx, vy) ** 2 + held.inertia_kgm2 * rate**2) / 2
