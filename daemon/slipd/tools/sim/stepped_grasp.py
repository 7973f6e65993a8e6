"""A rigid object held by two compliant pads: distributed stick and slip, computed from mechanics alone, step by step.

Nothing here uses `slipd.fusion` for the dynamics, so the truth does not depend on the code that is tested with it. Pure
and without seed: the same scene moves in the same way.

- Motion. The object has three degrees of freedom: x, y and the angle about the normal of the pads. Weight, inertia,
  pulls and collisions are a load over time at a point of the object.
- Friction. The contact is divided into cells of 1 or 2 mm. In each, a spring and damper (a bristle) in series with a
  slider carries T = k z + c ż, and never more than (μ(w) + ν |ṡ|) p: p is the normal force on the cell, ṡ the speed
  of the slider, and μ(w) = μ_d + (μ_s − μ_d) / (1 + (w / v_s)²) falls with the sliding speed w from the static to the
  dynamic coefficient (Hess and Soom 1990). w follows the speed of the object with a lag of a millisecond, the
  frictional memory. With ν > 0 the contact creeps. A slider does not drift below its limit, as a bristle of the LuGre
  model does (Dupont et al. 2002).
- Pressure. Here it stays on the pad and keeps its shape, as with a crowned pad on a flat box. A grasp whose patch
  grows, moves, tilts or is wet derives from this one, for benchmarks.
- Steps. The velocity of the object is advanced before the bristles, the slider is implicit; a step is at most 0.25
  ms, and 0.25 rad of the fastest oscillation. A finer step or grid moves the onset of slip by less than 1 ms in 0.4
  s, and the energy balance closes within 2 % of the work done.
- Slip. Part of the cells slide before the object does: for Hertz's disc a share s³ of the load at the displacement s
  (1 where the last cell slides), under a load of 3/2 s − 1/2 s³ of the limit. The object slides as a whole when the
  cells that slide have 95 % of the frictional power; those near the pole of a rotation hardly move and may stick for
  long.

It does not model: motion along the normal of the pads, tipping as a motion, bending of the fingers, shear waves in
the pad (bristles do not couple), adhesion, wear, ageing of a resting contact, heat, and the hysteresis of taxels,
which belongs to the emulated sensors. Its damping is viscous, so slow oscillations of a small contact fade too slowly.

All coordinates are in the frame of the left pad. The right pad is the same hardware turned by half a turn about x, so
it sees the mirror image: y, the spin and the moment about y change sign, x does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.tools.sim.bristle_kernels import Body, Law, slide, sliding_shares
from slipd.types.arrays import Array

TICK_S = 0.00125
"""The pressure follows the grip force at least this often, s."""

STEP_S = 2.5e-4
"""Longest step, s."""

RADIANS_PER_STEP = 0.25
"""Longest step as an angle of the fastest oscillation of the object on its bristles: its period is within 0.3 %."""

GROSS_SHARE = 0.95
"""The object slides as a whole when cells with this share of the frictional power slide. A translation weighs every
cell by its load. A rotation gives cells near its pole, which hardly move and may stick for long, no weight."""

STIFFNESS_N_PER_M3, DAMPING_NS_PER_M3 = 1.5e8, 8e4
"""Compliance of the surface of a pad under shear, per area: of 2 mm of a silicone of 0.3 MPa shear modulus (stiffness
G / thickness), whose loss factor near 60 Hz is 0.2 (damping = 0.2 · stiffness / (2π · 60 Hz))."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class FrictionLaw:
    """Friction of a cell that slides at a speed v: μ(v) = μ_d + (μ_s − μ_d) / (1 + (v / v_s)²) + ν v.

    The first two terms follow v with a lag, the frictional memory; the viscous term does not.

    Attributes:
        mu_s: Static coefficient.
        mu_d: Dynamic coefficient, at most ``mu_s``.
        stribeck_mps: v_s, at which half of the drop is done.
        viscous_s_per_m: ν, strengthening with speed; about 0.02 / 1 mm/s makes a contact creep before it slides.
        memory_s: Time constant of the frictional memory.

    Source: Stribeck curve with a Lorentzian, and frictional memory: Hess and Soom, J. Tribology 112 (1990) 147.
    """

    mu_s: float = 0.6
    mu_d: float = 0.45
    stribeck_mps: float = 0.01
    viscous_s_per_m: float = 0.0
    memory_s: float = 0.001

    def of_cell(self, stiffness: float, damping: float) -> Law:
        """Return friction and compliance of a cell, N/m and N·s/m."""
        return Law(
            float(self.mu_s), float(self.mu_d), float(self.stribeck_mps), float(self.viscous_s_per_m),
            float(self.memory_s), float(stiffness), float(damping),
        )  # fmt: skip


