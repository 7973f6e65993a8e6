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
not used anywhere.

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
  Σ w |u_y|/|u| ≤ √(2 g) (Cauchy) the sum errs by σ (Σ w c + |(1 − ρ) v_x| + |v| (g + √(2 g)) + |ω|) at most.
* A friction field is what was computed, so errors of u_i do not count; only those of its sums do: σ g and σ √(2 g) for
  the force, 2 σ for the spin, and it leaves its discs by 10 u c/|u| at most.
* 1 − ρ carries a bound of its own (:func:`slack_of_room`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled, compiled_sum

Array = NDArray[np.float64]
Sweep = tuple[float, float, float, float, float, float, float, float, float, float, float, float]

U = 2.0**-53
KINDS = ("interior", "hinge", "translating", "none")
INTERIOR, HINGE, TRANSLATING, NONE = range(4)
FAR = 1e9  # a pole this many mean distances away is a translation for every purpose
GOAL = 2e-13  # gap at which an answer is as good as its rounding bound,
GOAL_SLACKS = 8.0  # which is about so many σ
MAX_PASSES = 60  # ordinary scenes need 3–6; a gap that stays open is told by the bounds
MAX_ROOT_STEPS = 60
MAX_HALVINGS = 50  # 2⁻⁵⁰ of a step is below its rounding
RESOLUTION = 1e-13  # relative change of the sum that may be rounding
TINY = 1e-150  # added to lengths that are divided by: a taxel at the pole has no direction; squares stay finite
RIDGE = 1e-28  # least curvature of any direction, relative to the largest: a far pole leaves one with very little
FLAT = 1e-9  # a determinant this small, relative to the product of the curvatures, is rounding (collinear taxels),
STIFF = 1e-12  # and is helped with so much of their sum
LONGEST = 8.0  # a step changes the velocity by no more than so many times what it was
KINK = 0.02  # share of the squared curvatures from which one taxel may be a kink,
FELT = 0.25  # and share of its sliding velocity by which the step must change it to feel that
NEAR_TRANSLATION = 0.02  # below this, 1 − ρ is computed in double-double
ASKEW = 20.0  # a twist from before whose power is less than its size by this factor tells nothing of this load
SPLIT = 134217729.0  # 2²⁷ + 1 (Dekker)


@compiled_sum
def sweep(x: Array, y: Array, w: Array, vx: float, vy: float, om: float, skip: int) -> Sweep:
    """One pass over the taxels: everything a step and both bounds need.

    Args:
        x: Positions, shape (n,), in the units above.
        y: Likewise.
        w: Weights, shape (n,).
        vx: Twist.
        vy: Likewise.
        om: Likewise.
        skip: Taxels that lie where this one lies are left out; −1: none is.

    Returns:
        Σ w c, Σ w c/|u|, Σ w u_y/|u|, spin of the friction field (with Σ w y of the taxels left out missing); Hessian
        xx, xy, xω, yy, yω, ωω; Σ (w/|u|)²; the weight left out.
    """
    value = gx = gy = gm = 0.0
    hxx = hxy = hxm = hyy = hym = hmm = bend = out = 0.0
    xj = x[skip] if skip >= 0 else math.nan
    yj = y[skip] if skip >= 0 else math.nan
    for i in range(x.size):
        wi = 0.0 if (x[i] == xj and y[i] == yj) else w[i]
        out += w[i] - wi
        ux, uy = vx - om * y[i], vy + om * x[i]
        d = math.sqrt(ux * ux + uy * uy)
        inverse = 1.0 / (d + TINY)
        beside = uy * uy / (d + abs(ux) + TINY)
        c = beside if ux > 0.0 else d - ux
        nx, ny, k, share = ux * inverse, uy * inverse, wi * inverse, c * inverse
        value += wi * c
        gx += wi * share
        gy += wi * ny
        gm += wi * (x[i] * ny + y[i] * share)
        arm = x[i] * nx + y[i] * ny  # ρ × t with t = ẑ × n
        hxx += k * ny * ny
        hxy -= k * nx * ny
        hyy += k * nx * nx
        hxm -= k * ny * arm
        hym += k * nx * arm
        hmm += k * arm * arm
        bend += k * k
    return value, gx, gy, gm, hxx, hxy, hxm, hyy, hym, hmm, bend, out


@compiled
def sharpest(x: Array, y: Array, w: Array, vx: float, vy: float, om: float) -> int:
    """The taxel with the largest w / |u|, whose norm bends most."""
    best, j = -1.0, 0
    for i in range(x.size):
        ux, uy = vx - om * y[i], vy + om * x[i]
        bend = w[i] / (math.sqrt(ux * ux + uy * uy) + TINY)
        if bend > best:
            best, j = bend, i
    return j


@compiled
def proximal(g1: float, g2: float, a: float, b: float, c: float, w: float) -> tuple[float, float]:
    """Minimises w|z| + g·z + ½ zᵀ[[a, b], [b, c]]z over the plane: zero exactly when |g| ≤ w (the hinge)."""
    if g1 * g1 + g2 * g2 <= w * w:
        return 0.0, 0.0
    half, diff = 0.5 * (a + c), 0.5 * (a - c)
    radius = math.sqrt(diff * diff + b * b)
    h1 = half + radius
    h2 = max((a * c - b * b) / h1, RIDGE * h1)
    theta = 0.5 * math.atan2(b, diff)
    ct, st = math.cos(theta), math.sin(theta)
    p1, p2 = ct * g1 + st * g2, -st * g1 + ct * g2
    s = 0.0  # s = |z| solves |(s H + w)⁻¹ g| = 1; 1/norm is nearly linear in s, so Newton takes a few steps
    for _ in range(MAX_ROOT_STEPS):
        d1, d2 = s * h1 + w, s * h2 + w
        square = (p1 / d1) ** 2 + (p2 / d2) ** 2
        norm = math.sqrt(square)
        fall = (p1 / d1) ** 2 * h1 / d1 + (p2 / d2) ** 2 * h2 / d2
        step = (norm - 1.0) * square / fall
        s += step
        if not abs(step) > 1e-15 * s:
            break
    z1, z2 = -s * p1 / (s * h1 + w), -s * p2 / (s * h2 + w)
    return ct * z1 - st * z2, st * z1 + ct * z2


@compiled
def plane_model(r: Sweep, h: float, ax: float, am: float) -> tuple[float, float, float, float, float]:
    """Gradient (2) and Hessian (11, 12, 22) along the plane's directions (ax, 0, am) and (0, 1, 0)."""
    h11 = ax * ax * r[4] + 2.0 * ax * am * r[6] + am * am * r[9]
    h22 = r[7]
    ridge = RIDGE * (h11 + h22) + 1e-300  # collinear taxels leave a direction without curvature
    return ax * (h - r[1]) + am * r[3], r[2], h11 + ridge, ax * r[5] + am * r[8], h22 + ridge


@compiled
def smooth_step(
    m: tuple[float, float, float, float, float], power: float, pull: float
) -> tuple[float, float, float, bool]:
    """The step to the minimum of √Q − pull · s₁, Q the square that meets D to second order.

    D is a norm, and so is √Q; that a quadratic is not makes the plain Newton step overshoot. With e the gradient, H the
    Hessian, b = (pull, 0) and B, E, F = bᵀH⁻¹b, bᵀH⁻¹e, eᵀH⁻¹e, each over D, the minimum is at
    z (−H⁻¹e + s H⁻¹b), (1 − B) s² + 2 (1 + E) s = F and 1/z = 1 + E + F − (B + E) s.

    Args:
        m: Gradient and Hessian.
        power: D here.
        pull: Slope that is subtracted along the first direction.

    Returns:
        The step (2), the fall of its linear part, and whether the model bends in every direction.
    """
    g1, g2, h11, h12, h22 = m
    bends = h11 * h22 - h12 * h12 > FLAT * h11 * h22
    if not bends:
        h11, h22 = h11 + STIFF * (h11 + h22), h22 + STIFF * (h11 + h22)
    det = h11 * h22 - h12 * h12
    s1, s2 = -(h22 * g1 - h12 * g2) / det, -(h11 * g2 - h12 * g1) / det
    fall = abs(g1 * s1 + g2 * s2)
    k1, k2 = h22 * pull / det, -h12 * pull / det
    bb, be, ee = pull * k1 / power, -pull * s1 / power, fall / power
    square = (1.0 + be) * (1.0 + be) + (1.0 - bb) * ee
    if square > 0.0 and be > -1.0:
        s = ee / ((1.0 + be) + math.sqrt(square))
        inverse = 1.0 + be + ee - (bb + be) * s
        if inverse > 0.0:
            return (s1 + s * k1) / inverse, (s2 + s * k2) / inverse, fall, bends
    return s1, s2, fall, bends


@compiled
def kink_step(
    m: tuple[float, float, float, float, float], det: float, lever: float, wj: float, ux: float, uy: float
) -> tuple[float, float, float]:
    """The step that minimises the model plus w_j |u_j|, and its first-order fall.

    Args:
        m: Model without taxel j.
        det: Change of u_jx along the first direction; u_jy changes by ``lever`` along it, and by 1 along the second.
        lever: Likewise.
        wj: Weight of taxel j.
        ux: u_j here.
        uy: Likewise.
    """
    g1, g2, h11, h12, h22 = m
    g1 -= wj * det  # the sum counts |u| less u_x
    i, k = 1.0 / det, -lever / det  # step = (i dz_x, k dz_x + dz_y)
    a = i * (h11 * i + h12 * k) + k * (h12 * i + h22 * k)
    b = i * h12 + k * h22
    c1 = i * g1 + k * g2 - (a * ux + b * uy)
    c2 = g2 - (b * ux + h22 * uy)
    z1, z2 = proximal(c1, c2, a, b, h22, wj)
    s1, s2 = i * (z1 - ux), k * (z1 - ux) + (z2 - uy)
    fall = abs(g1 * s1 + g2 * s2 + wj * (math.sqrt(z1 * z1 + z2 * z2) - math.sqrt(ux * ux + uy * uy)))
    return s1, s2, fall


@compiled
def hinged(r: Sweep, xj: float, yj: float, tx: float, ty: float) -> tuple[float, float, float, bool]:
    """The field of the sweep with (tx, ty) w_j on taxel j, shortened to w_j.

    Returns:
        1 − f'_x, f'_y and the spin of the field, and whether it was not shortened.
    """
    out = r[11]
    size = math.sqrt(tx * tx + ty * ty)
    whole = size <= 1.0
    if not whole:
        tx, ty = tx / size, ty / size
    return r[1] + out * (1.0 - tx), r[2] + out * ty, r[3] + out * (yj + xj * ty - yj * tx), whole


@compiled
def spin_upper(r: Sweep, vx: float, vy: float, h: float, dh: float, slack: float) -> float:
    """Bound of max Σ ρ × t with Σ t = (1 − h, 0) and |t_i| ≤ w_i: the sum at any twist (v, 1)."""
    far = (abs(vx) + abs(vy)) * (r[1] + math.sqrt(2.0 * r[1]))
    return (r[0] + h * vx) + slack * (r[0] + abs(h * vx) + far + 3.0) + dh * abs(vx)


@compiled
def spin_lower(gx: float, gy: float, gm: float, h: float, dh: float, slack: float) -> float:
    """Bound of the same from the friction field that carries f' = (1 − g_x, g_y) and the spin g_m.

    The mixture (1 − s) t + s w a with the translation field of a unit vector a carries f exactly for the smallest s
    with |f − (1 − s) f'| ≤ s, and translation adds no spin about the load centroid. With e = |f − f'| and
    r² = 1 − |f'|² that s is at most e (1 + √(1 + r²)) / r².
    """
    missing = math.sqrt((gx - h) ** 2 + gy * gy) + slack * (gx + math.sqrt(2.0 * gx) + h) + dh
    room = gx * (2.0 - gx) - gy * gy - 4.0 * slack * gx
    share = min(missing * (1.0 + math.sqrt(1.0 + room)) / room, 1.0) if room > 0.0 else 1.0
    return (1.0 - share) * gm - 5.0 * slack


@compiled
def gauge_lower(r: Sweep, vx: float, om: float, lx: float, lm: float, slack: float) -> float:
    """Bound of the gauge of the unit load ℓ = (lx, 0, lm): ℓ·q / D(q) at any twist."""
    return (lx * vx + lm * om) / (r[0] + vx) * (1.0 - 12.0 * slack)


@compiled
def gauge_upper(gx: float, gy: float, gm: float, lx: float, lm: float, slack: float) -> float:
    """Bound of the same from the friction field that carries the wrench G = (g_x, g_y, g_m).

    What G lacks to (G·ℓ) ℓ, a force a and a spin b, is carried by turning about the load centroid (spin 1, force 1 at
    most) and translation: the sum leaves its discs by |a| + 2 |b| at most.
    """
    along = gx * lx + gm * lm - 4.0 * slack
    if not along > 0.0:
        return math.inf
    a = math.sqrt((along * lx - gx) ** 2 + gy * gy)
    return (1.0 + a + 2.0 * abs(along * lm - gm) + 12.0 * slack) / along * (1.0 + 8.0 * U)


@compiled
def bound_spin(
    r: Sweep, rj: Sweep, xj: float, yj: float, vx: float, vy: float, h: float, dh: float, slack: float, kink: bool
) -> tuple[float, float, bool]:
    """Both bounds of the spin, and whether taxel j takes what is missing, as a hinge does."""
    upper = spin_upper(r, vx, vy, h, dh, slack)
    lower = spin_lower(r[1], r[2], r[3], h, dh, slack)
    if not kink:
        return lower, upper, False
    gx, gy, gm, whole = hinged(rj, xj, yj, 1.0 + (rj[1] - h) / rj[11], -rj[2] / rj[11])
    return max(lower, spin_lower(gx, gy, gm, h, dh, slack)), upper, whole


@compiled
def bound_gauge(
    r: Sweep, rj: Sweep, xj: float, yj: float, vx: float, om: float, lx: float, lm: float, slack: float, kink: bool
) -> tuple[float, float, bool]:
    """Both bounds of the gauge, and whether taxel j makes the wrench one along ℓ, as a hinge does."""
    lower = gauge_lower(r, vx, om, lx, lm, slack)
    upper = gauge_upper(1.0 - r[1], r[2], r[3], lx, lm, slack)
    if not kink:
        return lower, upper, False
    out = rj[11]
    ox, oy, om_ = (1.0 - out) - rj[1], rj[2], rj[3] + out * yj
    along = (om_ - xj * oy + yj * ox) / (lm + yj * lx)
    gx, gy, gm, whole = hinged(rj, xj, yj, (along * lx - ox) / out, -oy / out)
    return lower, min(upper, gauge_upper(1.0 - gx, gy, gm, lx, lm, slack)), whole


@compiled
def minimise(
    x: Array, y: Array, w: Array, q: Array, h: float, dh: float, ax: float, am: float, gauge: bool, passes: int
) -> tuple[float, float, float, bool, int]:
    """Minimises Σ w c(q) + h v_x over q + span{(ax, 0, am), (0, 1, 0)} until its bounds meet.

    Newton's method; the taxel whose norm bends most enters each step as the norm it is, so that a step lands on a
    hinge, or leaves it, with no special case. A line search makes every step a descent, and the sum is convex: it
    converges from anywhere. One sweep a pass, a second where a kink matters.

    Args:
        x: Positions, shape (n,), in the units above.
        y: Likewise.
        w: Weights, shape (n,).
        q: The twist to start from, shape (3,); holds the last one on return.
        h: 1 − ρ for the spin, 1 for the gauge.
        dh: Bound of its error.
        ax: First direction of the plane.
        am: Likewise.
        gauge: Bound the gauge of (am, 0, −ax), else the largest spin.
        passes: Most passes.

    Returns:
        Lower bound, upper bound, the sum at the last twist (gauge: ℓ·q / D), whether a taxel is a hinge, passes.
    """
    slack = (x.size + 16) * U
    goal = max(GOAL, GOAL_SLACKS * slack)
    best_lower, best_upper = -math.inf, math.inf
    hinge = False
    r = sweep(x, y, w, q[0], q[1], q[2], -1)
    value = r[0] + h * q[0]
    last_fall = math.inf
    done = 1
    while True:
        s1, s2, fall, bends = smooth_step(plane_model(r, h, ax, am), r[0] + q[0], (1.0 - h) * ax)
        rj, j, kink, ux, uy = r, 0, False, 0.0, 0.0
        curvature = r[4] + r[7]  # Σ w/|u|
        if r[10] > KINK * curvature * curvature:
            j = sharpest(x, y, w, q[0], q[1], q[2])
            det, lever = ax - am * y[j], am * x[j]
            ux, uy = q[0] - q[2] * y[j], q[1] + q[2] * x[j]
            felt = not bends or abs(det * s1) + abs(lever * s1 + s2) > FELT * (abs(ux) + abs(uy))
            # Where no twist of this plane stops taxel j alone, its norm is as smooth as any other.
            kink = felt and abs(det) > 1e-5 * (abs(ax) + abs(am * y[j]))
            if kink:
                rj = sweep(x, y, w, q[0], q[1], q[2], j)
                s1, s2, fall = kink_step(plane_model(rj, h, ax, am), det, lever, rj[11], ux, uy)
        if gauge:
            lower, upper, takes = bound_gauge(r, rj, x[j], y[j], q[0], q[2], am, -ax, slack, kink)
        else:
            lower, upper, takes = bound_spin(r, rj, x[j], y[j], q[0], q[1], h, dh, slack, kink)
        hinge = takes and abs(ux) + abs(uy) <= 1e-12 * (abs(q[0]) + abs(q[1]) + abs(q[2]))
        best_lower, best_upper = max(best_lower, lower), min(best_upper, upper)
        if best_upper - best_lower <= goal * (best_upper if gauge else 1.0) or done >= passes:
            break
        room = LONGEST * (abs(q[0]) + abs(q[1]) + abs(q[2]))
        length = abs(s1) + abs(s2)
        if length > room:
            s1, s2 = s1 * (room / length), s2 * (room / length)
        shrink = 1.0
        moved = False
        for _ in range(MAX_HALVINGS):
            vx, vy, om = q[0] + shrink * s1 * ax, q[1] + shrink * s2, q[2] + shrink * s1 * am
            r = sweep(x, y, w, vx, vy, om, -1)
            done += 1
            next_value = r[0] + h * vx
            # Where the sum no longer resolves a descent, the gradient still does: a full step that shrinks it is good.
            moved = next_value < value or (
                shrink == 1.0 and next_value - value <= RESOLUTION * abs(value) and fall < 0.25 * last_fall
            )
            if moved:
                break
            shrink *= 0.5
        if not moved:
            break
        q[0], q[1], q[2] = vx, vy, om
        value, last_fall = next_value, fall
    estimate = (am * q[0] - ax * q[2]) / (value + (1.0 - h) * q[0]) if gauge else value
    return best_lower, best_upper, min(max(estimate, best_lower), best_upper), hinge, done


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
) -> float:  # fmt: skip
    """Writes positions about c + e, turned by −(ct, st), and weights into taxels (3, n); returns Σ w |ρ|."""
    mean = 0.0
    for i in range(x.size):
        dx, dy, w = (x[i] - cx) - ex, (y[i] - cy) - ey, loads[i] * scale
        taxels[0, i], taxels[1, i], taxels[2, i] = ct * dx + st * dy, ct * dy - st * dx, w
        mean += w * math.sqrt(dx * dx + dy * dy)
    return mean


