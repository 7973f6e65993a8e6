"""A grasp whose patch grows, moves, tilts or is wet, advanced step by step under whatever load the caller brings.

Pressure: it has the profile of the patch, grows with f_n^γ, and is tilted by moments that tip the object, to opposite
sides on the two pads, until a part lifts off. A patch stays on the pad, or moves with the object and takes its image
along. Beyond the faces of the object or the pad nothing presses. A wet spot is a map of a factor on μ, fixed to the
object. Where a moving patch reaches fresh pad material, that material starts with the strain of the material it leaves.
"""

from __future__ import annotations

import math

import numpy as np
from simulated_grasp.contact_patch import FIELD, ContactPatch, PressedPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance

from slipd.fusion.compiled import compiled
from slipd.tools.sim.bristle_kernels import STORED, Body
from slipd.tools.sim.scene_parts import Pad
from slipd.tools.sim.stepped_grasp import STEP_S, Pair, SteppedGrasp
from slipd.types.arrays import Array

CELL_M = 0.001
"""Default side of a cell, m."""

SIDES = np.array((1.0, -1.0))


class GeneralGrasp(SteppedGrasp):
    """An object between two pads.

    Args:
        held: The object.
        patch: The contact on the left pad; that on the right one is its mirror image.
        friction: Friction of both pads.
        pad: Compliance of both pads.
        grip_n: Normal force on one pad at the start, N.
        largest_grip_n: Largest grip force that will be commanded, N; a growing patch has cells up to there.
        grip_lag_s: Time constant with which the grip force follows the command.
        about_m: Point of the object, in the frame of the left pad before the object has moved, where the force acts and
            about which the torque is. It moves with the object.
        cell_m: Side of a cell, m.
        step_s: Longest integration step, s; it is shortened where the object is light.

    Attributes:
        t_s: Time since the start.
        contact: The contact.
        fields: Description of the pressure of each simulated pad, shape (1 or 2, FIELD).
    """

    def __init__(
        self, held: GraspedObject, patch: ContactPatch, friction: FrictionLaw, pad: PadCompliance, *, grip_n: float,
        largest_grip_n: float, grip_lag_s: float = 0.0, about_m: Pair = (0.0, 0.0), cell_m: float = CELL_M,
        step_s: float = STEP_S,
    ) -> None:  # fmt: skip
        if not 0.0 <= grip_n <= largest_grip_n < math.inf:
            raise ValueError(f"must be 0 <= grip_n <= largest_grip_n, got {grip_n} and {largest_grip_n}")
        if not step_s > 0.0:
            raise ValueError(f"step_s must be positive, got {step_s}")
        self.contact = PressedPatch(patch, held, friction, pad, cell_m, largest_grip_n)
        (x0, y0), (cx, cy), area = held.centre_of_mass_m, patch.centre_m, cell_m**2
        self._lever, self._centre = (cx - x0, cy - y0), (cx, cy)
        self._largest_n, self._tilt_nm, self.t_s = largest_grip_n, (0.0, 0.0), 0.0
        self._pressed: tuple[object, ...] | None = None
        self.moves = self.contact.moves
        law = friction.of_cell(pad.stiffness_n_per_m3 * area, pad.damping_ns_per_m3 * area)
        body = Body(float(held.mass_kg), float(held.inertia_kgm2), float(about_m[0] - x0), float(about_m[1] - y0))
        cells = self.contact.cells
        super().__init__(law, body, (x0, y0), cells, np.zeros(0), grip_lag_s=grip_lag_s, step_s=step_s)
        self.on_pad = self.contact.on_pad
        self.normal_n = float(grip_n)
        self._press()

    @property
    def sliding_share(self) -> float:
        """Share of the normal load of both pads on cells that slid in the last tick."""
        return self._sliding.item(0)

    def begin(self, force_n: Pair, torque_nm: float) -> None:
        """Set the load from which the first step starts; without this it starts from none."""
        self._load = np.array((force_n[0], force_n[1], torque_nm))

    def _allocate(self, pads: int) -> None:
        super()._allocate(pads)
        self.fields = np.zeros((pads, FIELD))

    def _part(self) -> None:
        """Simulate the pads one by one from now on, because the tilt presses them differently."""
        bristles, slid, carried = self._bristles, self._slid, self._carried
        self._allocate(2)
        self._bristles[:], self._slid[:], self._carried[:] = bristles, slid, carried
        self._pressed = None

    def _press(self) -> None:
        """Update the pressure if force or tilt changed, or the pose where the pressure depends on it."""
        motion = None if self.contact.stays else tuple(self.motion[:3].tolist())
        wanted = self.normal_n, self._tilt_nm, motion
        if self._pressed == wanted:
            return
        self._pressed = wanted
        self.contact.place(self.motion)
        for side, field in enumerate(self.fields):
            self.contact.press(self.normal_n, self._tilt_nm, side, self._loads[side], self._holds[side], field)

    def advance(self, dt_s: float, force_n: Pair, torque_nm: float, grip_n: float, tilt_nm: Pair = (0.0, 0.0)) -> None:
        """Advance by ``dt_s`` under a load that changes linearly from the last one to this one.

        Args:
            dt_s: Time, s; more than `TICK_S` is divided.
            force_n: Force on the object in the frame of the left pad at the end, N, of everything but the pads.
            torque_nm: Likewise the torque about ``about_m``, along the normal of the left pad, N·m.
            grip_n: Commanded grip force, N.
            tilt_nm: Moments (about x, about y) that tilt the object at the end, N·m; each pad bears half.

        Raises:
            ValueError: The time is not positive, or the grip is negative or above ``largest_grip_n``, or the
                load is not finite.
        """
        if not (dt_s > 0.0 and 0.0 <= grip_n <= self._largest_n):
            raise ValueError(f"dt_s must be > 0 and grip_n in [0, {self._largest_n}], got {dt_s} and {grip_n}")
        if not math.isfinite(dt_s + force_n[0] + force_n[1] + torque_nm + tilt_nm[0] + tilt_nm[1]):
            raise ValueError(f"load must be finite, got {force_n}, {torque_nm} and {tilt_nm} for {dt_s} s")
        if tilt_nm != (0.0, 0.0) and len(self._loads) == 1:
            self._part()
        self._tilt_nm = tilt_nm
        super().advance(dt_s, force_n, torque_nm, grip_n)
        self.t_s += dt_s

    def wrench(self, *, right: bool = False) -> Array:
        """Return force and torque of the object on a finger, in its pad frame about the centre of the pad, (6,)."""
        side = min(int(right), len(self._loads) - 1)
        (fx, fy, spin), (cx, cy) = self.carried(side), self.fields[side, 5:].tolist()
        normal = self.normal_n if self.fields[side, 0] > 0.0 else 0.0
        sign = SIDES[int(right)]
        return np.array((fx, sign * fy, -normal, -sign * cy * normal, cx * normal, sign * spin))

    def taxel_loads(self, pad: Pad, *, right: bool = False) -> Array:
        """Return the readings of a pad's taxels, shape (taxels,), N, each in the order of its own pad."""
        side = min(int(right), len(self._loads) - 1)
        return self.contact.read(pad, self.motion, self.normal_n, self.fields[side], right=right)

    def displacement(self) -> Array:
        """Return how far the object has moved over the left pad: x, y of its point at the patch's centre, angle."""
        x, y, angle = self.motion[:3].tolist()
        lx, ly = self._turned(angle)
        return np.array((x + lx - self._centre[0], y + ly - self._centre[1], angle))

    def velocity(self) -> Array:
        """Return the rates of `displacement`."""
        vx, vy, rate = self.motion[3:].tolist()
        lx, ly = self._turned(self.motion.item(2))
        return np.array((vx - rate * ly, vy + rate * lx, rate))

    def _turned(self, angle: float) -> Pair:
        (x, y), cos, sin = self._lever, math.cos(angle), math.sin(angle)
        return cos * x - sin * y, sin * x + cos * y

    def energy(self) -> Array:
        """Return energies, J: done by the load, dissipated by sliding and in the pads, stored in the bristles."""
        self._energy[STORED] = (2 / len(self._loads)) * _stored_energy(self._law.stiffness, self._loads, self._bristles)
        return self._energy.copy()


@compiled
def _stored_energy(stiffness: float, loads: Array, bristles: Array) -> float:
    """Return what the bristles of the pads store, J, from shapes (pads, n) and (pads, 3, n)."""
    total = 0.0
    for p in range(loads.shape[0]):
        for i in range(loads.shape[1]):
            total += bristles[p, 0, i] * bristles[p, 0, i] + bristles[p, 1, i] * bristles[p, 1, i]
    return 0.5 * stiffness * total
