"""Primal-dual central path: the way down past kinks.

At a kink (a pole on a taxel or just beside one, one dominant load, a thin or clustered contact) Newton's method
overshoots for ever. Here every norm is smoothed, |u| → √(|u|² + ε²), and twist and friction field take Newton steps
together while ε → 0.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled_part, compiled_sum_part
from slipd.fusion.limit.bounds import Bracket, Plane, bounds, hinge_bounds
from slipd.fusion.limit.frame import Frame, U, split
from slipd.fusion.limit.newton import RESOLUTION, RULING, newton_step, plane_model
from slipd.fusion.limit.sweep import Field, Sweep, Twist, clip_to_circle, sharpest
from slipd.types.arrays import Array

SOFTEST = 0.1  # ε begins at this share of the twist
FOLLOW = 0.1  # and shrinks by this factor at a time, though not below this share of the gap
ARMIJO = 1e-4  # share of the predicted descent that a step must reach
STANDS = 1e-12  # a step this small, relative to the velocity of the sharpest taxel, counts as none
MAX_STOOD = 8  # so many of them in a row without a smaller gap are the end
BESIDE = 1e-9  # a pole this near to a taxel, relative to the twist, may be a hinge


@compiled_sum_part
def path_sweep(
    x: Array, y: Array, w: Array, px: Array, py: Array, missing: Array, across: Array, vx: float, vy: float, om: float,
    soft: float,
) -> tuple[Sweep, Field]:  # fmt: skip
    """Sum the smoothed power and its Hessian at a twist, beside a friction field that is kept apart.

    w u = |u| t is linear in both twist and field. Its Newton step has the curvature (w I − t uᵀ/|u|)/|u|, in which the
    field t stands where the plain step has w u/|u| again. That keeps it from overshooting a kink.

    Args:
        x: As in `sweep.sweep`.
        y: Likewise.
        w: Likewise.
        px: Likewise.
        py: Likewise.
        missing: The field's 1 − t_x/w, shape (n,).
        across: Its t_y/w, shape (n,).
        vx: As in `sweep.sweep`.
        vy: Likewise.
        om: Likewise.
        soft: ε².

    Returns:
        The sums of the smoothed twist, and the wrench of the separate field.
    """
    value = gx = gy = gm = fx = fy = fm = field_gross = 0.0
    hxx = hxy = hxm = hyy = hym = hmm = bend = gross = 0.0
    for i in range(x.size):
        ux, uy = vx - om * py[i], vy + om * px[i]
        less, ty = missing[i], across[i]
        side = uy * uy + soft
        d = math.sqrt(ux * ux + side)
        inverse = 1.0 / d
        beside = side / (d + abs(ux))
        c = beside if ux > 0.0 else d - ux
        nx, ny, k, share = ux * inverse, uy * inverse, w[i] * inverse, c * inverse
        value += w[i] * c
        gx += w[i] * share
        gy += w[i] * ny
        gross += abs(w[i] * ny)
        gm += w[i] * (x[i] * ny + y[i] * share)
        fx += w[i] * less
        fy += w[i] * ty
        field_gross += abs(w[i] * ty)
        fm += w[i] * (x[i] * ty + y[i] * less)
        tx = 1.0 - less
        a, b, c = k * (less + tx * share), -0.5 * k * (tx * ny + ty * nx), k * (1.0 - ty * ny)
        hxx += a
        hxy += b
        hyy += c
        hxm += x[i] * b - y[i] * a
        hym += x[i] * c - y[i] * b
        hmm += x[i] * x[i] * c - 2.0 * x[i] * y[i] * b + y[i] * y[i] * a
        bend += k * k
    return Sweep(value, Field(gx, gy, gm, gross), hxx, hxy, hxm, hyy, hym, hmm, bend), Field(fx, fy, fm, field_gross)


@compiled_part
def update_field(
    px: Array, py: Array, missing: Array, across: Array, vx: float, vy: float, om: float, soft: float, sx: float,
    sy: float, sm: float,
) -> None:  # fmt: skip
    """Take the field's part of the Newton step (sx, sy, sm), clipped to the friction circles (see `path_sweep`)."""
    for i in range(px.size):
        ux, uy = vx - om * py[i], vy + om * px[i]
        side = uy * uy + soft
        d = math.sqrt(ux * ux + side)
        nx, ny = ux / d, uy / d
        share = (side / (d + abs(ux)) if ux > 0.0 else d - ux) / d
        dx, dy = sx - sm * py[i], sy + sm * px[i]
        along = nx * dx + ny * dy
        less = share - (dx - (1.0 - missing[i]) * along) / d
        ty = ny + (dy - across[i] * along) / d
        missing[i], across[i] = clip_to_circle(less, ty)


@compiled_sum_part
def soft_sum(x: Array, y: Array, w: Array, vx: float, vy: float, om: float, soft: float) -> float:
    """Return Σ w c of the smoothed sum."""
    value = 0.0
    for i in range(x.size):
        ux, uy = vx - om * y[i], vy + om * x[i]
        side = uy * uy + soft
        d = math.sqrt(ux * ux + side)
        value += w[i] * (side / (d + abs(ux)) if ux > 0.0 else d - ux)
    return value


