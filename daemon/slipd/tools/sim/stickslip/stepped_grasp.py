"""A grasp that is advanced step by step, under whatever load the caller brings."""

from __future__ import annotations

import math

import numpy as np

from slipd.tools.sim.stickslip.bristle_kernels import STORED, Body, Law, slide, sliding_shares, stored_energy
from slipd.tools.sim.stickslip.contact_patch import FIELD, ContactPatch, PressedPatch, Taxels
from slipd.tools.sim.stickslip.grasp_parts import FrictionLaw, GraspedObject, PadCompliance, Pair
from slipd.types.arrays import Array

TICK_S = 0.00125
"""The pressure follows grip force, tilt and displacement at least this often, s."""

STEP_S = 2.5e-4
"""Default of the longest step, s."""

RADIANS_PER_STEP = 0.25
"""Longest step as an angle of the fastest oscillation of the object on its bristles: its period is within 0.3 %."""

CELL_M = 0.001
"""Default side of a cell, m."""

GROSS_SHARE = 0.95
"""The object slides as a whole when cells with this share of the frictional power slide. A translation weighs every
cell by its load. A rotation gives cells near its pole, which hardly move and may stick for long, no weight."""

SIDES = np.array((1.0, -1.0))


class SteppedGrasp:
    """An object between two pads, advanced in steps of about a millisecond.

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
        normal_n: Normal force on one pad.
        motion: x, y of the centre of mass in the frame of the left pad, the angle, and their rates.
        sliding_share: Share of the normal load of both pads on cells that slid in the last tick.
        gross: Whether the object slides as a whole, see `GROSS_SHARE`.
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
        self._held, self._largest_n, self._lag_s = held, largest_grip_n, grip_lag_s
        (x0, y0), (cx, cy) = held.centre_of_mass_m, patch.centre_m
        self._lever = (cx - x0, cy - y0)
        self._centre = (cx, cy)
        area = cell_m**2
        self._law = Law(
            float(friction.mu_s), float(friction.mu_d), float(friction.stribeck_mps), float(friction.viscous_s_per_m),
            float(friction.memory_s), pad.stiffness_n_per_m3 * area, pad.damping_ns_per_m3 * area,
        )  # fmt: skip
        self._body = Body(float(held.mass_kg), float(held.inertia_kgm2), float(about_m[0] - x0), float(about_m[1] - y0))
        self._step_s = min(step_s, RADIANS_PER_STEP / self._fastest())
        self.t_s, self.normal_n = 0.0, float(grip_n)
        self.motion = np.array((x0, y0, 0.0, 0.0, 0.0, 0.0))
        self.sliding_share, self.gross = 0.0, False
        self._load = np.zeros(3)
        self._energy, self._shares = np.zeros(4), np.zeros(2)
        self._pressed: tuple[object, ...] | None = None
        self._allocate(1)
        self._press((0.0, 0.0))

    def begin(self, force_n: Pair, torque_nm: float) -> None:
        """Set the load from which the first step starts; without this it starts from none."""
        self._load = np.array((force_n[0], force_n[1], torque_nm))

    def _fastest(self) -> float:
        """Return an upper bound of the angular frequency of the object on its bristles, rad/s."""
        x, y = self.contact.cells - np.array(self._held.centre_of_mass_m)[:, None]
        k = 2.0 * self._law.stiffness
        turning = math.fsum((x * x + y * y).tolist())  # exact, so that the steps do not depend on the processor
        return math.sqrt(k * x.size / self._held.mass_kg + k * turning / self._held.inertia_kgm2)

    def _allocate(self, pads: int) -> None:
        """Make the arrays for one simulated pad, which stands for both, or for two that differ."""
        n = self.contact.cells.shape[1]
        self._loads, self._holds = np.zeros((pads, n)), np.zeros((pads, n))
        self._bristles, self._slid = np.zeros((pads, 3, n)), np.zeros((pads, n), np.bool_)
        self._carried, self.fields = np.zeros((pads, 3)), np.zeros((pads, FIELD))

    def _part(self) -> None:
        """Simulate the pads one by one from now on, because the tilt presses them differently."""
        bristles, slid, carried = self._bristles, self._slid, self._carried
        self._allocate(2)
        self._bristles[:], self._slid[:], self._carried[:] = bristles, slid, carried
        self._pressed = None

    def _press(self, tilt_nm: Pair) -> None:
        """Find the pressure anew where force, tilt or pose changed; the pose counts only where it matters."""
        motion = None if self.contact.stays else tuple(self.motion[:3].tolist())
        wanted = self.normal_n, tilt_nm, motion
        if self._pressed == wanted:
            return
        self._pressed = wanted
        self.contact.place(self.motion)
        for side in range(len(self._loads)):
            self.contact.press(self.normal_n, tilt_nm, side, self._loads[side], self._holds[side], self.fields[side])

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
        ticks = math.ceil(dt_s / TICK_S - 1e-6)
        first, last = self._load, np.array((force_n[0], force_n[1], torque_nm))
        for tick in range(1, ticks + 1):
            begin, self._load = self._load, last if tick == ticks else first + (last - first) * (tick / ticks)
            self._tick(dt_s / ticks, begin, grip_n, tilt_nm)
        self.t_s += dt_s

    def _tick(self, dt_s: float, begin: Array, grip_n: float, tilt_nm: Pair) -> None:
        follow = 1.0 if self._lag_s == 0.0 else -math.expm1(-dt_s / self._lag_s)
        self.normal_n += (grip_n - self.normal_n) * follow
        self._press(tilt_nm)
        steps = math.ceil(dt_s / self._step_s - 1e-6)
        pads = len(self._loads)
        slide(
            self._law, self._body, steps, dt_s / steps, self.contact.moves, 2.0 / pads, begin, self._load,
            self.contact.on_pad, self._loads, self._holds, self._bristles, self._slid, self.motion, self._carried,
            self._energy,
        )  # fmt: skip
        if not self.contact.stays:
            self._press(tilt_nm)
        sliding_shares(self._loads, self._slid, self.contact.on_pad, self.motion, self._shares)
        self.sliding_share = self._shares.item(0)
        self.gross = self._shares.item(1) >= GROSS_SHARE

    def wrench(self, *, right: bool = False) -> Array:
        """Return force and torque of the object on a finger, in its pad frame about the centre of the pad, (6,)."""
        side = min(int(right), len(self._loads) - 1)
        (fx, fy, spin), (cx, cy) = self._carried[side].tolist(), self.fields[side, 5:].tolist()
        spin += self.motion.item(0) * fy - self.motion.item(1) * fx
        normal = self.normal_n if self.fields[side, 0] > 0.0 else 0.0
        sign = SIDES[int(right)]
        return np.array((fx, sign * fy, -normal, -sign * cy * normal, cx * normal, sign * spin))

    def taxel_loads(self, pad: Taxels, *, right: bool = False) -> Array:
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
        self._energy[STORED] = (2 / len(self._loads)) * stored_energy(self._law.stiffness, self._loads, self._bristles)
        return self._energy.copy()
