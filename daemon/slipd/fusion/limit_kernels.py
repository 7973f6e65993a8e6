"""The kernels under the limit surface: a sum of norms, minimised over a plane of twists, and the bounds of the answer.

A rigid motion of the object over the pad is a twist q = (v_x, v_y, ω); taxel i then slides with u_i = v + ω ẑ × ρ_i.
Friction on it can take at most w_i = μ F_i along u_i, so the power that friction takes is the convex function
D(q) = Σ w_i |u_i|, and a load ℓ = (f_x, f_y, m) is carried exactly when ℓ·q ≤ D(q) for every twist. Two questions
follow:

* the largest spin beside a given f_t: minimise D(q) − f_t·v over twists with ω = 1;
* the utilisation λ of a load: 1/λ is the minimum of D(q) over twists with ℓ·q = 1 (a pole at infinity, ω = 0, is an
  ordinary point of that plane).

Both are "a sum of norms over a plane of twists", solved by one kernel. (5) is the stationarity of that sum and (7), the
perfect hinge, its optimality condition at a taxel, where the norm has a kink; so neither needs a search of its own.
(6) as printed compares a torque about C with one about the pole and is not used anywhere.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled

Array = NDArray[np.float64]

EPS = 2.220446049250313e-16
KINDS = ("interior", "hinge", "translating", "none")
INTERIOR, HINGE, TRANSLATING, NONE = range(4)
#: A pole this many radii of gyration away is a translation for every purpose.
FAR = 1e9
MAX_STEPS = 100  # ordinary scenes need 4–8; a bound that is not reached is told by the certificate
RESOLUTION = 1e-14  # relative rounding of the sum of a full image
MAX_HALVINGS = 60  # 2⁻⁶⁰ is below the rounding of any step


@compiled
def power(x: Array, y: Array, w: Array, vx: float, vy: float, om: float) -> tuple[float, int]:
    """Friction power of a twist beyond that of its translation alone, and the taxel where it bends most.

    Returns:
        Σ w_i (|u_i| − |v|), evaluated as a difference so that a far pole keeps its digits; |v| Σ w_i is the caller's
        to add. Then the index of the taxel with the largest w_i / |u_i|.
    """
    speed = math.sqrt(vx * vx + vy * vy)
    total = 0.0
    sharpest, j = -1.0, 0
    for i in range(x.size):
        rx, ry = -om * y[i], om * x[i]
        d = math.sqrt((vx + rx) ** 2 + (vy + ry) ** 2)
        if d + speed > 0.0:
            total += w[i] * ((2.0 * (vx * rx + vy * ry) + rx * rx + ry * ry) / (d + speed))
        bend = w[i] / d if d > 0.0 else math.inf
        if bend > sharpest:
            sharpest, j = bend, i
    return total, j


@compiled
def slope(
    x: Array, y: Array, w: Array, vx: float, vy: float, om: float, j: int
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Gradient (a wrench) and Hessian of D in twist space, without the taxels that lie where taxel j lies.

    Returns:
        Gradient (3), upper triangle of the Hessian xx, xy, xω, yy, yω, ωω (6), and the weight left out.
    """
    gx = gy = gm = 0.0
    hxx = hxy = hxm = hyy = hym = hmm = 0.0
    out = 0.0
    for i in range(x.size):
        if x[i] == x[j] and y[i] == y[j]:
            out += w[i]
            continue
        ux, uy = vx - om * y[i], vy + om * x[i]
        d = math.sqrt(ux * ux + uy * uy)
        nx, ny = ux / d, uy / d
        gx += w[i] * nx
        gy += w[i] * ny
        gm += w[i] * (x[i] * ny - y[i] * nx)
        k = w[i] / d
        arm = x[i] * nx + y[i] * ny  # ρ × t with t = ẑ × n
        hxx += k * ny * ny
        hxy -= k * nx * ny
        hyy += k * nx * nx
        hxm -= k * ny * arm
        hym += k * nx * arm
        hmm += k * arm * arm
    return gx, gy, gm, hxx, hxy, hxm, hyy, hym, hmm, out


