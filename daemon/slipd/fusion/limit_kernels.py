"""The kernels under the limit surface: a sum of norms, minimised over a plane of twists, and the bounds of the answer.

A rigid motion of the object over the pad is a twist q = (v_x, v_y, ω); taxel i then slides with u_i = v + ω ẑ × ρ_i.
Friction on it can take at most w_i = μ F_i along u_i, so the power that friction takes is the convex function
D(q) = Σ w_i |u_i|, and a load ℓ = (f_x, f_y, m) is carried exactly when ℓ·q ≤ D(q) for every twist. Two questions
follow:

* the largest spin beside a given f_t: minimise D(q) − f_t·v over twists with ω = 1;
* the utilisation λ of a load: 1/λ is the minimum of D(q) over twists with ℓ·q = 1 (a pole at infinity, ω = 0, is an
  ordinary point of that plane).

(5) is the stationarity of that sum and (7), the perfect hinge, its optimality condition at a taxel, where the norm has
a kink; so neither needs a search of its own. (6) as printed compares a torque about C with one about the pole and is
not used.

**The way down.** :func:`descend` is Newton's method with a line search, a pass over the taxels a step; in most contacts
the bounds meet after 3–7. Where a kink comes into play (a pole on a taxel or just beside one, one load that dominates,
a thin or clustered contact), Newton's method overshoots for ever: :func:`follow_path` takes over, which smooths the
kinks by ε and steps in twist and friction field together while ε → 0. Both stop when the bounds meet, or when only
their rounding is left.

**Units.** Positions are taken about the load centroid, in mean distances from it (Σ w = 1, Σ w ρ = 0, Σ w |ρ| = 1),
and turned so that f_t points along +x. In these, with ρ = |f_t| / (μ f_n), |u| = u_x + c with
c = u_y² / (|u| + u_x) ≥ 0, and because Σ w u_x = v_x,

    D(q) − ρ v_x = Σ w c + (1 − ρ) v_x,      Σ w u/|u| = (1 − Σ w c/|u|, Σ w u_y/|u|).

Every term is small where the sum is small: a pole a million mean distances away, where translation nears (1 − ρ → 0),
costs no digit, given 1 − ρ itself. And D(q) ≥ max(|v|, |ω| − |v|) ≥ (|v| + |ω|)/3.

**Rounding.** With u = 2⁻⁵³ a sum of n terms errs by at most n u Σ|terms| in whatever order; the terms below add less
than 16 u to that, so σ = (n + 16) u stands for both.

* The frame: weights and lengths are off by one common factor each, which the units absorb; Σ w ρ misses 0 by at most
  σ, a torque of σ; the turn misses f_t by an angle of 2 u, and turning the whole field by it costs 2 u Σ w |ρ|.
* D(q) − ρ v_x: u_i errs by 2 u (|v| + |ω ρ_i|), c by (c + |u_y|)/|u| times that; with g = Σ w c/|u| and
  k = Σ w |u_y|/|u| the sum errs by σ (Σ w c + |(1 − ρ) v_x| + |ω|) + 16 u (|v| (g + k) + |ω|) at most.
* A friction field is what was computed, so errors of u_i do not count; only those of its sums do: σ g and σ k for the
  force, 2 σ for the spin, and it leaves its discs by 10 u c/|u| at most.
* 1 − ρ carries a bound of its own (:func:`slack_of_room`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled, compiled_sum

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Sweep = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
Model = tuple[float, float, float, float, float]
Frame = tuple[float, float, float]
Twist = tuple[float, float, float]
Plane = tuple[float, float, float, float, bool]

U = 2.0**-53
KINDS = ("interior", "hinge", "translating", "none")
INTERIOR, HINGE, TRANSLATING, NONE = range(4)
OPEN, MET, MET_AT_KINK = range(3)
FAR = 1e9  # a pole this many mean distances away is a translation for every purpose
GOAL = 2e-13  # gap at which an answer is as good as its rounding bound,
GOAL_SLACKS = 30.0  # which is less than so many σ
MAX_PASSES = 120  # ordinary scenes need 3–7, hinges some 20; a gap that stays open is told by the bounds
MAX_ROOT_STEPS = 60  # of a bracketed Newton that takes 3–5,
ROOT = 1e-12  # to this precision of log k
RESOLUTION = 1e-13  # relative change of the sum that may be rounding
TINY = 1e-150  # added to lengths that are divided by: a taxel at the pole has no direction; squares stay finite
SMALLEST, LARGEST = 1e-130, 1e130  # lengths and forces whose squares and products are finite, and are not 0
RIDGE = 1e-28  # least curvature of any direction, relative to the largest: a far pole leaves one with very little
FLAT = 1e-9  # a determinant this small, relative to the product of the curvatures, is rounding (collinear taxels),
STIFF = 1e-12  # and is helped with so much of their sum
LONGEST = 8.0  # a step changes the velocity by no more than so many times what it was
OVERSHOOT = 0.5  # a step that climbs again this steeply, relative to its start, went too far
KINK = 0.1  # share of the squared curvatures from which a taxel may be a kink,
FELT = 0.25  # share of its sliding velocity by which a step must change it to feel that,
UNSURE = 4e-3  # and share of the twist below which rounding of its sliding velocity shows in its direction
PATIENCE = 14  # passes after which a kink of many taxels together is assumed
SOFTEST = 0.1  # ε begins at this share of the twist,
FOLLOW = 0.1  # and shrinks by this factor, though not below this share of the gap
ARMIJO = 1e-4  # share of the foretold descent that a step must reach
STANDS = 1e-12  # a step this small, relative to the velocity of the sharpest taxel, is none,
MAX_STOOD = 8  # and so many of them in a row, the gap no longer falling, are the end
BESIDE = 1e-9  # a pole this near to a taxel, relative to the twist, may be a hinge
RULING = 0.5  # share of the squared curvatures from which one taxel is tried as the hinge
NEAR_TRANSLATION = 0.02  # below this, 1 − ρ is computed in double-double
ASKEW = 20.0  # a twist from before whose power is less than its size by this factor tells nothing of this load
SPLIT = 134217729.0  # 2²⁷ + 1 (Dekker)


@compiled_sum
def sweep(x: Array, y: Array, w: Array, px: Array, py: Array, vx: float, vy: float, om: float) -> Sweep:
    """One pass over the taxels: everything a step and both bounds need.

    Args:
        x: Positions about the load centroid, shape (n,), in the units above: the arms of the forces.
        y: Likewise.
        w: Weights, shape (n,).
        px: The same positions seen from the point whose velocity is told: near it, the velocities are exact to their
            own size.
        py: Likewise.
        vx: Twist: velocity of that point,
        vy: likewise,
        om: and angular velocity.

    Returns:
        Σ w c, Σ w c/|u|, Σ w u_y/|u|, spin of the friction field; Hessian xx, xy, xω, yy, yω, ωω; Σ (w/|u|)²;
        Σ w |u_y|/|u|.
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
    return value, gx, gy, gm, hxx, hxy, hxm, hyy, hym, hmm, bend, gross


