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

**Units.** Positions are taken about the load centroid, in radii of gyration (Σ w = 1, Σ w ρ = 0, Σ w ρ² = 1), and
turned so that f_t points along +x. In these, with ρ = |f_t| / (μ f_n), |u| = u_x + c with c = u_y² / (|u| + u_x) ≥ 0,
and because Σ w u_x = v_x,

    D(q) − ρ v_x = Σ w c + (1 − ρ) v_x,      Σ w u/|u| = (1 − Σ w c/|u|, Σ w u_y/|u|).

Every term is small where the sum is small: a pole a million radii away, where translation nears (1 − ρ → 0), costs no
digit, given 1 − ρ itself.

**Rounding.** u = 2⁻⁵³. A sum of n terms, in whatever order, errs by at most n u Σ|terms|, and each term here by less
than 16 u of itself; so (n + 16) u Σ|terms| bounds every sum below, and each bound is widened by it.
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
FAR = 1e9  # a pole this many radii of gyration away is a translation for every purpose
GOAL = 2e-13  # gap at which an answer is as good as its rounding bound
MAX_STEPS = 60  # ordinary scenes need 3–8; a gap that stays open is told by the bounds
MAX_HALVINGS = 50  # 2⁻⁵⁰ of a step is below its rounding
RESOLUTION = 1e-13  # relative change of the sum that may be rounding
TINY = 1e-150  # added to lengths that are divided by: a taxel at the pole has no direction; squares stay finite
RIDGE = 1e-28  # least curvature of any direction, relative to the largest: a far pole leaves one with very little
FLAT = 1e-9  # a determinant this small, relative to the product of the curvatures, is rounding (collinear taxels),
STIFF = 1e-12  # and is helped with so much of their sum
LONGEST = 8.0  # a step changes the velocity by no more than so many times what it was
KINK = 0.02  # share of the squared curvatures from which one taxel may be a kink,
FELT = 0.25  # and share of its sliding velocity by which the step must change it to feel that
NEAR_TRANSLATION = 1e-3  # below this, 1 − ρ is computed in double-double
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
    for _ in range(MAX_STEPS):
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
def smooth_step(m: tuple[float, float, float, float, float]) -> tuple[float, float, float, bool]:
    """Newton's step, the fall of the model's linear part, and whether the model bends in every direction."""
    g1, g2, h11, h12, h22 = m
    bends = h11 * h22 - h12 * h12 > FLAT * h11 * h22
    if not bends:
        h11, h22 = h11 + STIFF * (h11 + h22), h22 + STIFF * (h11 + h22)
    det = h11 * h22 - h12 * h12
    s1, s2 = -(h22 * g1 - h12 * g2) / det, -(h11 * g2 - h12 * g1) / det
    return s1, s2, abs(g1 * s1 + g2 * s2), bends