@compiled
def proximal(g1: float, g2: float, a: float, b: float, c: float, w: float) -> tuple[float, float]:
    """Minimises w|z| + g·z + ½ zᵀ[[a, b], [b, c]]z over the plane: zero exactly when |g| ≤ w (the hinge)."""
    if g1 * g1 + g2 * g2 <= w * w:
        return 0.0, 0.0
    half, diff = 0.5 * (a + c), 0.5 * (a - c)
    radius = math.sqrt(diff * diff + b * b)
    h1, h2 = half + radius, max(half - radius, 0.0)
    theta = 0.5 * math.atan2(b, diff)
    ct, st = math.cos(theta), math.sin(theta)
    p1, p2 = ct * g1 + st * g2, -st * g1 + ct * g2
    s = 0.0  # s = |z| solves |(s H + w)⁻¹ g| = 1; 1/norm is nearly linear in s, so Newton takes a few steps
    for _ in range(60):
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
def plane_model(b: Array, slopes: tuple[float, ...], lx: float, ly: float) -> tuple[float, float, float, float, float]:
    """Gradient (2) and Hessian (11, 12, 22) in the coordinates of the plane spanned by b, shape (2, 3)."""
    gx, gy, gm, hxx, hxy, hxm, hyy, hym, hmm, _ = slopes
    gx -= lx
    gy -= ly
    g1 = b[0, 0] * gx + b[0, 1] * gy + b[0, 2] * gm
    g2 = b[1, 0] * gx + b[1, 1] * gy + b[1, 2] * gm
    p0 = hxx * b[0, 0] + hxy * b[0, 1] + hxm * b[0, 2]
    p1 = hxy * b[0, 0] + hyy * b[0, 1] + hym * b[0, 2]
    p2 = hxm * b[0, 0] + hym * b[0, 1] + hmm * b[0, 2]
    h11 = b[0, 0] * p0 + b[0, 1] * p1 + b[0, 2] * p2
    h12 = b[1, 0] * p0 + b[1, 1] * p1 + b[1, 2] * p2
    p0 = hxx * b[1, 0] + hxy * b[1, 1] + hxm * b[1, 2]
    p1 = hxy * b[1, 0] + hyy * b[1, 1] + hym * b[1, 2]
    p2 = hxm * b[1, 0] + hym * b[1, 1] + hmm * b[1, 2]
    h22 = b[1, 0] * p0 + b[1, 1] * p1 + b[1, 2] * p2
    ridge = 1e-13 * (h11 + h22) + 1e-300  # collinear taxels leave a direction without curvature
    return g1, g2, h11 + ridge, h12, h22 + ridge