@compiled
def normalise(
    x: Array, y: Array, loads: Array, fx: float, fy: float, taxels: Array
) -> tuple[float, float, float, float, float, float]:
    """Brings a contact into the units above, the force (fx, fy) along +x.

    The centroid is told as a point and what it lacks, so that the lever of a small contact far from the origin, or of
    one heavy taxel among light ones, is exact to the contact's own size.

    Returns:
        Σ F (NaN: a value is not finite or a load is negative), the point (2), what it lacks (2), and the mean distance
        (0: all load sits in one point).
    """
    nan = math.nan
    if x.size == 0:
        return 0.0, nan, nan, 0.0, 0.0, 0.0
    total, mx, my, negative = moments(x, y, loads, x[0], y[0])
    if negative > 0.0 or not math.isfinite(total + mx + my):
        return nan, nan, nan, 0.0, 0.0, 0.0
    if total == 0.0:
        return 0.0, nan, nan, 0.0, 0.0, 0.0
    size = math.hypot(fx, fy)
    ct, st = (fx / size, fy / size) if size > 0.0 else (1.0, 0.0)
    cx, cy = x[0] + mx / total, y[0] + my / total
    _, mx, my, _ = moments(x, y, loads, cx, cy)
    ex, ey = mx / total, my / total
    mean = place(x, y, loads, cx, cy, ex, ey, ct, st, 1.0 / total, taxels)
    inverse = 1.0 / mean
    if not math.isfinite(inverse):
        return total, cx, cy, ex, ey, 0.0
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
def solve_torque_limit(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, ax: float, ay: float, sense: int, passes: int
) -> tuple[int, float, float, float, float, float]:
    """Kind, torque, lower and upper bound about (ax, ay), pole (2)."""
    nan = math.nan
    taxels = np.empty((3, x.size))
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
    q = np.empty(3)  # start from the pole of the ellipsoid
    q[0], q[1], q[2] = (1.0 - h) / math.sqrt(h * (2.0 - h)), 0.0, 1.0
    lower, upper, value, hinge, _ = minimise(taxels[0], taxels[1], taxels[2], q, h, dh, 1.0, 0.0, False, passes)
    unit = grip * mean
    ct, st = (sense * fx / force, sense * fy / force) if force > 0.0 else (1.0, 0.0)
    # Sense −1 is solved with the force reversed: the same pole.
    px, py = cx + (ex - mean * (ct * q[1] + st * q[0])), cy + (ey + mean * (ct * q[0] - st * q[1]))
    lower, upper = unit * lower + shift, unit * upper + shift
    slack += 8.0 * U * (abs(lower) + abs(upper))
    return (HINGE if hinge else INTERIOR), unit * value + shift, lower - slack, upper + slack, px, py