@compiled_sum
def path_sweep(
    x: Array, y: Array, w: Array, px: Array, py: Array, field: Array, vx: float, vy: float, om: float, soft: float
) -> tuple[Sweep, float, float, float, float]:
    """The same of the smoothed sum, with |u| = √(|u|² + ε²), beside a friction field that is kept apart.

    The primal and dual Newton step: of w u = |u| t, linear in both, comes a curvature (w I − t uᵀ/|u|)/|u| in which the
    field t stands where the plain step has w u/|u| again; that keeps it from overshooting a kink.

    Args:
        x: As in :func:`sweep`.
        y: Likewise.
        w: Likewise.
        px: Likewise.
        py: Likewise.
        field: 1 − t_x/w and t_y/w, shape (2, n).
        vx: As in :func:`sweep`.
        vy: Likewise.
        om: Likewise.
        soft: ε².

    Returns:
        As :func:`sweep`; and of the field 1 − Σ t_x, Σ t_y, its spin and Σ |t_y|.
    """
    value = gx = gy = gm = fx = fy = fm = field_gross = 0.0
    hxx = hxy = hxm = hyy = hym = hmm = bend = gross = 0.0
    for i in range(x.size):
        ux, uy = vx - om * py[i], vy + om * px[i]
        less, ty = field[0, i], field[1, i]
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
    return (value, gx, gy, gm, hxx, hxy, hxm, hyy, hym, hmm, bend, gross), fx, fy, fm, field_gross


@compiled
def update_field(
    px: Array, py: Array, field: Array, vx: float, vy: float, om: float, soft: float, sx: float, sy: float, sm: float
) -> None:
    """The field's part of that step, of the twist (sx, sy, sm), cut to its discs."""
    for i in range(px.size):
        ux, uy = vx - om * py[i], vy + om * px[i]
        side = uy * uy + soft
        d = math.sqrt(ux * ux + side)
        nx, ny = ux / d, uy / d
        share = (side / (d + abs(ux)) if ux > 0.0 else d - ux) / d
        dx, dy = sx - sm * py[i], sy + sm * px[i]
        along = nx * dx + ny * dy
        less = share - (dx - (1.0 - field[0, i]) * along) / d
        ty = ny + (dy - field[1, i] * along) / d
        field[0, i], field[1, i] = cut(less, ty)


@compiled_sum
def soft_sum(x: Array, y: Array, w: Array, vx: float, vy: float, om: float, soft: float) -> float:
    """Σ w c of the smoothed sum."""
    value = 0.0
    for i in range(x.size):
        ux, uy = vx - om * y[i], vy + om * x[i]
        side = uy * uy + soft
        d = math.sqrt(ux * ux + side)
        value += w[i] * (side / (d + abs(ux)) if ux > 0.0 else d - ux)
    return value


@compiled
def cut(less: float, ty: float) -> tuple[float, float]:
    """(1 − less, ty) shortened to length 1, as 1 − its first part and its second."""
    over = ty * ty + less * less - 2.0 * less  # |t|² − 1
    if not over > 0.0:
        return less, ty
    size = math.sqrt(1.0 + over)
    return (over / (1.0 + size) + less) / size, ty / size


@compiled
def sharpest(x: Array, y: Array, w: Array, vx: float, vy: float, om: float) -> int:
    """The taxel with the largest w / |u|, whose norm bends most."""
    j, weight, square = 0, 0.0, 1.0
    for i in range(x.size):
        ux, uy = vx - om * y[i], vy + om * x[i]
        wi, ui = w[i] * w[i], ux * ux + uy * uy
        if wi * square > weight * ui:  # fractions compared without dividing; a taxel at the pole stays the sharpest
            j, weight, square = i, wi, ui
    return j


@compiled
def plane_model(r: Sweep, h: float, ax: float, am: float) -> Model:
    """Gradient (2) and Hessian (11, 12, 22) along the plane's directions (ax, 0, am) and (0, 1, 0)."""
    h11 = ax * ax * r[4] + 2.0 * ax * am * r[6] + am * am * r[9]
    h22 = r[7]
    ridge = RIDGE * (h11 + h22) + 1e-300  # collinear taxels leave a direction without curvature
    return ax * (h - r[1]) + am * r[3], r[2], h11 + ridge, ax * r[5] + am * r[8], h22 + ridge


@compiled
def newton_step(m: Model) -> tuple[float, float, float, bool]:
    """−H⁻¹ of the gradient, 1/det, and whether the model bends in every direction (it is helped where it does not)."""
    g1, g2, h11, h12, h22 = m
    bends = h11 * h22 - h12 * h12 > FLAT * h11 * h22
    if not bends:
        h11, h22 = h11 + STIFF * (h11 + h22), h22 + STIFF * (h11 + h22)
    inverse = 1.0 / (h11 * h22 - h12 * h12)
    return (h12 * g2 - h22 * g1) * inverse, (h12 * g1 - h11 * g2) * inverse, inverse, bends