@compiled
def newton_step(
    b: Array, model: tuple[float, float, float, float, float], xj: float, yj: float, wj: float, q: Array
) -> tuple[float, float, bool]:
    """The step in the plane that minimises the model plus w_j |u_j|, and whether it lands on the hinge u_j = 0."""
    g1, g2, h11, h12, h22 = model
    ux, uy = q[0] - q[2] * yj, q[1] + q[2] * xj
    a11, a12 = b[0, 0] - b[0, 2] * yj, b[1, 0] - b[1, 2] * yj  # u_j = u + A step
    a21, a22 = b[0, 1] + b[0, 2] * xj, b[1, 1] + b[1, 2] * xj
    det = a11 * a22 - a12 * a21
    if abs(det) > 1e-6 * (a11 * a11 + a12 * a12 + a21 * a21 + a22 * a22):
        i11, i12, i21, i22 = a22 / det, -a12 / det, -a21 / det, a11 / det
        k11 = i11 * (h11 * i11 + h12 * i21) + i21 * (h12 * i11 + h22 * i21)
        k12 = i11 * (h11 * i12 + h12 * i22) + i21 * (h12 * i12 + h22 * i22)
        k22 = i12 * (h11 * i12 + h12 * i22) + i22 * (h12 * i12 + h22 * i22)
        c1 = i11 * g1 + i21 * g2 - (k11 * ux + k12 * uy)
        c2 = i12 * g1 + i22 * g2 - (k12 * ux + k22 * uy)
        z1, z2 = proximal(c1, c2, k11, k12, k22, wj)
        s1 = i11 * (z1 - ux) + i12 * (z2 - uy)
        s2 = i21 * (z1 - ux) + i22 * (z2 - uy)
        return s1, s2, z1 == 0.0 and z2 == 0.0
    d = math.sqrt(ux * ux + uy * uy)
    if d > 0.0:  # no twist of this plane stops taxel j alone: its norm is as smooth as any other
        g1 += wj * (a11 * ux + a21 * uy) / d
        g2 += wj * (a12 * ux + a22 * uy) / d
        t1, t2 = (a21 * ux - a11 * uy) / d, (a22 * ux - a12 * uy) / d
        h11 += wj * t1 * t1 / d
        h12 += wj * t1 * t2 / d
        h22 += wj * t2 * t2 / d
    determinant = h11 * h22 - h12 * h12
    return -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant, False


@compiled
def minimise(x: Array, y: Array, w: Array, q: Array, base: Array, lx: float, ly: float) -> tuple[int, int]:
    """Minimises Σ w|u(q)| − (lx, ly)·v over q + span(base), by Newton steps that treat the sharpest kink exactly.

    The sum is modelled to second order except for the taxel whose norm bends most, which enters as the norm it is: one
    step then lands on a hinge, or leaves it, with no special case, and a line search makes each step a descent.

    Args:
        x: Taxel positions, shape (n,), about the load centroid, in units of the contact's radius of gyration.
        y: Likewise.
        w: Their weights, shape (n,), summing to 1.
        q: The twist to start from, shape (3,); holds the minimiser on return.
        base: Orthonormal directions of the plane, shape (2, 3).
        lx: Linear term.
        ly: Linear term.

    Returns:
        The taxel that is a hinge (−1: none), and the steps taken.
    """
    value, j = power(x, y, w, q[0], q[1], q[2])
    linear = math.sqrt(q[0] ** 2 + q[1] ** 2) - lx * q[0] - ly * q[1]
    hinge = -1
    last_drop = math.inf
    for step in range(1, MAX_STEPS + 1):
        slopes = slope(x, y, w, q[0], q[1], q[2], j)
        model = plane_model(base, slopes, lx, ly)
        s1, s2, lands = newton_step(base, model, x[j], y[j], slopes[9], q)
        drop = abs(model[0] * s1 + model[1] * s2)
        shrink = 1.0
        for _ in range(MAX_HALVINGS):
            vx = q[0] + shrink * (s1 * base[0, 0] + s2 * base[1, 0])
            vy = q[1] + shrink * (s1 * base[0, 1] + s2 * base[1, 1])
            om = q[2] + shrink * (s1 * base[0, 2] + s2 * base[1, 2])
            next_value, k = power(x, y, w, vx, vy, om)
            next_linear = math.sqrt(vx * vx + vy * vy) - lx * vx - ly * vy
            change = (next_value - value) + (next_linear - linear)
            if change < 0.0:
                break
            # Where the sum no longer resolves a descent, the gradient still does: a full step that shrinks it is good.
            if shrink == 1.0 and change <= RESOLUTION * abs(next_value) and drop < 0.1 * last_drop:
                break
            shrink *= 0.5
        else:
            return (j if lands else hinge), step
        hinge = j if lands and shrink == 1.0 else -1
        q[0], q[1], q[2] = vx, vy, om
        value, linear, last_drop = next_value, next_linear, drop
        if hinge < 0:
            j = k
    return hinge, MAX_STEPS