@compiled_part
def place_about(x: Array, y: Array, frame: Frame, px: Array, py: Array, j: int) -> None:
    """Write the positions seen from taxel j, each exact to its own size, into px and py."""
    ct, st, mean = frame.ct, frame.st, frame.mean
    for i in range(x.size):
        dx, dy = (x[i] - x[j]) / mean, (y[i] - y[j]) / mean
        px[i], py[i] = ct * dx + st * dy, ct * dy - st * dx


@compiled_part
def follow_path(
    x: Array, y: Array, frame: Frame, taxels: Array, start: Twist, plane: Plane, goal: float, known: Bracket, steps: int
) -> tuple[Bracket, Twist, int, int]:
    """Follow the minimum of the smoothed sum as ε → 0.

    The origin lies in the taxel with the sharpest kink, so that its sliding velocity is exact to its own size.

    Args:
        x: Taxel centres as given, shape (n,), m.
        y: Likewise.
        frame: The contact's own units.
        taxels: The contact in these units, shape (3, n).
        start: The twist to start from; its velocity is that of the load centroid.
        plane: The question.
        goal: Gap of the bounds at which to stop.
        known: Bounds so far.
        steps: Most steps.

    Returns:
        The bounds; the last twist; the index of the taxel that is a hinge (−1: none); the steps made.
    """
    h, ax, am, gauge = plane.h, plane.ax, plane.am, plane.gauge
    xs, ys, w = split(taxels)
    slack = (xs.size + 16) * U
    lower, upper = known.lower, known.upper
    missing, across, px, py = np.zeros(xs.size), np.zeros(xs.size), xs.copy(), ys.copy()
    origin, cx, cy = -1, 0.0, 0.0  # the taxel whose velocity is (ox, oy), and the load centroid seen from it
    ox, oy, om = start
    soft = SOFTEST * (abs(ox) + abs(oy) + abs(om))
    estimate, last_gap, stood = math.nan, math.inf, 0
    for step in range(steps):
        j = sharpest(px, py, w, ox, oy, om)
        if j != origin:
            ox, oy, cx, cy, origin = ox - om * py[j], oy + om * px[j], -xs[j], -ys[j], j
            place_about(x, y, frame, px, py, j)
        if step == 0:
            update_field(px, py, missing, across, ox, oy, om, soft * soft, 0.0, 0.0, 0.0)
        r, carried = path_sweep(xs, ys, w, px, py, missing, across, ox, oy, om, soft * soft)
        vx, vy = ox - om * cy, oy + om * cx
        here = bounds(r.excess, r.field, carried, vx, abs(vx) + abs(vy) + abs(ox) + abs(oy), om, plane, slack)
        estimate = here.value
        lower, upper = max(lower, here.lower), min(upper, here.upper)
        gap = (here.upper - here.lower) / (here.lower * here.upper) if gauge else here.upper - here.lower
        scale = upper if gauge else 1.0
        if upper - lower <= goal * scale:
            break
        curvature = r.hxx + r.hyy
        if r.sharpness > RULING * curvature * curvature:
            at, turn = hinge_bounds(taxels, px, py, cx, cy, plane, slack)
            lower, upper = max(lower, at.lower), min(upper, at.upper)
            if upper - lower <= goal * scale:
                return Bracket(lower, upper, at.value), Twist(-turn * cy, turn * cx, turn), origin, step + 1
        m = plane_model(r, plane)
        s1, s2, _, _ = newton_step(m)
        d1, d2 = ax + am * cy, -am * cx
        update_field(px, py, missing, across, ox, oy, om, soft * soft, d1 * s1, d2 * s1 + s2, am * s1)
        value, slope, shrink = r.excess + h * vx, m.g1 * s1 + m.g2 * s2, 1.0
        while True:
            nx, ny, nm = ox + shrink * d1 * s1, oy + shrink * (d2 * s1 + s2), om + shrink * am * s1
            next_value = soft_sum(px, py, w, nx, ny, nm, soft * soft) + h * (nx - nm * cy)
            if next_value <= value + ARMIJO * shrink * slope + RESOLUTION * abs(value) or shrink < RESOLUTION:
                break
            shrink *= 0.3
        ox, oy, om = nx, ny, nm
        if shrink == 1.0:
            next_soft = min(soft, max(FOLLOW * soft, FOLLOW * gap))
            moved = abs(d1 * s1) + abs(d2 * s1 + s2) + abs(am * s1)
            still = next_soft == soft and moved <= STANDS * (abs(ox) + abs(oy) + soft) and gap >= 0.5 * last_gap
            stood = stood + 1 if still else 0
            if stood == MAX_STOOD:  # what is left is rounding
                break
            soft = next_soft
        last_gap = gap
    end = Twist(ox - om * cy, oy + om * cx, om)
    if abs(ox) + abs(oy) <= BESIDE * (abs(ox) + abs(oy) + abs(om)):
        at, _ = hinge_bounds(taxels, px, py, cx, cy, plane, slack)
        if upper - at.lower <= goal * scale and at.upper - lower <= goal * scale:
            return Bracket(max(lower, at.lower), min(upper, at.upper), at.value), end, origin, step + 1
    return Bracket(lower, upper, estimate), end, -1, step + 1