@compiled
def norm_step(m: Model, power: float, pull: float) -> tuple[float, float, bool]:
    """The step to the minimum of √Q − pull · s₁, Q the square that meets D to second order.

    D is a norm, and so is √Q; that a quadratic is not makes the plain Newton step overshoot. With e the gradient, H the
    Hessian, b = (pull, 0) and B, E, F = bᵀH⁻¹b, bᵀH⁻¹e, eᵀH⁻¹e, each over D, the minimum is at
    z (−H⁻¹e + s H⁻¹b), (1 − B) s² + 2 (1 + E) s = F and 1/z = 1 + E + F − (B + E) s.

    Args:
        m: Gradient and Hessian.
        power: D here.
        pull: Slope that is subtracted along the first direction.

    Returns:
        The step (2), and whether the model bends in every direction.
    """
    s1, s2, inverse, bends = newton_step(m)
    k1, k2 = m[4] * pull * inverse, -m[3] * pull * inverse
    bb, be, ee = pull * k1 / power, -pull * s1 / power, -(m[0] * s1 + m[1] * s2) / power
    square = (1.0 + be) * (1.0 + be) + (1.0 - bb) * ee
    if square > 0.0 and be > -1.0:
        s = ee / ((1.0 + be) + math.sqrt(square))
        shorten = 1.0 + be + ee - (bb + be) * s
        if shorten > 0.0:
            return (s1 + s * k1) / shorten, (s2 + s * k2) / shorten, bends
    return s1, s2, bends


@compiled
def rounding(r: Sweep, h: float, vx: float, speed: float, om: float, slack: float) -> float:
    """Bound of the rounding of a sweep's Σ w c + h v_x; speed: |v| of the centroid and of the point told."""
    return slack * (r[0] + abs(h * vx) + abs(om)) + 16.0 * U * (speed * (r[1] + r[11]) + abs(om))


@compiled
def spin_lower(gx: float, gy: float, gm: float, gross: float, h: float, dh: float, slack: float) -> float:
    """Bound of the same from the friction field that carries f' = (1 − g_x, g_y) and the spin g_m.

    The mixture (1 − s) t + s w a with the translation field of a unit vector a carries f exactly for the smallest s
    with |f − (1 − s) f'| ≤ s, and translation adds no spin about the load centroid; s = 1 is translation alone. With
    e = |f − f'| and r² = 1 − |f'|² that s is at most e (1 + √(1 + r²)) / r².
    """
    missing = math.sqrt((gx - h) ** 2 + gy * gy) + slack * (gx + gross + h) + dh
    room = gx * (2.0 - gx) - gy * gy - 4.0 * slack * gx
    share = min(missing * (1.0 + math.sqrt(1.0 + room)) / room, 1.0) if room > 0.0 else 1.0
    return max((1.0 - share) * gm, 0.0) - 3.0 * slack - 16.0 * U


@compiled
def gauge_upper(gx: float, gy: float, gm: float, gross: float, lx: float, lm: float, slack: float) -> float:
    """Bound of the gauge of the unit load ℓ = (lx, 0, lm) from the field that carries f' = (1 − g_x, g_y) and g_m.

    What the wrench lacks to k ℓ, a force a and a spin b, is carried by turning about the load centroid (spin 1, force 1
    at most) and translation: the sum leaves its discs by |a| + 2 |b| at most, and any k serves.
    """
    fx = 1.0 - gx
    along = fx * lx + gm * lm
    apart = abs(lx) + 2.0 * abs(lm)  # ℓ carried by translation and by turning, each alone
    if not along > 0.0:
        return apart
    a = math.sqrt((along * lx - fx) ** 2 + gy * gy) + slack * (gx + gross)
    return min((1.0 + a + 2.0 * (abs(along * lm - gm) + 3.0 * slack)) / along, apart) * (1.0 + 16.0 * U)