@compiled
def normalise(
    x: Array, y: Array, loads: Array, rx: Array, ry: Array, w: Array
) -> tuple[int, float, float, float, float]:
    """Writes the loaded taxels about their load centroid, in radii of gyration, with weights that sum to 1.

    Returns:
        Number of loaded taxels (−1: a value is not finite or a load is negative), Σ F, centroid (2), radius of
        gyration (0: all load sits in one point).
    """
    n = 0
    total = 0.0
    for i in range(x.size):
        if not (math.isfinite(x[i]) and math.isfinite(y[i]) and math.isfinite(loads[i]) and loads[i] >= 0.0):
            return -1, 0.0, 0.0, 0.0, 0.0
        if loads[i] > 0.0:
            rx[n], ry[n], w[n] = x[i], y[i], loads[i]
            total += loads[i]
            n += 1
    if n == 0:
        return 0, 0.0, 0.0, 0.0, 0.0
    ox, oy = rx[0], ry[0]
    mx = my = 0.0
    for i in range(n):
        w[i] /= total
        mx += w[i] * (rx[i] - ox)
        my += w[i] * (ry[i] - oy)
    cx, cy = ox + mx, oy + my
    square = 0.0
    one_point = True
    for i in range(n):
        one_point = one_point and rx[i] == ox and ry[i] == oy
        rx[i], ry[i] = (rx[i] - ox) - mx, (ry[i] - oy) - my
        square += w[i] * (rx[i] ** 2 + ry[i] ** 2)
    if one_point:
        return n, total, ox, oy, 0.0
    radius = math.sqrt(square)
    for i in range(n):
        rx[i] /= radius
        ry[i] /= radius
    return n, total, cx, cy, radius


@compiled
def field(
    x: Array, y: Array, w: Array, q: Array, hinge: int, fx: float, fy: float
) -> tuple[float, float, float, float, float]:
    """Wrench (f_x, f_y, m) of the friction field of a twist, and the field's value t_j / w_j on the hinge.

    The taxels at the hinge take what is missing to (fx, fy), as far as their friction goes.
    """
    gx = gy = gm = 0.0
    wj = 0.0
    for i in range(x.size):
        if hinge >= 0 and x[i] == x[hinge] and y[i] == y[hinge]:
            wj += w[i]
            continue
        ux, uy = q[0] - q[2] * y[i], q[1] + q[2] * x[i]
        d = math.sqrt(ux * ux + uy * uy)
        if d > 0.0:
            nx, ny = ux / d, uy / d
            gx += w[i] * nx
            gy += w[i] * ny
            gm += w[i] * (x[i] * ny - y[i] * nx)
    tx = ty = 0.0
    if wj > 0.0:
        tx, ty = (fx - gx) / wj, (fy - gy) / wj
        size = math.sqrt(tx * tx + ty * ty)
        if size > 1.0:
            tx, ty = tx / size, ty / size
        gx += wj * tx
        gy += wj * ty
        gm += wj * (x[hinge] * ty - y[hinge] * tx)
    return gx, gy, gm, tx, ty