class SteppedGrasp:
    """An object between two pads, advanced in steps of about a millisecond. The right pad mirrors the left one.

    Args:
        law: Friction and compliance of a cell.
        body: The object.
        centre_m: Its centre of mass before it has moved.
        cells: Centres of the cells of the contact on the left pad, shape (2, n), m.
        shares: Their shares of the normal force, shape (n,).
        grip_lag_s: Time constant with which the grip force follows the command; 0: at once.
        step_s: Longest integration step, s; it is shortened where the object is light.

    Attributes:
        normal_n: Normal force on one pad.
        motion: x, y of the centre of mass in the frame of the left pad, the angle, and their rates.
        gross: Whether the object slides as a whole, see `GROSS_SHARE`.
    """

    moves = False
    """Whether the cells move with the object."""

    def __init__(
        self, law: Law, body: Body, centre_m: Pair, cells: Array, shares: Array, *, grip_lag_s: float,
        step_s: float = STEP_S,
    ) -> None:  # fmt: skip
        self._law, self._body, self._lag_s = law, body, grip_lag_s
        self.on_pad, self._pressure = cells, shares
        self._step_s = min(step_s, RADIANS_PER_STEP / _fastest(law, body, cells - np.array(centre_m)[:, None]))
        self.normal_n = 0.0
        self.motion = np.array((*centre_m, 0.0, 0.0, 0.0, 0.0))
        self.gross = False
        self._load = np.zeros(3)
        self._energy, self._sliding = np.zeros(4), np.zeros(2)
        self._allocate(1)

    def _allocate(self, pads: int) -> None:
        """Make the arrays for one simulated pad, which stands for both, or for two that differ."""
        n = self.on_pad.shape[1]
        self._loads, self._holds = np.zeros((pads, n)), np.zeros((pads, n))
        self._bristles, self._slid = np.zeros((pads, 3, n)), np.zeros((pads, n), np.bool_)
        self._carried = np.zeros((pads, 3))

    def _press(self) -> None:
        """Find the normal force on each cell, and the same times what changes its friction."""
        self._loads[0] = self._holds[0] = self.normal_n * self._pressure

    def advance(self, dt_s: float, force_n: Pair, torque_nm: float, grip_n: float) -> None:
        """Advance by ``dt_s`` under a load that changes linearly from the last one to this one.

        Args:
            dt_s: Time, s; more than `TICK_S` is divided.
            force_n: Force on the object in the frame of the left pad at the end, N, of everything but the pads.
            torque_nm: Likewise the torque about the point of the load, along the normal of the left pad, N·m.
            grip_n: Commanded grip force, N.
        """
        ticks = math.ceil(dt_s / TICK_S - 1e-6)
        first, last = self._load, np.array((force_n[0], force_n[1], torque_nm))
        for tick in range(1, ticks + 1):
            begin, self._load = self._load, last if tick == ticks else first + (last - first) * (tick / ticks)
            self._tick(dt_s / ticks, begin, grip_n)

    def _tick(self, dt_s: float, begin: Array, grip_n: float) -> None:
        follow = 1.0 if self._lag_s == 0.0 else -math.expm1(-dt_s / self._lag_s)
        self.normal_n += (grip_n - self.normal_n) * follow
        self._press()
        steps = math.ceil(dt_s / self._step_s - 1e-6)
        slide(
            self._law, self._body, steps, dt_s / steps, self.moves, 2.0 / len(self._loads), begin, self._load,
            self.on_pad, self._loads, self._holds, self._bristles, self._slid, self.motion, self._carried,
            self._energy,
        )  # fmt: skip
        self._press()
        sliding_shares(self._loads, self._slid, self.on_pad, self.motion, self._sliding)
        self.gross = self._sliding.item(1) >= GROSS_SHARE

    def carried(self, side: int = 0) -> tuple[float, float, float]:
        """Return force, N, and torque about the centre of the pad, N·m, on a pad, both in the frame of the left one.

        Args:
            side: Index of the simulated pad.
        """
        fx, fy, spin = self._carried[side].tolist()
        return fx, fy, spin + self.motion.item(0) * fy - self.motion.item(1) * fx


def _fastest(law: Law, body: Body, away: Array) -> float:
    """Return an upper bound of the angular frequency of the object on bristles at these places, rad/s."""
    x, y = away
    k = 2.0 * law.stiffness
    turning = math.fsum((x * x + y * y).tolist())  # exact, so that the steps do not depend on the processor
    return math.sqrt(k * x.size / body.mass + k * turning / body.inertia)