@compiled
def bounds(
    r: Sweep, fx: float, fy: float, fm: float, gross: float, vx: float, speed: float, om: float, plane: Plane,
    slack: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Lower and upper bound from a sweep's twist and a friction field (1 − force, spin), and the value of the twist."""
    h, dh, ax, am, gauge = plane
    value = r[0] + h * vx
    error = rounding(r, h, vx, speed, om, slack)
    if gauge:
        along = am * vx - ax * om
        return along / (value + error) * (1.0 - 8.0 * U), gauge_upper(fx, fy, fm, gross, am, -ax, slack), along / value
    return spin_lower(fx, fy, fm, gross, h, dh, slack), value + error + dh * abs(vx), value


@compiled
def descend(
    x: Array, y: Array, w: Array, q: Array, plane: Plane, goal: float, passes: int
) -> tuple[float, float, float, int, int]:
    """Newton's method with a line search, from q, until the bounds meet or a kink comes into play.

    Returns:
        Lower bound, upper bound, the value of the last twist, OPEN, MET or MET_AT_KINK, passes.
    """
    h, _, ax, am, gauge = plane
    slack = (x.size + 16) * U
    lower, upper = -math.inf, math.inf
    r = sweep(x, y, w, x, y, q[0], q[1], q[2])
    last_fall, done = math.inf, 1
    while True:
        low, high, estimate = bounds(r, r[1], r[2], r[3], r[11], q[0], abs(q[0]) + abs(q[1]), q[2], plane, slack)
        lower, upper = max(lower, low), min(upper, high)
        curvature = r[4] + r[7]  # Σ w/|u|
        if upper - lower <= goal * (upper if gauge else 1.0):
            return lower, upper, estimate, MET_AT_KINK if r[10] > RULING * curvature * curvature else MET, done
        if done >= passes:
            return lower, upper, estimate, OPEN, done
        m = plane_model(r, h, ax, am)
        s1, s2, bends = norm_step(m, r[0] + q[0], (1.0 - h) * ax)
        size = abs(q[0]) + abs(q[1]) + abs(q[2])
        if not bends or r[10] > KINK * curvature * curvature:
            j = sharpest(x, y, w, q[0], q[1], q[2])
            near = abs(q[0] - q[2] * y[j]) + abs(q[1] + q[2] * x[j])
            change = abs((ax - am * y[j]) * s1) + abs(am * x[j] * s1 + s2)
            if not bends or change > FELT * near or near < UNSURE * w[j] * size:
                return lower, upper, estimate, OPEN, done
        length = abs(s1) + abs(s2)
        if length > LONGEST * size:
            s1, s2 = s1 * (LONGEST * size / length), s2 * (LONGEST * size / length)
        value, slope, shrink = r[0] + h * q[0], m[0] * s1 + m[1] * s2, 1.0
        resolved = -slope > RESOLUTION * abs(value)
        while True:
            if done >= passes:
                return lower, upper, estimate, OPEN, done
            vx, vy, om = q[0] + shrink * s1 * ax, q[1] + shrink * s2, q[2] + shrink * s1 * am
            r = sweep(x, y, w, x, y, vx, vy, om)
            done += 1
            end = (ax * (h - r[1]) + am * r[3]) * s1 + r[2] * s2
            # Where the sum no longer tells a descent, the gradient does: full steps while it shrinks.
            if resolved and r[0] + h * vx < value and end <= -OVERSHOOT * slope:
                break
            if not resolved and -slope < 0.25 * last_fall:
                break
            if not resolved or done > PATIENCE:
                return lower, upper, estimate, OPEN, done
            shrink *= min(max(slope / (slope - end), 0.1), 0.7) if end > 0.0 else 0.5
        q[0], q[1], q[2] = vx, vy, om
        last_fall = -slope


@compiled
def place_about(x: Array, y: Array, frame: Frame, places: Array, j: int) -> None:
    """Writes the positions seen from taxel j, each exact to its own size, into places (2, n)."""
    ct, st, mean = frame
    for i in range(x.size):
        dx, dy = (x[i] - x[j]) / mean, (y[i] - y[j]) / mean
        places[0, i], places[1, i] = ct * dx + st * dy, ct * dy - st * dx


@compiled
def hinge_bounds(
    taxels: Array, px: Array, py: Array, cx: float, cy: float, plane: Plane, slack: float
) -> tuple[float, float, float, float]:
    """Bounds with the taxels at the point told as a hinge, which takes what is missing as far as its friction goes.

    Args:
        taxels: Positions and weights, shape (3, n).
        px: Positions seen from the hinge, shape (n,).
        py: Likewise.
        cx: The load centroid seen from the hinge.
        cy: Likewise.
        plane: As in :func:`bounds`.
        slack: σ.

    Returns:
        Lower bound, upper bound, value, and the angular velocity of the twist; NaN where no twist of the plane is that.
    """
    h, _, ax, am, gauge = plane
    arm = -ax - am * cy if gauge else 1.0  # spin of ℓ about the hinge
    if abs(arm) < 1e-6:
        return math.nan, math.nan, math.nan, math.nan
    om = 1.0 / arm
    others = taxels[2].copy()
    out = 0.0
    for i in range(px.size):
        if px[i] == 0.0 and py[i] == 0.0:
            out += others[i]
            others[i] = 0.0
    r = sweep(taxels[0], taxels[1], others, px, py, 0.0, 0.0, om)
    # The hinge stands at −c: the spin of a field without it lacks Σ w y there.
    gm = r[3] - out * cy
    if gauge:
        fx, fy = (1.0 - out) - r[1], r[2]
        along = (gm + cx * fy - cy * fx) / arm  # spin about the hinge, where its own force has no arm
        less, ty = 1.0 - (along * am - fx) / out, -fy / out
    else:
        less, ty = (h - r[1]) / out, -r[2] / out
    less, ty = cut(less, ty)
    fx, fy, fm = r[1] + out * less, r[2] + out * ty, gm + out * (cy * (1.0 - less) - cx * ty)
    low, high, value = bounds(
        r, fx, fy, fm, r[11] + abs(out * ty), -om * cy, abs(om * cx) + abs(om * cy), om, plane, slack
    )
    return low, high, value, om


@compiled
def follow_path(
    x: Array, y: Array, frame: Frame, taxels: Array, q: Array, plane: Plane, goal: float, lower: float, upper: float,
    steps: int,
) -> tuple[float, float, float, int, int]:  # fmt: skip
    """Follows the minimum of the smoothed sum, |u| = √(|u|² + ε²), as ε → 0: a primal and dual path past every kink.

    The origin lies in the taxel with the sharpest kink, so that its sliding velocity is exact to its own size.

    Args:
        x: Positions as given, shape (n,), m.
        y: Likewise.
        frame: Direction of f_t (2), and mean distance, m.
        taxels: Positions and weights in the units above, shape (3, n).
        q: The twist to start from, shape (3,), and on return the last one; its velocity is that of the load centroid.
        plane: As in :func:`bounds`.
        goal: Gap at which to stop.
        lower: Bound so far.
        upper: Likewise.
        steps: Most steps.

    Returns:
        Lower bound, upper bound, value of the last twist, the taxel that is a hinge (−1: none), and steps.
    """
    h, _, ax, am, gauge = plane
    xs, ys, w = taxels[0], taxels[1], taxels[2]
    slack = (x.size + 16) * U
    field, places = np.zeros((2, x.size)), taxels[:2].copy()
    px, py = places[0], places[1]
    origin, cx, cy = -1, 0.0, 0.0  # the taxel whose velocity is told, and the load centroid seen from it
    ox, oy, om = q[0], q[1], q[2]
    soft = SOFTEST * (abs(ox) + abs(oy) + abs(om))
    estimate, last_gap, stood = math.nan, math.inf, 0
    for step in range(steps):
        j = sharpest(px, py, w, ox, oy, om)
        if j != origin:
            ox, oy, cx, cy, origin = ox - om * py[j], oy + om * px[j], -xs[j], -ys[j], j
            place_about(x, y, frame, places, j)
        if step == 0:
            update_field(px, py, field, ox, oy, om, soft * soft, 0.0, 0.0, 0.0)
        r, fx, fy, fm, gross = path_sweep(xs, ys, w, px, py, field, ox, oy, om, soft * soft)
        vx, vy = ox - om * cy, oy + om * cx
        low, high, estimate = bounds(r, fx, fy, fm, gross, vx, abs(vx) + abs(vy) + abs(ox) + abs(oy), om, plane, slack)
        lower, upper = max(lower, low), min(upper, high)
        gap = (high - low) / (low * high) if gauge else high - low
        scale = upper if gauge else 1.0
        if upper - lower <= goal * scale:
            break
        curvature = r[4] + r[7]
        if r[10] > RULING * curvature * curvature:
            low, high, value, turn = hinge_bounds(taxels, px, py, cx, cy, plane, slack)
            lower, upper = max(lower, low), min(upper, high)
            if upper - lower <= goal * scale:
                q[0], q[1], q[2] = -turn * cy, turn * cx, turn
                return lower, upper, value, origin, step + 1
        m = plane_model(r, h, ax, am)
        s1, s2, _, _ = newton_step(m)
        d1, d2 = ax + am * cy, -am * cx
        update_field(px, py, field, ox, oy, om, soft * soft, d1 * s1, d2 * s1 + s2, am * s1)
        value, slope, shrink = r[0] + h * vx, m[0] * s1 + m[1] * s2, 1.0
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
    q[0], q[1], q[2] = ox - om * cy, oy + om * cx, om
    if abs(ox) + abs(oy) <= BESIDE * (abs(ox) + abs(oy) + abs(om)):
        low, high, value, _ = hinge_bounds(taxels, px, py, cx, cy, plane, slack)
        if upper - low <= goal * scale and high - lower <= goal * scale:
            return max(lower, low), min(upper, high), value, origin, step + 1
    return lower, upper, estimate, -1, step + 1


@compiled
def minimise(
    x: Array, y: Array, frame: Frame, taxels: Array, q: Array, plane: Plane, gap: float, passes: int
) -> tuple[float, float, float, int, int]:
    """Minimises Σ w c(q) + h v_x over q + span{(ax, 0, am), (0, 1, 0)} until its bounds meet.

    Newton's method where the sum is smooth, the central path where a taxel's kink comes into play: the sum is convex,
    and both descend, so it converges from anywhere.

    Args:
        x: Positions as given, shape (n,), m.
        y: Likewise.
        frame: Direction of f_t (2), and mean distance, m.
        taxels: Positions and weights in the units above, shape (3, n).
        q: The twist to start from, shape (3,), and on return the last one.
        plane: h (1 − ρ for the spin, 1 for the gauge), the bound of its error, ax, am, and whether it is the gauge of
            the unit load (am, 0, −ax).
        gap: Gap of the bounds at which to stop.
        passes: Most passes of the first part, and steps of both.

    Returns:
        Lower bound, upper bound, value of the last twist, the taxel that is a hinge (−1: none), passes and steps.
    """
    goal = max(gap, GOAL_SLACKS * (x.size + 16) * U)
    lower, upper, value, state, done = descend(taxels[0], taxels[1], taxels[2], q, plane, goal, passes)
    hinge = -1
    if state == MET_AT_KINK:
        j = sharpest(taxels[0], taxels[1], taxels[2], q[0], q[1], q[2])
        ux, uy = q[0] - q[2] * taxels[1, j], q[1] + q[2] * taxels[0, j]
        if abs(ux) + abs(uy) <= BESIDE * (abs(q[0]) + abs(q[1]) + abs(q[2])):
            hinge = j
    elif state == OPEN and done < passes:
        lower, upper, value, hinge, steps = follow_path(
            x, y, frame, taxels, q, plane, goal, lower, upper, passes - done
        )
        done += steps
    return lower, upper, min(max(value, lower), upper), hinge, done


@compiled_sum
def moments(x: Array, y: Array, loads: Array, ox: float, oy: float) -> tuple[float, float, float, float]:
    """Σ F, Σ F (r − o) (2), and the number of loads that are negative."""
    total = mx = my = negative = 0.0
    for i in range(x.size):
        total += loads[i]
        mx += loads[i] * (x[i] - ox)
        my += loads[i] * (y[i] - oy)
        negative += 1.0 if loads[i] < 0.0 else 0.0
    return total, mx, my, negative


@compiled_sum
def place(
    x: Array, y: Array, loads: Array, cx: float, cy: float, ex: float, ey: float, ct: float, st: float, scale: float,
    taxels: Array,
) -> tuple[float, float]:  # fmt: skip
    """Writes positions about c + e, turned by −(ct, st), and weights into taxels (3, n).

    Returns:
        Σ w |ρ|, and Σ w (|ρ_x| + |ρ_y|), which does not underflow.
    """
    mean = blocks = 0.0
    for i in range(x.size):
        dx, dy, w = (x[i] - cx) - ex, (y[i] - cy) - ey, loads[i] * scale
        taxels[0, i], taxels[1, i], taxels[2, i] = ct * dx + st * dy, ct * dy - st * dx, w
        mean += w * math.sqrt(dx * dx + dy * dy)
        blocks += w * (abs(dx) + abs(dy))
    return mean, blocks


@compiled
def normalise(
    x: Array, y: Array, loads: Array, fx: float, fy: float, taxels: Array
) -> tuple[float, float, float, float, float, float]:
    """Brings a contact into the units above, the force (fx, fy) along +x.

    The centroid is told as a point and what it lacks, so that the lever of a small contact far from the origin, or of
    one heavy taxel among light ones, is exact to the contact's own size.

    Returns:
        Σ F (NaN: a value is not finite, a load is negative, or squares would not be finite), the point (2), what it
        lacks (2), and the mean distance (0: all load sits in one point).
    """
    nan = math.nan
    if x.size == 0:
        return 0.0, nan, nan, 0.0, 0.0, 0.0
    total, mx, my, negative = moments(x, y, loads, x[0], y[0])
    if negative > 0.0 or not math.isfinite(total + mx + my) or total > LARGEST or 0.0 < total < SMALLEST:
        return nan, nan, nan, 0.0, 0.0, 0.0
    if total == 0.0:
        return 0.0, nan, nan, 0.0, 0.0, 0.0
    size = math.hypot(fx, fy)
    ct, st = (fx / size, fy / size) if size > 0.0 else (1.0, 0.0)
    cx, cy = x[0] + mx / total, y[0] + my / total
    _, mx, my, _ = moments(x, y, loads, cx, cy)
    ex, ey = mx / total, my / total
    mean, blocks = place(x, y, loads, cx, cy, ex, ey, ct, st, 1.0 / total, taxels)
    if blocks == 0.0:
        return total, cx, cy, ex, ey, 0.0
    if not SMALLEST < mean < LARGEST:
        return nan, nan, nan, 0.0, 0.0, 0.0
    inverse = 1.0 / mean
    for i in range(x.size):
        taxels[0, i] *= inverse
        taxels[1, i] *= inverse
    return total, cx, cy, ex, ey, mean


@compiled
def product_error(a: float, b: float, p: float) -> float:
    """What the rounded product p lacks to a b, exactly (Dekker)."""
    t = SPLIT * a
    ah = t - (t - a)
    t = SPLIT * b
    bh = t - (t - b)
    al, bl = a - ah, b - bh
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl


@compiled
def sum_error(a: float, b: float, s: float) -> float:
    """What the rounded sum s lacks to a + b, exactly (Knuth)."""
    t = s - a
    return (a - (s - t)) + (b - t)


@compiled
def one_minus_rho(loads: Array, mu: float, fx: float, fy: float) -> float:
    """1 − |f| / (μ Σ F) with the sums and products in double-double, as (W² − f²) / (W (W + |f|))."""
    high = low = 0.0
    for i in range(loads.size):
        s = high + loads[i]
        low += sum_error(high, loads[i], s)
        high = s
    p = mu * high
    tail = product_error(mu, high, p) + mu * low
    w = p + tail
    tail -= w - p
    a, b, c = w * w, fx * fx, fy * fy
    errors = product_error(w, w, a) + 2.0 * w * tail - product_error(fx, fx, b) - product_error(fy, fy, c)
    d = a - b
    e = d - c
    errors += sum_error(a, -b, d) + sum_error(d, -c, e)
    return (e + errors) / (w * (w + math.sqrt(b + c)))


@compiled
def slack_of_room(loads: Array, mu: float, fx: float, fy: float, grip: float) -> tuple[float, float]:
    """1 − ρ and a bound of its error: in plain sums, or in double-double where it is small."""
    h = 1.0 - math.hypot(fx, fy) / grip
    if h >= NEAR_TRANSLATION:
        return h, (loads.size + 4) * U
    spread = (loads.size + 16) * U
    h = one_minus_rho(loads, mu, fx, fy)
    return h, 16.0 * U * abs(h) + 4.0 * spread * spread


@compiled
def disc_lean(rho: float) -> float:
    """How much farther than that of the ellipsoid, ρ/√(1 − ρ²), the pole of a uniform disc lies: 3/2 at 0, 3/4 at 1.

    A start within some 15 % for most contacts.
    """
    return 1.5 - 0.75 * rho * rho


@compiled
def solve_torque_limit(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, ax: float, ay: float, sense: int, gap: float,
    passes: int,
) -> tuple[int, float, float, float, float, float]:  # fmt: skip
    """Kind, torque, lower and upper bound about (ax, ay), pole (2)."""
    return torque_limit_in(np.empty((3, x.size)), x, y, loads, mu, fx, fy, ax, ay, sense, gap, passes)


@compiled
def torque_limit_in(
    taxels: Array, x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, ax: float, ay: float, sense: int,
    gap: float, passes: int,
) -> tuple[int, float, float, float, float, float]:  # fmt: skip
    """The same with working memory (3, n)."""
    nan = math.nan
    total, cx, cy, ex, ey, mean = normalise(x, y, loads, sense * fx, sense * fy, taxels)
    if not total > 0.0 or not math.isfinite(fx + fy + ax + ay):
        return NONE, nan, nan, nan, nan, nan
    grip, force = mu * total, math.hypot(fx, fy)
    dx, dy = (ax - cx) - ex, (ay - cy) - ey
    shift = -sense * (dx * fy - dy * fx)  # m about a = m about c − (a − c) × f
    slack = (8.0 * U * (abs(dx) + abs(dy)) + (x.size + 16) * U * mean) * force
    h, dh = slack_of_room(loads, mu, fx, fy, grip)
    if h < 0.0:
        return TRANSLATING, nan, nan, nan, nan, nan
    if h == 0.0:
        return TRANSLATING, shift, shift - slack, shift + slack, nan, nan
    if mean == 0.0:
        return HINGE, shift, shift - slack, shift + slack, cx + ex, cy + ey
    q = np.empty(3)
    q[0], q[1], q[2] = disc_lean(1.0 - h) * (1.0 - h) / math.sqrt(h * (2.0 - h)), 0.0, 1.0
    ct, st = (sense * fx / force, sense * fy / force) if force > 0.0 else (1.0, 0.0)
    lower, upper, value, hinge, _ = minimise(x, y, (ct, st, mean), taxels, q, (h, dh, 1.0, 0.0, False), gap, passes)
    unit = grip * mean
    lower, upper = unit * lower + shift, unit * upper + shift
    slack += 8.0 * U * (abs(lower) + abs(upper))
    if hinge >= 0:
        return HINGE, unit * value + shift, lower - slack, upper + slack, x[hinge], y[hinge]
    # Sense −1 is solved with the force reversed: the same pole.
    px, py = cx + (ex - mean * (ct * q[1] + st * q[0])), cy + (ey + mean * (ct * q[0] - st * q[1]))
    return INTERIOR, unit * value + shift, lower - slack, upper + slack, px, py


@compiled
def unit_gauge(
    taxels: Array, x: Array, y: Array, frame: Frame, q: Array, f: float, s: float, gap: float, passes: int
) -> tuple[float, float, float, int]:
    """Gauge of the load (f, 0, s) in the units above.

    Args:
        taxels: As in :func:`minimise`.
        x: Likewise.
        y: Likewise.
        frame: Likewise.
        q: A twist to start from, shape (3,), not a number where there is none; on return the optimal one.
        f: Force.
        s: Spin.
        gap: As in :func:`minimise`.
        passes: Likewise.

    Returns:
        Lower bound, upper bound, value, the taxel that is a hinge (−1: none).
    """
    size = math.hypot(f, s)
    lx, lm = f / size, s / size
    power, length = lx * q[0] + lm * q[2], abs(q[0]) + abs(q[1]) + abs(q[2])
    if 0.0 < length <= ASKEW * power < math.inf:  # false where there is no number
        q[0], q[1], q[2] = q[0] / power, q[1] / power, q[2] / power
    else:
        lean = disc_lean(lx)
        power = lean * lx * lx + lm * lm
        q[0], q[1], q[2] = lean * lx / power, 0.0, lm / power
    lower, upper, value, hinge, _ = minimise(x, y, frame, taxels, q, (1.0, 0.0, -lm, lx, True), gap, passes)
    return size * lower * (1.0 - 8.0 * U), size * upper * (1.0 + 8.0 * U), size * value, hinge


@compiled
def solve_utilisation(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, m: float, ax: float, ay: float, start: Twist,
    gap: float, passes: int,
) -> tuple[int, float, float, float, float, float, float, float, float]:  # fmt: skip
    """Kind, value, lower and upper bound, pole (2), twist (3) about (ax, ay)."""
    return utilisation_in(np.empty((3, x.size)), x, y, loads, mu, fx, fy, m, ax, ay, start, gap, passes)


@compiled
def utilisation_in(
    taxels: Array, x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, m: float, ax: float, ay: float,
    start: Twist, gap: float, passes: int,
) -> tuple[int, float, float, float, float, float, float, float, float]:  # fmt: skip
    """The same with working memory (3, n)."""
    nan = math.nan
    total, cx, cy, ex, ey, mean = normalise(x, y, loads, fx, fy, taxels)
    if math.isnan(total) or not math.isfinite(fx + fy + m + ax + ay):
        return NONE, nan, nan, nan, nan, nan, nan, nan, nan
    force = math.hypot(fx, fy)
    if force == 0.0 and m == 0.0:
        return NONE, 0.0, 0.0, 0.0, nan, nan, nan, nan, nan
    if total == 0.0:
        return NONE, math.inf, math.inf, math.inf, nan, nan, nan, nan, nan
    grip = mu * total
    ct, st = (fx / force, fy / force) if force > 0.0 else (1.0, 0.0)
    dx, dy = (ax - cx) - ex, (ay - cy) - ey
    spin = m + (dx * fy - dy * fx)  # about the load centroid
    if mean == 0.0:
        if spin != 0.0:
            turn = math.copysign(1.0, spin)
            return HINGE, math.inf, math.inf, math.inf, cx + ex, cy + ey, -turn * dy, turn * dx, turn
        ratio = force / grip
        return TRANSLATING, ratio, ratio * (1.0 - 8.0 * U), ratio * (1.0 + 8.0 * U), nan, nan, ct, st, 0.0
    q = np.empty(3)
    vx, vy = (start[0] + start[2] * dy) / mean, (start[1] - start[2] * dx) / mean  # of the load centroid
    q[0], q[1], q[2] = ct * vx + st * vy, ct * vy - st * vx, start[2]
    lower, upper, value, hinge = unit_gauge(
        taxels, x, y, (ct, st, mean), q, force / grip, spin / (grip * mean), gap, passes
    )
    # What rounding adds to the spin, turning about the load centroid carries, with twice the friction at most.
    slack = 16.0 * U * ((abs(dx) + abs(dy)) * force + abs(m)) / (grip * mean) + 2.0 * (x.size + 16) * U * force / grip
    lower, upper = max(lower - slack, 0.0), upper + slack
    vx, vy, om = mean * (ct * q[0] - st * q[1]), mean * (st * q[0] + ct * q[1]), q[2]  # of the load centroid
    ux, uy = vx - om * dy, vy + om * dx
    if abs(om) * FAR <= math.sqrt(q[0] ** 2 + q[1] ** 2):
        return TRANSLATING, value, lower, upper, nan, nan, ux, uy, om
    if hinge >= 0:
        return HINGE, value, lower, upper, x[hinge], y[hinge], ux, uy, om
    return INTERIOR, value, lower, upper, cx + (ex - vy / om), cy + (ey + vx / om), ux, uy, om


@compiled
def follow_utilisation(
    x: Array, y: Array, shares: Array, mu: float, contacts: Array, start: Twist, gap: float, passes: int
) -> Array:
    """`solve_utilisation` for the readings of one read, each started from the one before, shape (n, 9).

    The shares are those of 1 N; the last number of a contact is 2 where it touches, 0 where it says nothing. Without
    contact a row is NaN, and what comes next starts anew.
    """
    taxels = np.empty((3, x.size))
    out = np.empty((len(contacts), 9))
    none = (math.nan, math.nan, math.nan)
    for k in range(len(contacts)):
        if contacts[k, 10] != 2:
            out[k] = math.nan
            if contacts[k, 10] != 0:
                start = none
            continue
        cx, cy, normal, fx, fy, spin = (
            contacts[k, 0], contacts[k, 1], contacts[k, 4], contacts[k, 5], contacts[k, 6], contacts[k, 7]
        )  # fmt: skip
        kind, value, lower, upper, px, py, vx, vy, om = utilisation_in(
            taxels, x, y, shares, mu, fx / normal, fy / normal, spin / normal, cx, cy, start, gap, passes
        )
        start = (vx, vy, om)
        out[k] = np.array((float(kind), value, lower, upper, px, py, vx, vy, om))
    return out


@compiled
def grown_gauge(taxels: Array, x: Array, y: Array, frame: Frame, f: float, s: float, growth: float) -> float:
    """The k with which gauge(f, s / k^growth) = k: Newton on log k, bracketed, each solve from the twist of the last.

    The slope of log gauge is the share of the power that the spin takes, times −growth.
    """
    q = np.full(3, math.nan)
    low, high, log_k, upper = -math.inf, math.inf, 0.0, 0.0
    for _ in range(MAX_ROOT_STEPS):
        spin = s * math.exp(-growth * log_k)
        _, upper, value, _ = unit_gauge(taxels, x, y, frame, q, f, spin, GOAL, MAX_PASSES)
        if growth == 0.0:
            return upper
        missing = math.log(value) - log_k
        if abs(missing) <= ROOT or not high - low > ROOT:
            break
        if missing > 0.0:
            low = log_k
        else:
            high = log_k
        share = spin * q[2] / math.hypot(f, spin)  # ℓ·q = 1
        step = log_k + missing / (1.0 + growth * share)
        if not low < step < high:
            step = 0.5 * (low + high) if math.isfinite(high - low) else log_k + math.copysign(1.0, missing)
        log_k = step
    return max(upper, math.exp(log_k))


@compiled
def solve_grip_factor(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, m: float, ax: float, ay: float, growth: float
) -> float:
    """The least factor k on all loads that holds the load where the contact grows by k^growth about its centroid."""
    taxels = np.empty((3, x.size))
    total, cx, cy, ex, ey, mean = normalise(x, y, loads, fx, fy, taxels)
    if math.isnan(total) or not math.isfinite(fx + fy + m + ax + ay):
        return math.nan
    force = math.hypot(fx, fy)
    if force == 0.0 and m == 0.0:
        return 0.0
    if total == 0.0:
        return math.inf
    grip = mu * total
    spin = m + (((ax - cx) - ex) * fy - ((ay - cy) - ey) * fx)
    if mean == 0.0:  # a point has no size that could grow
        return force / grip if spin == 0.0 else math.inf
    ct, st = (fx / force, fy / force) if force > 0.0 else (1.0, 0.0)
    return grown_gauge(taxels, x, y, (ct, st, mean), force / grip, spin / (grip * mean), growth)


@compiled
def solve_torque_limits(
    x: Array, y: Array, loads: Array, mu: float, tangential: Array, about: Array, sense: int, gap: float, passes: int,
    kinds: Indices, out: Array,
) -> None:  # fmt: skip
    """Writes :func:`solve_torque_limit` of every frame into kinds (frames,) and out (frames, 5).

    Args:
        x: Shape (frames, n), or (1, n) for all.
        y: Likewise.
        loads: Shape (frames, n).
        mu: Coefficient of friction.
        tangential: Shape (frames, 2).
        about: Shape (frames, 2), or (1, 2) for all.
        sense: ±1.
        gap: As in :func:`minimise`.
        passes: Likewise.
        kinds: Indices of KINDS, shape (frames,).
        out: Torque, lower and upper bound, pole (2).
    """
    memory, active = np.empty(3 * x.shape[1]), np.empty((3, x.shape[1]))
    for i in range(loads.shape[0]):
        k, a = min(i, x.shape[0] - 1), min(i, about.shape[0] - 1)
        n = gather(x[k], y[k], loads[i], active)
        kinds[i], out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = torque_limit_in(
            memory[: 3 * n].reshape((3, n)), active[0][:n], active[1][:n], active[2][:n], mu, tangential[i, 0],
            tangential[i, 1], about[a, 0], about[a, 1], sense, gap, passes,
        )  # fmt: skip


@compiled
def solve_utilisations(
    x: Array, y: Array, loads: Array, mu: float, tangential: Array, spin: Array, about: Array, gap: float, passes: int,
    kinds: Indices, out: Array,
) -> None:  # fmt: skip
    """Writes :func:`solve_utilisation` of every frame, started from the one before, into kinds and out (frames, 8)."""
    memory, active = np.empty(3 * x.shape[1]), np.empty((3, x.shape[1]))
    start = (math.nan, math.nan, math.nan)
    for i in range(loads.shape[0]):
        k, a = min(i, x.shape[0] - 1), min(i, about.shape[0] - 1)
        n = gather(x[k], y[k], loads[i], active)
        found = utilisation_in(
            memory[: 3 * n].reshape((3, n)), active[0][:n], active[1][:n], active[2][:n], mu, tangential[i, 0],
            tangential[i, 1], spin[i], about[a, 0], about[a, 1], start, gap, passes,
        )  # fmt: skip
        start = found[6], found[7], found[8]
        kinds[i], out[i, 0], out[i, 1], out[i, 2], out[i, 3] = found[0], found[1], found[2], found[3], found[4]
        out[i, 4], out[i, 5], out[i, 6], out[i, 7] = found[5], found[6], found[7], found[8]


@compiled
def gather(x: Array, y: Array, loads: Array, active: Array) -> int:
    """Writes the taxels whose load is not zero into active (3, n); returns how many: the rest is not in contact."""
    n = 0
    for i in range(x.size):
        active[0, n], active[1, n], active[2, n] = x[i], y[i], loads[i]
        n += loads[i] != 0.0
    return n