@compiled
def largest_spin(x: Array, y: Array, w: Array, fx: float, fy: float, q: Array) -> tuple[float, float, int]:
    """Bounds of max Σ ρ × t with Σ t = f and |t_i| ≤ w_i (unit weights, |f| < 1), the twist and the hinge.

    Lower bound: the field of the twist carries f' near f. The mixture (1 − s) t + s w a with the translation field of
    a unit vector a carries f exactly for the smallest s with |f − (1 − s) f'| ≤ s, and translation adds no spin about
    the load centroid.
    """
    mean_arm = 0.0
    for i in range(x.size):
        mean_arm += w[i] * math.sqrt(x[i] ** 2 + y[i] ** 2)
    # Start: the pole of the ellipsoid m² / M0² + f² = 1 with M0 the limit for a turn about the centroid.
    stretch = mean_arm / math.sqrt(max((1.0 - fx * fx) - fy * fy, EPS))
    q[0], q[1], q[2] = fx * stretch, fy * stretch, 1.0
    base = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    hinge, _ = minimise(x, y, w, q, base, fx, fy)
    speed = math.sqrt(q[0] ** 2 + q[1] ** 2)
    upper = 0.0
    size = speed
    for i in range(x.size):
        rx, ry = -q[2] * y[i], q[2] * x[i]
        d = math.sqrt((q[0] + rx) ** 2 + (q[1] + ry) ** 2)
        size += w[i] * d
        if d + speed > 0.0:
            upper += w[i] * ((2.0 * (q[0] * rx + q[1] * ry) + rx * rx + ry * ry) / (d + speed))
    upper += speed - fx * q[0] - fy * q[1]
    rounding = 4.0 * EPS * (x.size + 8) * (1.0 + mean_arm) + 8.0 * EPS * size
    gx, gy, gm, _, _ = field(x, y, w, q, hinge, fx, fy)
    ex, ey = fx - gx, fy - gy
    room = max((1.0 - gx * gx) - gy * gy, 0.0)
    along, square = gx * ex + gy * ey, ex * ex + ey * ey
    root = math.sqrt(along * along + room * square)
    share = min((along + root) / room, 1.0) if room > 0.0 else (0.0 if square == 0.0 else 1.0)
    lower = (1.0 - max(share, 0.0)) * gm
    return max(lower, 0.0) - rounding, upper + rounding, hinge


@compiled
def solve_torque_limit(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, ax: float, ay: float, sense: int
) -> tuple[int, float, float, float, float, float]:
    """Kind, torque, lower and upper bound about (ax, ay), pole (2)."""
    nan = math.nan
    rx, ry, w = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    n, total, cx, cy, radius = normalise(x, y, loads, rx, ry, w)
    if n <= 0 or not math.isfinite(fx + fy + ax + ay):
        return NONE, nan, nan, nan, nan, nan
    grip = mu * total
    gx, gy = sense * fx / grip, sense * fy / grip
    shift = -sense * ((ax - cx) * fy - (ay - cy) * fx)  # m about a = m about c − (a − c) × f
    slack = 4.0 * EPS * (abs(shift) + (math.hypot(ax, ay) + math.hypot(cx, cy)) * math.hypot(fx, fy))
    ratio = math.sqrt(gx * gx + gy * gy)
    if ratio > 1.0:
        return TRANSLATING, nan, nan, nan, nan, nan
    if ratio == 1.0:
        return TRANSLATING, shift, shift - slack, shift + slack, nan, nan
    if radius == 0.0:
        return HINGE, shift, shift - slack, shift + slack, cx, cy
    q = np.empty(3)
    lower, upper, hinge = largest_spin(rx[:n], ry[:n], w[:n], gx, gy, q)
    unit = grip * radius
    px, py = cx - radius * q[1], cy + radius * q[0]
    lower, upper = unit * lower + shift, unit * upper + shift
    kind = HINGE if hinge >= 0 else INTERIOR
    # The sense −1 problem was solved with the force reversed: the same pole.
    return kind, 0.5 * (lower + upper), lower - slack, upper + slack, px, py


