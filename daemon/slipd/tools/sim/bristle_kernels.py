"""The motion of the object on its bristles.

A bristle is a spring k and damper c in series with a slider. Its force T = k z + c ż is never above its hold,
μ(w) p + ν p |ṡ|, where p is the normal force on the cell and ṡ the speed of the slider; the slider is solved
implicitly, so a step of any length keeps that bound and never gains energy in the slider. w is the sliding speed that
the cell remembers: it follows the speed of the object over the pad while the cell slides, and 0 while it sticks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled, compiled_part
from slipd.types.arrays import Array


class Law(NamedTuple):
    """Friction and compliance of a cell, as the kernels take them."""

    mu_s: float
    mu_d: float
    stribeck: float
    viscous: float
    memory_s: float
    stiffness: float
    damping: float


class Body(NamedTuple):
    """The object: mass, moment of inertia about its centre of mass, the load's point from there, m."""

    mass: float
    inertia: float
    load_x: float
    load_y: float


WORK, SLID, DAMPED, STORED = range(4)
"""Energies: done by the load, dissipated by sliding, dissipated in the pads, stored in the bristles; J."""


@compiled
def slide(
    law: Law, body: Body, steps: int, dt: float, moves: bool, copies: float, begin: Array, end: Array,
    on_pad: Array, loads: Array, holds: Array, bristles: Array, slid: NDArray[np.bool_], motion: Array, carried: Array,
    energy: Array,
) -> None:  # fmt: skip
    """Advance the object by some steps while the pressure stays as it is.

    Velocity first, from the forces of the step before; then the bristles with the new velocity (symplectic Euler).

    Args:
        law: Of the cells.
        body: The object.
        steps: Number of steps.
        dt: Length of a step, s.
        moves: Whether the cells move with the object.
        copies: Pads that each simulated pad stands for: 2 where the right pad mirrors the left one, else 1.
        begin: Load (F_x, F_y, torque) on the object at the beginning, shape (3,), N and N·m.
        end: Likewise at the end.
        on_pad: Cells at the beginning, shape (2, n), m.
        loads: Normal forces, shape (pads, n), N.
        holds: The same times the map of the friction, N.
        bristles: z_x, z_y, w; shape (pads, 3, n), m and m/s.
        slid: Set where a cell slid, shape (pads, n).
        motion: x, y of the centre of mass, angle, and their rates; shape (6,).
        carried: Force (2) that each pad carries and its torque about the centre of mass; shape (pads, 3).
        energy: WORK, SLID and DAMPED are added to, shape (4,), J.
    """
    x_begin, y_begin = motion[0], motion[1]
    lag = dt / (dt + law.memory_s)
    for step in range(steps):
        part = (step + 0.5) / steps
        fx, fy = begin[0] + part * (end[0] - begin[0]), begin[1] + part * (end[1] - begin[1])
        cos, sin = math.cos(motion[2]), math.sin(motion[2])
        arm_x, arm_y = cos * body.load_x - sin * body.load_y, sin * body.load_x + cos * body.load_y
        torque = begin[2] + part * (end[2] - begin[2]) + arm_x * fy - arm_y * fx
        ax, ay, spin = fx, fy, torque
        for p in range(carried.shape[0]):
            ax, ay, spin = ax - copies * carried[p, 0], ay - copies * carried[p, 1], spin - copies * carried[p, 2]
        vx, vy, omega = motion[3], motion[4], motion[5]
        motion[3] += dt * ax / body.mass
        motion[4] += dt * ay / body.mass
        motion[5] += dt * spin / body.inertia
        mean_x, mean_y, mean_w = 0.5 * (vx + motion[3]), 0.5 * (vy + motion[4]), 0.5 * (omega + motion[5])
        energy[WORK] += dt * (fx * mean_x + fy * mean_y + torque * mean_w)
        vx, vy, omega = motion[3], motion[4], motion[5]
        cx, cy = (x_begin, y_begin) if moves else (motion[0], motion[1])
        for p in range(carried.shape[0]):
            _drag(law, dt, lag, copies, cx, cy, vx, vy, omega, on_pad, loads[p], holds[p], bristles[p], slid[p],
                  carried[p], energy)  # fmt: skip
        motion[0] += dt * vx
        motion[1] += dt * vy
        motion[2] += dt * omega


@compiled_part
def _drag(
    law: Law, dt: float, lag: float, copies: float, cx: float, cy: float, vx: float, vy: float, omega: float,
    on_pad: Array, loads: Array, holds: Array, bristles: Array, slid: NDArray[np.bool_], carried: Array, energy: Array,
) -> None:  # fmt: skip
    """Move the bristles of one pad by a step under an object with a velocity, and sum what they carry."""
    k, c = law.stiffness, law.damping
    per_move = k + c / dt
    drop, v2 = law.mu_s - law.mu_d, law.stribeck * law.stribeck
    sum_x, sum_y, spin, heat, damped = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(loads.size):
        load = loads[i]
        if load <= 0.0:
            bristles[0, i], bristles[1, i], bristles[2, i] = 0.0, 0.0, 0.0
            slid[i] = False
            continue
        rx, ry = on_pad[0, i] - cx, on_pad[1, i] - cy
        ux, uy = vx - omega * ry, vy + omega * rx
        zx, zy, w = bristles[0, i], bristles[1, i], bristles[2, i]
        dx, dy = ux * dt, uy * dt
        tx, ty = k * zx + per_move * dx, k * zy + per_move * dy
        square = tx * tx + ty * ty
        target = 0.0
        least = law.mu_d * holds[i]
        if square > least * least:
            hold = holds[i] * (law.mu_d + drop * v2 / (v2 + w * w))
            if square > hold * hold:
                trial = math.sqrt(square)
                resist = law.viscous * holds[i] / (per_move * dt)
                force = (hold + resist * trial) / (1.0 + resist)
                tx, ty = tx * (force / trial), ty * (force / trial)
                dx, dy = (tx - k * zx) / per_move, (ty - k * zy) / per_move
                heat += force * (trial - force) / per_move
                target = math.sqrt(ux * ux + uy * uy)
                slid[i] = True
        bristles[0, i], bristles[1, i] = zx + dx, zy + dy
        bristles[2, i] = w + lag * (target - w)
        damped += dx * dx + dy * dy
        sum_x, sum_y, spin = sum_x + tx, sum_y + ty, spin + (rx * ty - ry * tx)
    carried[0], carried[1], carried[2] = sum_x, sum_y, spin
    energy[SLID] += copies * heat
    energy[DAMPED] += copies * (c / dt) * damped


@compiled
def sliding_shares(loads: Array, slid: NDArray[np.bool_], on_pad: Array, motion: Array, shares: Array) -> None:
    """Write the share of the normal load on cells that slid, and of the frictional power of the motion under way."""
    total, sliding, power, sliding_power = 0.0, 0.0, 0.0, 0.0
    for p in range(loads.shape[0]):
        for i in range(loads.shape[1]):
            rx, ry = on_pad[0, i] - motion[0], on_pad[1, i] - motion[1]
            ux, uy = motion[3] - motion[5] * ry, motion[4] + motion[5] * rx
            speed = loads[p, i] * math.sqrt(ux * ux + uy * uy)
            total, power = total + loads[p, i], power + speed
            if slid[p, i]:
                sliding, sliding_power = sliding + loads[p, i], sliding_power + speed
            slid[p, i] = False
    shares[0] = sliding / total if total > 0.0 else 0.0
    shares[1] = sliding_power / power if power > 0.0 else 0.0
