"""Newton's method with a line search: the way down where the sum is smooth."""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled_part
from slipd.fusion.limit.bounds import Bracket, Plane, bounds
from slipd.fusion.limit.frame import U
from slipd.fusion.limit.sweep import Sweep, Twist, sharpest, sweep
from slipd.types.arrays import Array

OPEN, MET, MET_AT_KINK = range(3)  # state of the bounds at the end
RESOLUTION = 1e-13  # relative change of the sum that may be rounding
RIDGE = 1e-28  # least curvature of any direction, relative to the largest: a far pole leaves one with very little
FLAT = 1e-9  # a determinant this small, relative to the product of the curvatures, is rounding (collinear taxels)
STIFF = 1e-12  # share of the curvatures' sum that is then added to each
OVERSHOOT = 0.5  # a step that climbs again this steeply, relative to its start, went too far
KINK = 0.1  # share of the squared curvatures from which one taxel may be a kink
MEETS_KINK = 0.25  # a step meets that kink where it changes the taxel's sliding velocity by more than this share
UNSURE = 4e-3  # below this share of the twist, rounding of a sliding velocity shows in its direction
RULING = 0.5  # share of the squared curvatures from which one taxel is tried as the hinge
PATIENCE = 14  # passes after which several taxels together are taken for a kink


class Model(NamedTuple):
    """Second-order model of the sum in the plane: gradient (g1, g2) and Hessian (h11, h12, h22)."""

    g1: float
    g2: float
    h11: float
    h12: float
    h22: float


@compiled_part
def plane_model(r: Sweep, plane: Plane) -> Model:
    """Project a sweep's gradient and Hessian on the directions (ax, 0, am) and (0, 1, 0)."""
    ax, am = plane.ax, plane.am
    h11 = ax * ax * r.hxx + 2.0 * ax * am * r.hxm + am * am * r.hmm
    h22 = r.hyy
    ridge = RIDGE * (h11 + h22) + 1e-300  # collinear taxels leave a direction without curvature
    return Model(
        ax * (plane.h - r.field.missing_x) + am * r.field.spin,
        r.field.force_y,
        h11 + ridge,
        ax * r.hxy + am * r.hym,
        h22 + ridge,
    )


@compiled_part
def newton_step(m: Model) -> tuple[float, float, float, bool]:
    """Return −H⁻¹ of the gradient, 1/det, and whether the model is curved in every direction.

    A model that is not is stiffened by a share of its curvature.
    """
    g1, g2, h11, h12, h22 = m
    bends = h11 * h22 - h12 * h12 > FLAT * h11 * h22
    if not bends:
        h11, h22 = h11 + STIFF * (h11 + h22), h22 + STIFF * (h11 + h22)
    inverse = 1.0 / (h11 * h22 - h12 * h12)
    return (h12 * g2 - h22 * g1) * inverse, (h12 * g1 - h11 * g2) * inverse, inverse, bends


@compiled_part
def norm_step(m: Model, power: float, pull: float) -> tuple[float, float, bool]:
    """Step to the minimum of √Q − pull · s₁, where Q is the square that meets D to second order.

    D is a norm, and so is √Q. A quadratic is not, which makes the plain Newton step overshoot. With e the gradient, H
    the Hessian, b = (pull, 0) and B, E, F = bᵀH⁻¹b, bᵀH⁻¹e, eᵀH⁻¹e, each over D, the minimum is at
    z (−H⁻¹e + s H⁻¹b), (1 − B) s² + 2 (1 + E) s = F and 1/z = 1 + E + F − (B + E) s.

    Args:
        m: Gradient and Hessian.
        power: D here.
        pull: Slope that is subtracted along the first direction.

    Returns:
        The step (2), and whether the model is curved in every direction.
    """
    s1, s2, inverse, bends = newton_step(m)
    k1, k2 = m.h22 * pull * inverse, -m.h12 * pull * inverse
    bb, be, ee = pull * k1 / power, -pull * s1 / power, -(m.g1 * s1 + m.g2 * s2) / power
    square = (1.0 + be) * (1.0 + be) + (1.0 - bb) * ee
    if square > 0.0:
        s = ee / ((1.0 + be) + math.sqrt(square))
        shorten = 1.0 + be + ee - (bb + be) * s
        if shorten > 0.0:
            return (s1 + s * k1) / shorten, (s2 + s * k2) / shorten, bends
    return s1, s2, bends