@compiled
def first_twist(
    q: Array, start: tuple[float, float, float], dx: float, dy: float, ct: float, st: float, mean: float, lx: float,
    lm: float,
) -> None:  # fmt: skip
    """Writes the twist to start from: that of before, scaled to ℓ·q = 1, or the outward normal of the ellipsoid."""
    vx, vy, om = start
    vx, vy = vx + om * dy, vy - om * dx  # of the load centroid
    vx, vy = (ct * vx + st * vy) / mean, (ct * vy - st * vx) / mean
    power = lx * vx + lm * om
    if power * ASKEW >= abs(vx) + abs(vy) + abs(om):  # false where it is not a number
        q[0], q[1], q[2] = vx / power, vy / power, om / power
    else:
        q[0], q[1], q[2] = lx, 0.0, lm


@compiled
def solve_utilisation(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, m: float, ax: float, ay: float,
    start: tuple[float, float, float], passes: int,
) -> tuple[int, float, float, float, float, float, float, float, float]:  # fmt: skip
    """Kind, value, lower and upper bound, pole (2), twist (3) about (ax, ay)."""
    nan = math.nan
    taxels = np.empty((3, x.size))
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
    f, s = force / grip, spin / (grip * mean)
    size = math.hypot(f, s)
    lx, lm = f / size, s / size
    q = np.empty(3)
    first_twist(q, start, dx, dy, ct, st, mean, lx, lm)
    lower, upper, value, hinge, _ = minimise(taxels[0], taxels[1], taxels[2], q, 1.0, 0.0, -lm, lx, True, passes)
    # What rounding adds to the spin, turning about the load centroid carries, with twice the friction at most.
    slack = (
        2.0 * ((8.0 * U * (abs(dx) + abs(dy)) + (x.size + 16) * U * mean) * force + 8.0 * U * abs(m)) / (grip * mean)
    )
    value = value * size
    lower, upper = max(lower * size * (1.0 - 8.0 * U) - slack, 0.0), upper * size * (1.0 + 8.0 * U) + slack
    vx, vy, om = mean * (ct * q[0] - st * q[1]), mean * (st * q[0] + ct * q[1]), q[2]  # of the load centroid
    ux, uy = vx - om * dy, vy + om * dx
    if abs(om) * FAR <= math.sqrt(q[0] ** 2 + q[1] ** 2):
        return TRANSLATING, value, lower, upper, nan, nan, ux, uy, om
    px, py = cx + (ex - vy / om), cy + (ey + vx / om)
    return (HINGE if hinge else INTERIOR), value, lower, upper, px, py, ux, uy, om
