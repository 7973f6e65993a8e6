"""Bracket the minimum: any twist gives an upper bound of what friction carries, any admissible field a lower one.

A friction field is admissible where |t_i| ≤ w_i. Each bound is widened by the rounding of its own sums (see
`slipd.fusion.limit`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.limit.frame import U, split
from slipd.fusion.limit.sweep import Field, clip_to_circle, sweep
from slipd.types.arrays import Array


class Plane(NamedTuple):
    """The twists over which the sum Σ w c + h v_x is minimised: q₀ + span{(ax, 0, am), (0, 1, 0)}.

    Attributes:
        h: 1 − ρ for the spin, 1 for the gauge.
        h_error: Bound of the error of h.
        ax: First direction, along v_x.
        am: Likewise, along ω.
        gauge: The sum is the gauge of the unit load (am, 0, −ax); else it is the spin beside f_t.
    """

    h: float
    h_error: float
    ax: float
    am: float
    gauge: bool


class Bracket(NamedTuple):
    """Certified lower and upper bound of the answer, and the value of the last twist."""

    lower: float
    upper: float
    value: float


@compiled_part
def rounding(excess: float, own: Field, h: float, vx: float, speed: float, om: float, slack: float) -> float:
    """Bound the rounding of a sweep's Σ w c + h v_x (arguments as in `bounds`)."""
    return slack * (excess + abs(h * vx) + abs(om)) + 16.0 * U * (speed * (own.missing_x + own.cross) + abs(om))


@compiled
def spin_lower(field: Field, h: float, h_error: float, slack: float) -> float:
    """Bound the largest spin beside f from below, by a field that carries f' = (1 − missing_x, force_y).

    The mixture (1 − s) t + s w a with the translation field of a unit vector a carries f exactly for the smallest s
    with |f − (1 − s) f'| ≤ s, and translation adds no spin about the load centroid; s = 1 is translation alone. With
    e = |f − f'| and r² = 1 − |f'|² that s is at most e (1 + √(1 + r²)) / r².
    """
    gx, gy = field.missing_x, field.force_y
    missing = math.sqrt((gx - h) ** 2 + gy * gy) + slack * (gx + field.cross + h) + h_error
    room = gx * (2.0 - gx) - gy * gy - 4.0 * slack * gx
    share = min(missing * (1.0 + math.sqrt(1.0 + room)) / room, 1.0) if room > 0.0 else 1.0
    return max((1.0 - share) * field.spin, 0.0) - 3.0 * slack - 16.0 * U


@compiled_part
def gauge_upper(field: Field, lx: float, lm: float, slack: float) -> float:
    """Bound the gauge of the unit load ℓ = (lx, 0, lm) from above, by a field that carries about k ℓ.

    What the field lacks of k ℓ, a force a and a spin b, is carried by turning about the load centroid (spin 1, force 1
    at most) and by translation. The sum exceeds its friction circles by at most |a| + 2 |b|, for any k.
    """
    fx = 1.0 - field.missing_x
    along = fx * lx + field.spin * lm
    apart = abs(lx) + 2.0 * abs(lm)  # ℓ carried by translation and by turning, each alone
    if not along > 0.0:
        return apart
    a = math.sqrt((along * lx - fx) ** 2 + field.force_y * field.force_y) + slack * (field.missing_x + field.cross)
    return min((1.0 + a + 2.0 * (abs(along * lm - field.spin) + 3.0 * slack)) / along, apart) * (1.0 + 16.0 * U)


@compiled_part
def bounds(
    excess: float, own: Field, field: Field, vx: float, speed: float, om: float, plane: Plane, slack: float
) -> Bracket:
    """Bracket the answer by a sweep's twist and a friction field.

    Args:
        excess: Σ w c of the sweep.
        own: What the sweep's own friction field carries.
        field: What the bounding friction field carries: the sweep's own, or one that is kept apart.
        vx: v_x of the load centroid.
        speed: |v| of the load centroid plus that of the sweep's point.
        om: ω.
        plane: The question.
        slack: σ.

    Source: weak duality, ℓ·q ≤ D(q) for every twist and every admissible field.
    """
    value = excess + plane.h * vx
    error = rounding(excess, own, plane.h, vx, speed, om, slack)
    if plane.gauge:
        along = plane.am * vx - plane.ax * om
        return Bracket(
            along / (value + error) * (1.0 - 8.0 * U), gauge_upper(field, plane.am, -plane.ax, slack), along / value
        )
    return Bracket(spin_lower(field, plane.h, plane.h_error, slack), value + error + plane.h_error * abs(vx), value)


@compiled_part
def hinge_bounds(
    taxels: Array, px: Array, py: Array, cx: float, cy: float, plane: Plane, slack: float
) -> tuple[Bracket, float]:
    """Bracket the answer with the taxels at one point as a hinge, which carries what is missing up to its friction.

    Args:
        taxels: The contact in its own units, shape (3, n).
        px: Positions seen from the hinge, shape (n,).
        py: Likewise.
        cx: The load centroid seen from the hinge.
        cy: Likewise.
        plane: The question.
        slack: σ.

    Returns:
        The bounds, and the angular velocity of the twist; NaN where no twist of the plane turns about the hinge.

    Source: paper eq. (7), the perfect hinge.
    """
    arm = -plane.ax - plane.am * cy if plane.gauge else 1.0  # spin of ℓ about the hinge
    if abs(arm) < 1e-6:
        return Bracket(math.nan, math.nan, math.nan), math.nan
    om = 1.0 / arm
    x, y, w = split(taxels)
    others = w.copy()
    out = 0.0
    for i in range(px.size):
        if px[i] == 0.0 and py[i] == 0.0:
            out += others[i]
            others[i] = 0.0
    r = sweep(x, y, others, px, py, 0.0, 0.0, om)
    # The hinge stands at −c: the spin of a field without it lacks Σ w y there.
    gx, gy, gm = r.field.missing_x, r.field.force_y, r.field.spin - out * cy
    if plane.gauge:
        fx, fy = (1.0 - out) - gx, gy
        along = (gm + cx * fy - cy * fx) / arm  # spin about the hinge, where its own force has no arm
        less, ty = 1.0 - (along * plane.am - fx) / out, -fy / out
    else:
        less, ty = (plane.h - gx) / out, -gy / out
    less, ty = clip_to_circle(less, ty)
    field = Field(
        gx + out * less, gy + out * ty, gm + out * (cy * (1.0 - less) - cx * ty), r.field.cross + abs(out * ty)
    )
    return bounds(r.excess, r.field, field, -om * cy, abs(om * cx) + abs(om * cy), om, plane, slack), om