@compiled_part
def descend(
    x: Array, y: Array, w: Array, start: Twist, plane: Plane, goal: float, passes: int
) -> tuple[Bracket, Twist, int, int]:
    """Minimise the sum by Newton's method with a line search, until the bounds meet or a kink comes into play.

    Args:
        x: Positions, shape (n,).
        y: Likewise.
        w: Weights, shape (n,).
        start: The twist to start from, in the plane.
        plane: The question.
        goal: Gap of the bounds at which to stop.
        passes: Most passes over the taxels.

    Returns:
        The bounds; the last twist; OPEN, MET or MET_AT_KINK; the passes made.
    """
    h, ax, am = plane.h, plane.ax, plane.am
    q0, q1, q2 = start
    slack = (x.size + 16) * U
    lower, upper = -math.inf, math.inf
    r = sweep(x, y, w, x, y, q0, q1, q2)
    last_fall, done = math.inf, 1
    while True:
        here = bounds(r.excess, r.field, r.field, q0, abs(q0) + abs(q1), q2, plane, slack)
        lower, upper = max(lower, here.lower), min(upper, here.upper)
        curvature = r.hxx + r.hyy  # Σ w/|u|
        if upper - lower <= goal * (upper if plane.gauge else 1.0):
            state = MET_AT_KINK if r.sharpness > RULING * curvature * curvature else MET
            return Bracket(lower, upper, here.value), Twist(q0, q1, q2), state, done
        if done >= passes:
            return Bracket(lower, upper, here.value), Twist(q0, q1, q2), OPEN, done
        m = plane_model(r, plane)
        s1, s2, bends = norm_step(m, r.excess + q0, (1.0 - h) * ax)
        size = abs(q0) + abs(q1) + abs(q2)
        if not bends or r.sharpness > KINK * curvature * curvature:
            j = sharpest(x, y, w, q0, q1, q2)
            near = abs(q0 - q2 * y[j]) + abs(q1 + q2 * x[j])
            change = abs((ax - am * y[j]) * s1) + abs(am * x[j] * s1 + s2)
            if not bends or change > MEETS_KINK * near or near < UNSURE * w[j] * size:
                return Bracket(lower, upper, here.value), Twist(q0, q1, q2), OPEN, done
        value, slope, shrink = r.excess + h * q0, m.g1 * s1 + m.g2 * s2, 1.0
        resolved = -slope > RESOLUTION * abs(value)
        while True:
            if done >= passes:
                return Bracket(lower, upper, here.value), Twist(q0, q1, q2), OPEN, done
            vx, vy, om = q0 + shrink * s1 * ax, q1 + shrink * s2, q2 + shrink * s1 * am
            r = sweep(x, y, w, x, y, vx, vy, om)
            done += 1
            end = (ax * (h - r.field.missing_x) + am * r.field.spin) * s1 + r.field.force_y * s2
            # Where rounding hides the descent of the sum, the gradient shows it: full steps while it shrinks.
            if resolved and r.excess + h * vx < value and end <= -OVERSHOOT * slope:
                break
            if not resolved and -slope < 0.25 * last_fall:
                break
            if not resolved or done > PATIENCE:
                return Bracket(lower, upper, here.value), Twist(q0, q1, q2), OPEN, done
            shrink *= min(max(slope / (slope - end), 0.1), 0.7) if end > 0.0 else 0.5
        q0, q1, q2 = vx, vy, om
        last_fall = -slope