@compiled
def kink_step(
    m: tuple[float, float, float, float, float], det: float, lever: float, wj: float, ux: float, uy: float
) -> tuple[float, float, float, bool]:
    """The step that minimises the model plus w_j |u_j|, its first-order fall, and whether it lands on u_j = 0.

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
    return s1, s2, fall, z1 == 0.0 and z2 == 0.0


@compiled
def with_hinge(r: Sweep, xj: float, yj: float, fx: float, fy: float) -> tuple[float, float, float, bool]:
    """Friction field with taxel j as a hinge that takes what is missing to (fx, fy) as far as its friction goes.

    Returns:
        1 − f'_x, f'_y and the spin of the field, and whether the hinge takes all that is missing.
    """
    out = r[11]
    tx, ty = (fx - ((1.0 - out) - r[1])) / out, (fy - r[2]) / out
    size = math.sqrt(tx * tx + ty * ty)
    whole = size <= 1.0
    if not whole:
        tx, ty = tx / size, ty / size
    return r[1] + out * (1.0 - tx), r[2] + out * ty, r[3] + out * (yj + xj * ty - yj * tx), whole


@compiled
def spin_bounds(r: Sweep, xj: float, yj: float, vx: float, h: float, n: int, hinge: bool) -> tuple[float, float]:
    """Bounds of max Σ ρ × t with Σ t = (1 − h, 0) and |t_i| ≤ w_i.

    Upper: the sum at any twist. Lower: the field of the twist carries f' = (1 − g_x, g_y). The mixture
    (1 − s) t + s w a with the translation field of a unit vector a carries f exactly for the smallest s with
    |f − (1 − s) f'| ≤ s, and translation adds no spin about the load centroid. With e = |f − f'| and r² = 1 − |f'|²
    that s is at most e (1 + √(1 + r²)) / r².
    """
    slack = (n + 16) * U
    upper = (r[0] + h * vx) + slack * (r[0] + abs(h * vx))
    gx, gy, gm = r[1], r[2], r[3]
    if hinge:
        gx, gy, gm, whole = with_hinge(r, xj, yj, 1.0 - h, 0.0)
        upper += slack
        if whole:
            return gm - 4.0 * slack, upper
    # |u_y|/|u| is at most √(2 c/|u|), so its sum errs by no more than slack √(2 g_x).
    missing = math.sqrt((gx - h) ** 2 + gy * gy) + slack * (abs(gx) + math.sqrt(2.0 * abs(gx)) + h)
    room = gx * (2.0 - gx) - gy * gy - 4.0 * slack * abs(gx)
    share = min(missing * (1.0 + math.sqrt(1.0 + room)) / room, 1.0) if room > 0.0 else 1.0
    return max((1.0 - share) * gm, 0.0) - 2.0 * slack, upper


@compiled
def gauge_bounds(
    r: Sweep, xj: float, yj: float, vx: float, om: float, ax: float, am: float, n: int, reach: float, hinge: bool
) -> tuple[float, float]:
    """Bounds of the gauge of the unit load ℓ = (am, 0, −ax).

    Lower: ℓ·q / D(q) at any twist. Upper: the field of the twist carries a wrench G nearly along ℓ. The linear field
    w_i (a + b ẑ × ρ_i) carries exactly the missing wrench (a, b), so the sum carries (G·ℓ) ℓ, and it exceeds its discs
    by at most |a| + |b| max ρ.
    """
    slack = (n + 16) * U
    lx, lm = am, -ax
    power = r[0] + vx
    lower = (lx * vx + lm * om) / power * (1.0 - 2.0 * slack)
    gx, gy, gm = 1.0 - r[1], r[2], r[3]
    if hinge:
        left, gy, gm, _ = with_hinge(r, xj, yj, lx * power, 0.0)
        gx = 1.0 - left
    along = gx * lx + gm * lm
    if not along > 0.0:
        return lower, math.inf
    a = math.sqrt((along * lx - gx) ** 2 + gy * gy)
    excess = 1.0 + a + abs(along * lm - gm) * reach + 4.0 * slack * (1.0 + reach)
    return lower, excess / along * (1.0 + 8.0 * U)


@compiled
def minimise(
    x: Array, y: Array, w: Array, q: Array, h: float, ax: float, am: float, reach: float, gauge: bool
) -> tuple[float, float, int, int]:
    """Minimises Σ w c(q) + h v_x over q + span{(ax, 0, am), (0, 1, 0)} until its bounds meet.

    Newton's method; the taxel whose norm bends most enters each step as the norm it is, so that a step lands on a
    hinge, or leaves it, with no special case. A line search makes every step a descent, and the sum is convex: it
    converges from anywhere. One sweep a step, a second where a kink matters.

    Args:
        x: Positions, shape (n,), in the units above.
        y: Likewise.
        w: Weights, shape (n,).
        q: The twist to start from, shape (3,); holds the last one on return.
        h: 1 − ρ for the spin, 1 for the gauge.
        ax: First direction of the plane.
        am: Likewise.
        reach: max ρ; for the gauge.
        gauge: Bound the gauge of (am, 0, −ax), else the largest spin.

    Returns:
        Lower bound, upper bound, the taxel that is a hinge (−1: none), steps.
    """
    n = x.size
    best_lower, best_upper = -math.inf, math.inf
    hinge = -1
    r = sweep(x, y, w, q[0], q[1], q[2], -1)
    value = r[0] + h * q[0]
    last_fall = math.inf
    for step in range(1, MAX_STEPS + 1):
        smooth = r
        model = plane_model(r, h, ax, am)
        s1, s2, fall, bends = smooth_step(model)
        hinge, j = -1, 0
        curvature = r[4] + r[7]  # Σ w/|u|
        if r[10] > KINK * curvature * curvature:
            j = sharpest(x, y, w, q[0], q[1], q[2])
            det, lever = ax - am * y[j], am * x[j]
            ux, uy = q[0] - q[2] * y[j], q[1] + q[2] * x[j]
            felt = not bends or abs(det * s1) + abs(lever * s1 + s2) > FELT * (abs(ux) + abs(uy))
            # Where no twist of this plane stops taxel j alone, its norm is as smooth as any other.
            if felt and abs(det) > 1e-5 * (abs(ax) + abs(am * y[j])):
                r = sweep(x, y, w, q[0], q[1], q[2], j)
                s1, s2, fall, lands = kink_step(plane_model(r, h, ax, am), det, lever, r[11], ux, uy)
                if lands and abs(ux) + abs(uy) <= 1e-12 * (abs(q[0]) + abs(q[1]) + abs(q[2])):
                    hinge = j
        bounded = r if hinge >= 0 else smooth
        if gauge:
            lower, upper = gauge_bounds(bounded, x[j], y[j], q[0], q[2], ax, am, n, reach, hinge >= 0)
        else:
            lower, upper = spin_bounds(bounded, x[j], y[j], q[0], h, n, hinge >= 0)
        best_lower, best_upper = max(best_lower, lower), min(best_upper, upper)
        if best_upper - best_lower <= GOAL * (best_upper if gauge else 1.0):
            return best_lower, best_upper, hinge, step
        room = LONGEST * (abs(q[0]) + abs(q[1]) + abs(q[2]))
        length = abs(s1) + abs(s2)
        if length > room:
            s1, s2 = s1 * (room / length), s2 * (room / length)
        shrink = 1.0
        for _ in range(MAX_HALVINGS):
            vx, vy, om = q[0] + shrink * s1 * ax, q[1] + shrink * s2, q[2] + shrink * s1 * am
            r = sweep(x, y, w, vx, vy, om, -1)
            next_value = r[0] + h * vx
            if next_value < value:
                break
            # Where the sum no longer resolves a descent, the gradient still does: a full step that shrinks it is good.
            if shrink == 1.0 and next_value - value <= RESOLUTION * abs(value) and fall < 0.25 * last_fall:
                break
            shrink *= 0.5
        else:
            return best_lower, best_upper, hinge, step
        q[0], q[1], q[2] = vx, vy, om
        value, last_fall = next_value, fall
    return best_lower, best_upper, hinge, MAX_STEPS


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
def turn(
    x: Array, y: Array, loads: Array, total: float, cx: float, cy: float, ct: float, st: float, taxels: Array
) -> tuple[float, float, float]:
    """Writes positions about c, turned by −(ct, st), and weights into taxels (3, n).

    Returns:
        Their first moments (2) and their second.
    """
    mx = my = square = 0.0
    for i in range(x.size):
        dx, dy = x[i] - cx, y[i] - cy
        a, b, w = ct * dx + st * dy, ct * dy - st * dx, loads[i] / total
        taxels[0, i], taxels[1, i], taxels[2, i] = a, b, w
        mx += w * a
        my += w * b
        square += w * (a * a + b * b)
    return mx, my, square


@compiled
def normalise(
    x: Array, y: Array, loads: Array, fx: float, fy: float, taxels: Array
) -> tuple[float, float, float, float, float]:
    """Brings a contact into the units above, the force (fx, fy) along +x.

    The centroid is taken twice: the second time about itself, so that a small contact far from the first taxel has one
    that is exact to its own size.

    Returns:
        Σ F (NaN: a value is not finite or a load is negative), centroid (2), radius of gyration (0: all load sits in
        one point), and the largest ρ.
    """
    n = x.size
    nan = math.nan
    heaviest = 0
    for i in range(n):
        if loads[i] > loads[heaviest]:
            heaviest = i
    if n == 0:
        return 0.0, nan, nan, 0.0, 0.0
    ox, oy = x[heaviest], y[heaviest]
    total, mx, my, negative = moments(x, y, loads, ox, oy)
    if negative > 0.0 or not math.isfinite(total + mx + my):
        return nan, nan, nan, 0.0, 0.0
    if total == 0.0:
        return 0.0, nan, nan, 0.0, 0.0
    size = math.hypot(fx, fy)
    ct, st = (fx / size, fy / size) if size > 0.0 else (1.0, 0.0)
    cx, cy = ox + mx / total, oy + my / total
    ex, ey, square = turn(x, y, loads, total, cx, cy, ct, st, taxels)
    radius = math.sqrt(max(square - ex * ex - ey * ey, 0.0))
    if not radius > 4.0 * U * (abs(cx) + abs(cy)):
        return total, ox, oy, 0.0, 0.0
    reach = 0.0
    for i in range(n):
        taxels[0, i] = (taxels[0, i] - ex) / radius
        taxels[1, i] = (taxels[1, i] - ey) / radius
        reach = max(reach, taxels[0, i] ** 2 + taxels[1, i] ** 2)
    return total, cx + (ct * ex - st * ey), cy + (st * ex + ct * ey), radius, math.sqrt(reach)


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
def solve_torque_limit(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, ax: float, ay: float, sense: int
) -> tuple[int, float, float, float, float, float]:
    """Kind, torque, lower and upper bound about (ax, ay), pole (2)."""
    nan = math.nan
    taxels = np.empty((3, x.size))
    total, cx, cy, radius, reach = normalise(x, y, loads, sense * fx, sense * fy, taxels)
    if not total > 0.0 or not math.isfinite(fx + fy + ax + ay):
        return NONE, nan, nan, nan, nan, nan
    grip, force = mu * total, math.hypot(fx, fy)
    dx, dy = ax - cx, ay - cy
    shift = -sense * (dx * fy - dy * fx)  # m about a = m about c − (a − c) × f
    slack = 8.0 * U * (abs(dx) + abs(dy) + abs(cx) + abs(cy)) * force
    h = 1.0 - force / grip
    if h < NEAR_TRANSLATION:
        h = one_minus_rho(loads, mu, fx, fy)
    if h < 0.0:
        return TRANSLATING, nan, nan, nan, nan, nan
    if h == 0.0:
        return TRANSLATING, shift, shift - slack, shift + slack, nan, nan
    if radius == 0.0:
        return HINGE, shift, shift - slack, shift + slack, cx, cy
    q = np.empty(3)  # start from the pole of the ellipsoid
    q[0], q[1], q[2] = (1.0 - h) / math.sqrt(h * (2.0 - h)), 0.0, 1.0
    lower, upper, hinge, _ = minimise(taxels[0], taxels[1], taxels[2], q, h, 1.0, 0.0, reach, False)
    unit = grip * radius
    ct, st = (sense * fx / force, sense * fy / force) if force > 0.0 else (1.0, 0.0)
    # Sense −1 is solved with the force reversed: the same pole.
    px, py = cx - radius * (ct * q[1] + st * q[0]), cy + radius * (ct * q[0] - st * q[1])
    lower, upper = unit * lower + shift, unit * upper + shift
    slack += 8.0 * U * (abs(lower) + abs(upper))
    return (HINGE if hinge >= 0 else INTERIOR), 0.5 * (lower + upper), lower - slack, upper + slack, px, py


@compiled
def solve_utilisation(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, m: float, ax: float, ay: float
) -> tuple[int, float, float, float, float, float]:
    """Kind, value, lower and upper bound, pole (2)."""
    nan = math.nan
    taxels = np.empty((3, x.size))
    total, cx, cy, radius, reach = normalise(x, y, loads, fx, fy, taxels)
    if math.isnan(total) or not math.isfinite(fx + fy + m + ax + ay):
        return NONE, nan, nan, nan, nan, nan
    force = math.hypot(fx, fy)
    if force == 0.0 and m == 0.0:
        return NONE, 0.0, 0.0, 0.0, nan, nan
    if total == 0.0:
        return NONE, math.inf, math.inf, math.inf, nan, nan
    grip = mu * total
    dx, dy = ax - cx, ay - cy
    spin = m + (dx * fy - dy * fx)  # about the load centroid
    if radius == 0.0:
        if spin != 0.0:
            return HINGE, math.inf, math.inf, math.inf, cx, cy
        ratio = force / grip
        return TRANSLATING, ratio, ratio * (1.0 - 8.0 * U), ratio * (1.0 + 8.0 * U), nan, nan
    f, s = force / grip, spin / (grip * radius)
    size = math.hypot(f, s)
    lx, lm = f / size, s / size
    q = np.empty(3)  # start from the outward normal of the ellipsoid, at ℓ·q = 1
    q[0], q[1], q[2] = lx, 0.0, lm
    lower, upper, hinge, _ = minimise(taxels[0], taxels[1], taxels[2], q, 1.0, -lm, lx, reach, True)
    # The rounding of the spin can add no more than itself carried alone, and w_i ẑ × ρ_i / max ρ carries 1 / max ρ.
    slack = 8.0 * U * (abs(m) + (abs(dx) + abs(dy) + abs(cx) + abs(cy)) * force) / (grip * radius) * reach
    lower, upper = lower * size, upper * size
    value = lower
    lower, upper = max(lower * (1.0 - 8.0 * U) - slack, 0.0), upper * (1.0 + 8.0 * U) + slack
    if abs(q[2]) * FAR <= math.sqrt(q[0] ** 2 + q[1] ** 2):
        return TRANSLATING, value, lower, upper, nan, nan
    ct, st = (fx / force, fy / force) if force > 0.0 else (1.0, 0.0)
    px = cx - radius * (ct * q[1] + st * q[0]) / q[2]
    py = cy + radius * (ct * q[0] - st * q[1]) / q[2]
    return (HINGE if hinge >= 0 else INTERIOR), value, lower, upper, px, py
