"""What happened to a grasped object: the true motion, wrenches, pressure and friction limit."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from simulated_grasp.contact_patch import FIELD, ContactPatch, PressedPatch
from simulated_grasp.general_grasp import CELL_M, GeneralGrasp
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance
from simulated_grasp.load_history import LoadHistory

from slipd.fusion import utilisations
from slipd.tools.sim.scene_parts import Pad
from slipd.tools.sim.stepped_grasp import STEP_S
from slipd.types.arrays import Array, Indices

UTILISATION_S = 0.01
"""Grid of `GraspTrace.utilisation`, s; linear between."""

SOLVED_AT_ONCE = 256
"""Samples whose utilisation is solved in one call; it bounds the memory."""

RIGHT_TO_LEFT = (1.0, -1.0, -1.0)
"""Signs that turn (F_x, F_y, spin) of the right pad's frame into the left one's."""


_WHOLE = ("patch", "friction", "contact")
"""Attributes of a `GraspTrace` that are not arrays over time."""


class CellLoads(NamedTuple):
    """Normal forces on the cells of one pad: their centres in the frame of the left pad, m, and the forces, N.

    ``holds_n`` are the forces times the map of the friction, so friction on a cell holds at most μ_s · ``holds_n``.
    """

    x_m: Array
    y_m: Array
    loads_n: Array
    holds_n: Array


@dataclass(frozen=True, eq=False)
class GraspTrace:
    """The true course of a grasp, at the n times of its load history.

    Attributes:
        patch: The contact.
        friction: The friction.
        contact: The contact's cells.
        t_s: Times, shape (n,), s.
        normal_n: Grip force on one pad, shape (n,), N.
        wrench_left: Force and torque of the object on the left finger, in its pad frame about the centre of the pad,
            shape (n, 6), N and N·m.
        wrench_right: Likewise of the right finger, in the frame of the right pad.
        displacement: How far the object has moved over the left pad, elastic motion included: x, y of its point at the
            centre of the patch, m, and angle, rad; shape (n, 3).
        velocity: Rates of these, shape (n, 3).
        sliding_share: Share of the normal load on cells that slid in the millisecond before; shape (n,).
        gross: Whether the object slides as a whole, see `stepped_grasp.GROSS_SHARE`; shape (n,).
        energy: Done by the load, dissipated by sliding and in the pads, stored in the bristles; shape (n, 4), J.
        motion: Centre of mass in the frame of the left pad, angle, and their rates; shape (n, 6).
        tilt_nm: Moments that tilt the object, shape (n, 2), N·m.
        fields: Descriptions of the pressure on both pads, shape (n, 2, FIELD).
    """

    patch: ContactPatch
    friction: FrictionLaw
    contact: PressedPatch
    t_s: Array
    normal_n: Array
    wrench_left: Array
    wrench_right: Array
    displacement: Array
    velocity: Array
    sliding_share: Array
    gross: NDArray[np.bool_]
    energy: Array
    motion: Array
    tilt_nm: Array
    fields: Array

    def until(self, n: int) -> GraspTrace:
        """Return the first ``n`` samples."""
        arrays = {field.name: getattr(self, field.name)[:n] for field in fields(self) if field.name not in _WHOLE}
        return replace(self, **arrays)

    def pressure(self, index: int, *, right: bool = False) -> CellLoads:
        """Return the normal force on every cell at a sample, in the frame of the left pad for either pad."""
        contact = self.contact
        contact.place(self.motion[index])
        loads, holds = np.zeros((2, contact.cells.shape[1]))
        tilt = (float(self.tilt_nm[index, 0]), float(self.tilt_nm[index, 1]))
        contact.press(float(self.normal_n[index]), tilt, int(right), loads, holds, np.zeros(self.fields.shape[2]))
        x, y = contact.on_pad.copy()
        return CellLoads(x, y, loads, holds)

    def taxel_loads(self, pad: Pad, times_s: ArrayLike, *, right: bool = False) -> Array:
        """Return the readings of a pad's taxels, shape (m, taxels), N.

        Args:
            pad: Geometry of the taxels.
            times_s: Times of the images, shape (m,), s; each shows the newest sample.
            right: Whether it is the right pad; its taxels are in its own frame.
        """
        indices = np.searchsorted(self.t_s, np.asarray(times_s, dtype=np.float64), side="right") - 1
        images: list[Array] = []
        last = None
        for i in np.clip(indices, 0, None).tolist():
            motion, normal_n, field = self.motion[i], float(self.normal_n[i]), self.fields[i, int(right)]
            seen = normal_n, field.tobytes(), b"" if self.contact.stays else motion.tobytes()
            images.append(images[-1] if seen == last else self.contact.read(pad, motion, normal_n, field, right=right))
            last = seen
        return np.array(images)

    @cached_property
    def utilisation(self) -> Array:
        """True λ at μ_s of the load that friction carries, shape (n,), on a grid of `UTILISATION_S`, linear between."""
        grid = np.searchsorted(self.t_s, np.arange(self.t_s[0], self.t_s[-1], UTILISATION_S))
        indices = np.unique(np.append(grid, len(self.t_s) - 1))
        return np.interp(self.t_s, self.t_s[indices], self.utilisation_at(indices))

    def utilisation_at(self, indices: Indices) -> Array:
        """Return true λ at samples, shape (m,): the exact limit surface of all cells under the load that they carry.

        It is solved afterwards by `slipd.fusion`; the motion does not depend on it. NaN without a contact.
        """
        indices = np.asarray(indices)
        chunks = [indices[i : i + SOLVED_AT_ONCE] for i in range(0, len(indices), SOLVED_AT_ONCE)]
        return np.concatenate([self._utilisation(chunk.tolist()) for chunk in chunks])

    def _utilisation(self, indices: list[int]) -> Array:
        both = bool(self.tilt_nm.any())
        x, y, holds = [], [], []
        for i in indices:
            pads = [self.pressure(i), self.pressure(i, right=True)] if both else [self.pressure(i)]
            x.append(np.concatenate([pad.x_m for pad in pads]))
            y.append(np.concatenate([pad.y_m for pad in pads]))
            holds.append(np.concatenate([pad.holds_n for pad in pads]))
        load = self.wrench_left[indices][:, (0, 1, 5)]
        if both:
            load = load + self.wrench_right[indices][:, (0, 1, 5)] * RIGHT_TO_LEFT
        found = utilisations(
            np.array(x), np.array(y), np.array(holds), self.friction.mu_s, load[:, :2], load[:, 2], (0.0, 0.0)
        )
        return np.where(self.fields[indices, 0, 0] > 0.0, found.value, np.nan)


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
    grasp = GeneralGrasp(
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


def empty_trace(patch: ContactPatch, friction: FrictionLaw, grasp: GeneralGrasp, t_s: Array) -> GraspTrace:
    """Return a trace of zeros at n times, for `write_sample` to fill; ``tilt_nm`` is left to the caller."""
    n = len(t_s)
    return GraspTrace(
        patch=patch, friction=friction, contact=grasp.contact, t_s=np.array(t_s, dtype=np.float64),
        normal_n=np.zeros(n), wrench_left=np.zeros((n, 6)), wrench_right=np.zeros((n, 6)),
        displacement=np.zeros((n, 3)), velocity=np.zeros((n, 3)), sliding_share=np.zeros(n),
        gross=np.zeros(n, np.bool_), energy=np.zeros((n, 4)), motion=np.zeros((n, 6)), tilt_nm=np.zeros((n, 2)),
        fields=np.zeros((n, 2, FIELD)),
    )  # fmt: skip


def write_sample(trace: GraspTrace, i: int, grasp: GeneralGrasp) -> None:
    """Write the present state of a grasp into sample ``i`` of a trace."""
    trace.normal_n[i], trace.motion[i], trace.fields[i] = grasp.normal_n, grasp.motion, grasp.fields
    trace.wrench_left[i], trace.wrench_right[i] = grasp.wrench(), grasp.wrench(right=True)
    trace.displacement[i], trace.velocity[i] = grasp.displacement(), grasp.velocity()
    trace.sliding_share[i], trace.gross[i], trace.energy[i] = grasp.sliding_share, grasp.gross, grasp.energy()
