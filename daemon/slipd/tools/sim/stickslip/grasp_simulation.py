"""A grasp under a load history, offline."""

from __future__ import annotations

import numpy as np

from slipd.tools.sim.stickslip.contact_patch import ContactPatch
from slipd.tools.sim.stickslip.friction_law import FrictionLaw
from slipd.tools.sim.stickslip.grasp_parts import GraspedObject, LoadHistory, PadCompliance
from slipd.tools.sim.stickslip.grasp_trace import GraspTrace
from slipd.tools.sim.stickslip.pressed_patch import FIELD
from slipd.tools.sim.stickslip.stepped_grasp import CELL_M, STEP_S, SteppedGrasp
from slipd.types.arrays import Array


def simulate(
    obj: GraspedObject, patch: ContactPatch, friction: FrictionLaw, pad: PadCompliance, history: LoadHistory, *,
    cell_m: float = CELL_M, step_s: float = STEP_S,
) -> GraspTrace:  # fmt: skip
    """Simulate an object between two pads under a load history.

    Args:
        obj: The object.
        patch: The contact on the left pad; that on the right one is its mirror image.
        friction: Friction of both pads.
        pad: Compliance of both pads.
        history: The loads.
        cell_m: Side of a cell, m.
        step_s: Longest integration step, s.

    Returns:
        The trace, with the samples of the history.
    """
    grasp = SteppedGrasp(
        obj, patch, friction, pad, grip_n=float(history.grip_n[0]), largest_grip_n=float(np.max(history.grip_n)),
        grip_lag_s=history.grip_lag_s, about_m=history.about_m, cell_m=cell_m, step_s=step_s,
    )  # fmt: skip
    trace = empty_trace(patch, friction, grasp, history.t_s)
    tilt = trace.tilt_nm
    if history.tilt_nm is not None:
        tilt[:] = history.tilt_nm
    write_sample(trace, 0, grasp)
    steps = np.diff(trace.t_s).tolist()
    forces, torques, grips, tilts = (
        np.asarray(a, dtype=np.float64).tolist() for a in (history.force_n, history.torque_nm, history.grip_n, tilt)
    )
    grasp.begin(tuple(forces[0]), torques[0])
    for i, dt in enumerate(steps, start=1):
        grasp.advance(dt, forces[i], torques[i], grips[i], (tilts[i][0], tilts[i][1]))
        write_sample(trace, i, grasp)
    return trace


def empty_trace(patch: ContactPatch, friction: FrictionLaw, grasp: SteppedGrasp, t_s: Array) -> GraspTrace:
    """Return a trace of zeros at n times, for `write_sample` to fill; ``tilt_nm`` is left to the caller."""
    n = len(t_s)
    return GraspTrace(
        patch=patch, friction=friction, contact=grasp.contact, t_s=np.array(t_s, dtype=np.float64),
        normal_n=np.zeros(n), wrench_left=np.zeros((n, 6)), wrench_right=np.zeros((n, 6)),
        displacement=np.zeros((n, 3)), velocity=np.zeros((n, 3)), sliding_share=np.zeros(n),
        gross=np.zeros(n, np.bool_), energy=np.zeros((n, 4)), motion=np.zeros((n, 6)), tilt_nm=np.zeros((n, 2)),
        fields=np.zeros((n, 2, FIELD)),
    )  # fmt: skip


def write_sample(trace: GraspTrace, i: int, grasp: SteppedGrasp) -> None:
    """Write the present state of a grasp into sample ``i`` of a trace."""
    trace.normal_n[i], trace.motion[i], trace.fields[i] = grasp.normal_n, grasp.motion, grasp.fields
    trace.wrench_left[i], trace.wrench_right[i] = grasp.wrench(), grasp.wrench(right=True)
    trace.displacement[i], trace.velocity[i] = grasp.displacement(), grasp.velocity()
    trace.sliding_share[i], trace.gross[i], trace.energy[i] = grasp.sliding_share, grasp.gross, grasp.energy()
