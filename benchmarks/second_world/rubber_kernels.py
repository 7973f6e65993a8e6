"""The two kernels of the second contact model: normal pressure of visco-elastic elements, and their sliding.

Every element is a spring with a Maxwell branch beside it (standard linear solid), along the normal and across it, in
series with a junction. The friction of a junction depends on its age, not on its speed: rate and state with the ageing
law θ' = (1 − θ) / t_heal − v θ / D, μ = (μ_d + (μ_s − μ_d) θ) (1 + a ln(1 + v / v_0)). So it weakens over the distance
D, heals while it rests, and sticks exactly below its limit. Source: Dieterich, J. Geophys. Res. 84 (1979) 2161, with θ
over its limit at rest; Ruina, J. Geophys. Res. 88 (1983) 10359.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array


class Law(NamedTuple):
    """Numbers of an element, in SI units.

    ``soft`` is the stiffness that stays, ``branch`` that of the Maxwell branch, which relaxes in ``relax_s``, and
    ``damping`` that of the bulk. ``distance`` is D, ``heal_s`` is t_heal, ``rate`` a and ``rate_mps`` v_0.
    """

    mu_s: float
    mu_d: float
    distance: float
    heal_s: float
    rate: float
    rate_mps: float
    soft: float
    branch: float
    relax_s: float
    damping: float


WORK, HEAT, VISCOUS, LOST = range(4)
"""Energies, J: done by the load, turned to heat by sliding and in the pads, lost where elements part."""

ZX, ZY, QX, QY, AGE = range(5)
"""State of an element: stretch, force of the Maxwell branch, θ."""

NEWTON_STEPS = 12


@compiled
def press(
    force: float, gaps: Array, dt: float, stiff: float, ratio: float, relax_s: float, depth: float, dents: Array,
    loads: Array,
) -> float:  # fmt: skip
    """Press the pad until its elements carry a force; return the depth.

    Args:
        force: Normal force, N.
        gaps: Depth at which each element begins to touch, shape (n,); inf: never.
        dt: Time since the last call, s; inf: everything has relaxed.
        stiff: Force per depth of an element at rest, N.
        ratio: Stiffness of the Maxwell branch over ``stiff``.
        relax_s: Its time constant.
        depth: Depth of the last call.
        dents: Depth of each element and of its branch, shape (2, n); advanced.
        loads: Gets the force on each element, shape (n,), N.
    """
    keep = 0.0 if math.isinf(dt) else ratio * relax_s / (relax_s + dt)
    if force <= 0.0:
        for i in range(gaps.size):
            loads[i] = 0.0
            dents[1, i] = keep / ratio * (dents[1, i] - dents[0, i])
            dents[0, i] = 0.0
        return 0.0
    for _ in range(60):
        total, slope = 0.0, 0.0
        for i in range(gaps.size):
            x = depth - gaps[i]
            p = (1.0 + keep) * x + keep * (dents[1, i] - dents[0, i])
            if x > 0.0 and p > 0.0:
                total += stiff * p
                slope += stiff * (1.0 + keep)
        if slope == 0.0:
            depth += 0.1
            continue
        step = (force - total) / slope
        depth += step
        if abs(step) < 1e-9:
            break
    total = 0.0
    for i in range(gaps.size):
        x = max(depth - gaps[i], 0.0)
        p = (1.0 + keep) * x + keep * (dents[1, i] - dents[0, i])
        loads[i] = stiff * p if x > 0.0 and p > 0.0 else 0.0
        dents[1, i] = keep / ratio * (dents[1, i] + x - dents[0, i])
        dents[0, i] = x
        total += loads[i]
    for i in range(gaps.size):
        loads[i] *= force / total
    return depth


@compiled
def slide(
    law: Law, mass: float, inertia: float, steps: int, dt: float, begin: Array, end: Array, places: Array,
    loads: Array, factors: Array, state: Array, motion: Array, carried: Array, slid: Array, energy: Array,
) -> float:  # fmt: skip
    """Advance the object between two equal pads by some steps under a pressure that stays; return what slides.

    Args:
        law: Of the elements.
        mass: Of the object, kg.
        inertia: About its centre of mass, kg·m².
        steps: Number of steps.
        dt: Length of a step, s.
        begin: Force (2) and torque about the centre of mass at the beginning, shape (3,), N and N·m.
        end: Likewise at the end.
        places: Elements from the centre of mass, shape (2, n), m.
        loads: Normal force on each element of one pad, shape (n,), N.
        factors: Friction of each element over that of the law, shape (n,).
        state: See `AGE`; shape (5, n).
        motion: x, y, angle of the object and their rates, shape (6,).
        carried: Force (2) and torque about the centre of mass that one pad carries, shape (3,).
        slid: How far the junctions slid as a rigid body: x and y of the centroid, m, and angle; shape (3,); added to.
        energy: See `WORK`; shape (4,), J; added to.

    Returns:
        Share of the frictional power of the motion that is at elements that slide.
    """
    n = loads.size
    total, cx, cy, second = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        total, cx, cy = total + loads[i], cx + loads[i] * places[0, i], cy + loads[i] * places[1, i]
    if total > 0.0:
        cx, cy = cx / total, cy / total
    for i in range(n):
        second += loads[i] * ((places[0, i] - cx) ** 2 + (places[1, i] - cy) ** 2)
    keep = law.relax_s / (law.relax_s + dt)
    per_move = law.soft + keep * law.branch + law.damping / dt
    power, sliding = 0.0, 0.0
    for step in range(steps):
        part = (step + 0.5) / steps
        fx, fy, torque = begin[0] + part * (end[0] - begin[0]), begin[1] + part * (end[1] - begin[1]), 0.0
        torque = begin[2] + part * (end[2] - begin[2])
        vx, vy, omega = motion[3], motion[4], motion[5]
        motion[3] += dt * (fx - 2.0 * carried[0]) / mass
        motion[4] += dt * (fy - 2.0 * carried[1]) / mass
        motion[5] += dt * (torque - 2.0 * carried[2]) / inertia
        energy[WORK] += 0.5 * dt * (
            fx * (vx + motion[3]) + fy * (vy + motion[4]) + torque * (omega + motion[5])
        )  # fmt: skip
        vx, vy, omega = motion[3], motion[4], motion[5]
        sum_x, sum_y, spin, heat, viscous, lost = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        slip_x, slip_y, slip_w = 0.0, 0.0, 0.0
        for i in range(n):
            p = loads[i]
            zx, zy, qx, qy, age = state[ZX, i], state[ZY, i], state[QX, i], state[QY, i], state[AGE, i]
            if p <= 0.0:
                lost += 0.5 * law.soft * (zx * zx + zy * zy) + 0.5 * (qx * qx + qy * qy) / law.branch
                state[ZX, i], state[ZY, i], state[QX, i], state[QY, i], state[AGE, i] = 0.0, 0.0, 0.0, 0.0, 1.0
                continue
            rx, ry = places[0, i], places[1, i]
            ux, uy = vx - omega * ry, vy + omega * rx
            dx, dy = dt * ux, dt * uy
            tx = law.soft * zx + keep * qx + per_move * dx
            ty = law.soft * zy + keep * qy + per_move * dy
            trial = math.sqrt(tx * tx + ty * ty)
            hold = p * factors[i] * (law.mu_d + (law.mu_s - law.mu_d) * age)
            speed = math.sqrt(ux * ux + uy * uy)
            power += p * speed
            v = 0.0
            if trial > hold:
                for _ in range(NEWTON_STEPS):  # from below, where it converges without overshoot
                    over = trial - per_move * dt * v - hold * (1.0 + law.rate * math.log(1.0 + v / law.rate_mps))
                    change = over / (per_move * dt + hold * law.rate / (law.rate_mps + v))
                    v += change
                    if change < 1e-9:
                        break
                force = trial - per_move * dt * v
                sx, sy = dt * v * tx / trial, dt * v * ty / trial
                tx, ty = tx * (force / trial), ty * (force / trial)
                dx, dy = dx - sx, dy - sy
                heat += force * dt * v
                sliding += p * speed
                slip_x, slip_y = slip_x + p * sx, slip_y + p * sy
                slip_w += p * ((rx - cx) * sy - (ry - cy) * sx)
            qx, qy = keep * (qx + law.branch * dx), keep * (qy + law.branch * dy)
            viscous += dt / (law.relax_s * law.branch) * (qx * qx + qy * qy) + law.damping / dt * (dx * dx + dy * dy)
            state[ZX, i], state[ZY, i], state[QX, i], state[QY, i] = zx + dx, zy + dy, qx, qy
            state[AGE, i] = (age + dt / law.heal_s) / (1.0 + dt / law.heal_s + dt * v / law.distance)
            sum_x, sum_y, spin = sum_x + tx, sum_y + ty, spin + (rx * ty - ry * tx)
        carried[0], carried[1], carried[2] = sum_x, sum_y, spin
        energy[HEAT] += 2.0 * heat
        energy[VISCOUS] += 2.0 * viscous
        energy[LOST] += 2.0 * lost
        if total > 0.0:
            slid[0] += slip_x / total
            slid[1] += slip_y / total
            slid[2] += slip_w / second if second > 0.0 else 0.0
        motion[0] += dt * vx
        motion[1] += dt * vy
        motion[2] += dt * omega
    return sliding / power if power > 0.0 else 0.0


@compiled
def stored(law: Law, state: Array) -> float:
    """Return what the elements of both pads store, J."""
    total = 0.0
    for i in range(state.shape[1]):
        total += law.soft * (state[ZX, i] ** 2 + state[ZY, i] ** 2)
        total += (state[QX, i] ** 2 + state[QY, i] ** 2) / law.branch
    return total
