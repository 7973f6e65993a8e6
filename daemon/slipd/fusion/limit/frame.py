"""Scale a contact to its own units, and compute 1 − ρ without losing digits.

The units (see `slipd.fusion.limit`) make every later sum of order 1, so that pads in mm or km and forces in µN or MN
give the same digits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled_part, compiled_sum_part
from slipd.types.arrays import Array

U = 2.0**-53  # unit roundoff of float64
SMALLEST, LARGEST = 1e-130, 1e130  # lengths and forces whose squares and products neither overflow nor vanish
NEAR_TRANSLATION = 0.02  # below this, 1 − ρ is computed in double-double
SPLIT = 134217729.0  # 2²⁷ + 1: Dekker's constant


class Load(NamedTuple):
    """What friction has to carry.

    Attributes:
        fx: Tangential force along X, N.
        fy: Likewise along Y.
        spin: Torque about the pad normal through (ax, ay), N·m.
        ax: The point that the torque refers to, m.
        ay: Likewise.
    """

    fx: float
    fy: float
    spin: float
    ax: float
    ay: float


class Frame(NamedTuple):
    """The contact's own units in terms of those given.

    The centroid is a point and a remainder, so that the lever of a small contact far from the origin, or of one heavy
    taxel among light ones, is exact to the contact's own size.

    Attributes:
        total: Σ F, N. 0: no load. NaN: a value is not finite, a load is negative, or squares would overflow.
        cx: Point near the load centroid, m.
        cy: Likewise.
        ex: Load centroid minus that point, m.
        ey: Likewise.
        mean: Mean distance of the loads from their centroid, m. 0: all load sits in one point.
        ct: Direction of the tangential force, cosine.
        st: Likewise, sine.
    """

    total: float
    cx: float
    cy: float
    ex: float
    ey: float
    mean: float
    ct: float
    st: float


@compiled_part
def split(taxels: Array) -> tuple[Array, Array, Array]:
    """Return positions x, y and weights w, shape (n,) each, of taxels in the contact's own units, shape (3, n)."""
    return taxels[0], taxels[1], taxels[2]


@compiled_sum_part
def moments(x: Array, y: Array, loads: Array, ox: float, oy: float) -> tuple[float, float, float, float]:
    """Return Σ F, Σ F (r − o) (2), and the number of negative loads."""
    total = mx = my = negative = 0.0
    for i in range(x.size):
        total += loads[i]
        mx += loads[i] * (x[i] - ox)
        my += loads[i] * (y[i] - oy)
        negative += 1.0 if loads[i] < 0.0 else 0.0
    return total, mx, my, negative


@compiled_sum_part
def place(
    x: Array, y: Array, loads: Array, cx: float, cy: float, ex: float, ey: float, ct: float, st: float, scale: float,
    xs: Array, ys: Array, w: Array,
) -> tuple[float, float]:  # fmt: skip
    """Write positions relative to c + e, turned by −(ct, st), and weights into xs, ys and w.

    Returns:
        Σ w |ρ|, and Σ w (|ρ_x| + |ρ_y|), which does not underflow.
    """
    mean = blocks = 0.0
    for i in range(x.size):
        dx, dy, wi = (x[i] - cx) - ex, (y[i] - cy) - ey, loads[i] * scale
        xs[i], ys[i], w[i] = ct * dx + st * dy, ct * dy - st * dx, wi
        mean += wi * math.sqrt(dx * dx + dy * dy)
        blocks += wi * (abs(dx) + abs(dy))
    return mean, blocks


@compiled_part
def normalise(x: Array, y: Array, loads: Array, fx: float, fy: float, taxels: Array) -> Frame:
    """Scale a contact to its own units, with the force (fx, fy) along +x.

    Args:
        x: Taxel centres in the pad frame, shape (n,), m.
        y: Likewise.
        loads: Normal forces, shape (n,), N.
        fx: Tangential force, N.
        fy: Likewise.
        taxels: Filled with the contact in its own units, shape (3, n), see `split`.
    """
    nan = math.nan
    if x.size == 0:
        return Frame(0.0, nan, nan, 0.0, 0.0, 0.0, 1.0, 0.0)
    total, mx, my, negative = moments(x, y, loads, x[0], y[0])
    if negative > 0.0 or not math.isfinite(total + mx + my) or total > LARGEST or 0.0 < total < SMALLEST:
        return Frame(nan, nan, nan, 0.0, 0.0, 0.0, 1.0, 0.0)
    if total == 0.0:
        return Frame(0.0, nan, nan, 0.0, 0.0, 0.0, 1.0, 0.0)
    size = math.hypot(fx, fy)
    ct, st = (fx / size, fy / size) if size > 0.0 else (1.0, 0.0)
    cx, cy = x[0] + mx / total, y[0] + my / total
    _, mx, my, _ = moments(x, y, loads, cx, cy)
    ex, ey = mx / total, my / total
    xs, ys, w = split(taxels)
    mean, blocks = place(x, y, loads, cx, cy, ex, ey, ct, st, 1.0 / total, xs, ys, w)
    if blocks == 0.0:
        return Frame(total, cx, cy, ex, ey, 0.0, ct, st)
    if not SMALLEST < mean < LARGEST:
        return Frame(nan, nan, nan, 0.0, 0.0, 0.0, 1.0, 0.0)
    inverse = 1.0 / mean
    for i in range(x.size):
        xs[i] *= inverse
        ys[i] *= inverse
    return Frame(total, cx, cy, ex, ey, mean, ct, st)


@compiled_part
def product_error(a: float, b: float, p: float) -> float:
    """Return a b minus its rounded product p, exactly.

    Source: Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18, 1971.
    """
    t = SPLIT * a
    ah = t - (t - a)
    t = SPLIT * b
    bh = t - (t - b)
    al, bl = a - ah, b - bh
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl


@compiled_part
def sum_error(a: float, b: float, s: float) -> float:
    """Return a + b minus its rounded sum s, exactly.

    Source: Knuth, The Art of Computer Programming, vol. 2, section 4.2.2, theorem B.
    """
    t = s - a
    return (a - (s - t)) + (b - t)


@compiled_part
def one_minus_rho(loads: Array, mu: float, fx: float, fy: float) -> float:
    """Return 1 − |f| / (μ Σ F) with sums and products in double-double, as (W² − f²) / (W (W + |f|))."""
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


@compiled_part
def slip_margin(loads: Array, mu: float, fx: float, fy: float, grip: float) -> tuple[float, float]:
    """Return 1 − ρ and a bound of its error: in plain sums, or in double-double where it is small.

    Source: ρ = R / μ with R of paper eq. (4).
    """
    h = 1.0 - math.hypot(fx, fy) / grip
    if h >= NEAR_TRANSLATION:
        return h, (loads.size + 4) * U
    spread = (loads.size + 16) * U
    h = one_minus_rho(loads, mu, fx, fy)
    return h, 16.0 * U * abs(h) + 4.0 * spread * spread
