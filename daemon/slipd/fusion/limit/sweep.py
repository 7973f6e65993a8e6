"""One pass over the taxels: what a Newton step and both bounds need."""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled_part, compiled_sum_part
from slipd.types.arrays import Array

TINY = 1e-150  # added to lengths that are divided by: a taxel at the pole has no direction; squares stay finite


class Twist(NamedTuple):
    """A rigid motion over the pad: velocity of a point and angular velocity, up to a common factor."""

    vx: float
    vy: float
    omega: float


class Field(NamedTuple):
    """What a friction field t_i, |t_i| ≤ w_i, carries.

    Attributes:
        missing_x: 1 − Σ t_x: exact to its own size where the field is nearly that of a translation along x.
        force_y: Σ t_y.
        spin: Σ ρ × t, about the load centroid.
        cross: Σ |t_y|, for rounding.
    """

    missing_x: float
    force_y: float
    spin: float
    cross: float


class Sweep(NamedTuple):
    """Sums over the taxels at one twist.

    Attributes:
        excess: Σ w c with c = |u| − u_x: D(q) − v_x.
        field: What the friction field w u/|u| carries, the gradient of D.
        hxx: Hessian of D in (v_x, v_y, ω),
        hxy: likewise,
        hxm: likewise,
        hyy: likewise,
        hym: likewise,
        hmm: likewise.
        sharpness: Σ (w/|u|)²; near (Σ w/|u|)² one taxel, at a kink, makes up the Hessian.
    """

    excess: float
    field: Field
    hxx: float
    hxy: float
    hxm: float
    hyy: float
    hym: float
    hmm: float
    sharpness: float


@compiled_sum_part
def sweep(x: Array, y: Array, w: Array, px: Array, py: Array, vx: float, vy: float, om: float) -> Sweep:
    """Sum power, friction field and Hessian over the taxels.

    Args:
        x: Positions relative to the load centroid, shape (n,): the arms of the forces.
        y: Likewise.
        w: Weights, shape (n,).
        px: The same positions seen from the point whose velocity is given. Near that point, sliding velocities are
            exact to their own size.
        py: Likewise.
        vx: Twist: velocity of that point.
        vy: Likewise.
        om: Angular velocity.
    """
    value = gx = gy = gm = 0.0
    hxx = hxy = hxm = hyy = hym = hmm = bend = gross = 0.0
    for i in range(x.size):
        ux, uy = vx - om * py[i], vy + om * px[i]
        d = math.sqrt(ux * ux + uy * uy) + TINY
        both = d + abs(ux)
        under = 1.0 / (d * both)
        inverse = both * under
        c = uy * uy * (d * under) if ux > 0.0 else d - ux
        nx, ny, k = ux * inverse, uy * inverse, w[i] * inverse
        share = c * inverse if d > TINY else 1.0
        value += w[i] * c
        gx += w[i] * share
        gy += w[i] * ny
        gross += abs(w[i] * ny)
        gm += w[i] * (x[i] * ny + y[i] * share)
        arm = x[i] * nx + y[i] * ny  # ρ × t with t = ẑ × n
        hxx += k * ny * ny
        hxy -= k * nx * ny
        hyy += k * nx * nx
        hxm -= k * ny * arm
        hym += k * nx * arm
        hmm += k * arm * arm
        bend += k * k
    return Sweep(value, Field(gx, gy, gm, gross), hxx, hxy, hxm, hyy, hym, hmm, bend)


@compiled_part
def sharpest(x: Array, y: Array, w: Array, vx: float, vy: float, om: float) -> int:
    """Return the index of the taxel with the largest w / |u|, whose norm has the largest curvature."""
    j, weight, square = 0, 0.0, 1.0
    for i in range(x.size):
        ux, uy = vx - om * y[i], vy + om * x[i]
        wi, ui = w[i] * w[i], ux * ux + uy * uy
        if wi * square > weight * ui:  # fractions compared without division; a taxel at the pole stays the sharpest
            j, weight, square = i, wi, ui
    return j


@compiled_part
def clip_to_circle(missing_x: float, ty: float) -> tuple[float, float]:
    """Shorten t = (1 − missing_x, t_y) to length 1 where it is longer; return 1 − t_x and t_y."""
    over = ty * ty + missing_x * missing_x - 2.0 * missing_x  # |t|² − 1
    if not over > 0.0:
        return missing_x, ty
    size = math.sqrt(1.0 + over)
    return (over / (1.0 + size) + missing_x) / size, ty / size