@compiled
def least_factor(x: Array, y: Array, w: Array, fx: float, fy: float, m: float, q: Array) -> tuple[float, float, int]:
    """Bounds of the gauge of the load (f, m) for unit weights, the twist and the hinge.

    Upper bound: the field of the twist carries a wrench G nearly along ℓ. With Σ w = 1, Σ w ρ = 0, Σ w ρ² = 1 the
    linear field w_i (a + b ẑ × ρ_i) carries exactly the missing wrench (a, b), so the sum carries ν ℓ, and exceeds its
    discs by no more than the factor measured.
    """
    size = math.sqrt(fx * fx + fy * fy + m * m)
    lx, ly, lm = fx / size, fy / size, m / size
    mean_arm = 0.0
    for i in range(x.size):
        mean_arm += w[i] * math.sqrt(x[i] ** 2 + y[i] ** 2)
    # Start: the outward normal of the ellipsoid, scaled to ℓ·q = 1.
    q[0], q[1], q[2] = lx, ly, lm / (mean_arm * mean_arm)
    scale = q[0] * lx + q[1] * ly + q[2] * lm
    q /= scale
    base = np.empty((2, 3))
    flat = math.sqrt(lx * lx + ly * ly)
    if flat > 0.0:
        base[0, 0], base[0, 1], base[0, 2] = -ly / flat, lx / flat, 0.0
        base[1, 0], base[1, 1], base[1, 2] = -lm * lx / flat, -lm * ly / flat, flat
    else:
        base[0, 0], base[0, 1], base[0, 2] = 1.0, 0.0, 0.0
        base[1, 0], base[1, 1], base[1, 2] = 0.0, 1.0, 0.0
    hinge, _ = minimise(x, y, w, q, base, 0.0, 0.0)
    dissipated = 0.0
    for i in range(x.size):
        dissipated += w[i] * math.sqrt((q[0] - q[2] * y[i]) ** 2 + (q[1] + q[2] * x[i]) ** 2)
    rounding = EPS * (x.size + 16)
    worked = lx * q[0] + ly * q[1] + lm * q[2]
    lower = worked / dissipated * size * (1.0 - rounding)
    gx, gy, gm, tx, ty = field(x, y, w, q, hinge, lx * dissipated, ly * dissipated)
    along = gx * lx + gy * ly + gm * lm
    ax, ay, b = along * lx - gx, along * ly - gy, along * lm - gm
    excess = 0.0
    for i in range(x.size):
        if hinge >= 0 and x[i] == x[hinge] and y[i] == y[hinge]:
            sx, sy = tx, ty
        else:
            ux, uy = q[0] - q[2] * y[i], q[1] + q[2] * x[i]
            d = math.sqrt(ux * ux + uy * uy)
            sx, sy = (ux / d, uy / d) if d > 0.0 else (0.0, 0.0)
        sx += ax - b * y[i]
        sy += ay + b * x[i]
        excess = max(excess, math.sqrt(sx * sx + sy * sy))
    upper = excess * size / along * (1.0 + rounding) if along > 0.0 else math.inf
    return lower, max(upper, lower), hinge


@compiled
def solve_utilisation(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, m: float, ax: float, ay: float
) -> tuple[int, float, float, float, float, float]:
    """Kind, value, lower and upper bound, pole (2)."""
    nan = math.nan
    rx, ry, w = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    n, total, cx, cy, radius = normalise(x, y, loads, rx, ry, w)
    if n < 0 or not math.isfinite(fx + fy + m + ax + ay):
        return NONE, nan, nan, nan, nan, nan
    spin = m + (ax - cx) * fy - (ay - cy) * fx  # about the load centroid
    if fx == 0.0 and fy == 0.0 and spin == 0.0:
        return NONE, 0.0, 0.0, 0.0, nan, nan
    if n == 0:
        return NONE, math.inf, math.inf, math.inf, nan, nan
    grip = mu * total
    if radius == 0.0:
        if spin != 0.0:
            return HINGE, math.inf, math.inf, math.inf, cx, cy
        ratio = math.hypot(fx, fy) / grip
        return TRANSLATING, ratio, ratio * (1.0 - 4.0 * EPS), ratio * (1.0 + 4.0 * EPS), nan, nan
    q = np.empty(3)
    lower, upper, hinge = least_factor(rx[:n], ry[:n], w[:n], fx / grip, fy / grip, spin / (grip * radius), q)
    if abs(q[2]) * FAR <= math.sqrt(q[0] ** 2 + q[1] ** 2):
        return TRANSLATING, lower, lower, upper, nan, nan
    kind = HINGE if hinge >= 0 else INTERIOR
    return kind, lower, lower, upper, cx - radius * q[1] / q[2], cy + radius * q[0] / q[2]
