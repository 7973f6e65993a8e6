"""Distribution of the normal force on the taxels: three rules, by what of the image can be trusted.

* grey: proportional to the pressures; needs equal gains only.
* binary: linear in (x, y) over the active taxels, balancing f_n at C; needs no pressures.
* matched: the image tilted by exp(a + b·r) until it balances f_n at C. The force sensor measures Σ F and Σ F r far
  better than the image does, and the tilt keeps every load positive.

Binary and matched have a solution only where C lies inside the hull of the active taxels. Outside, which is common at
edges and with few taxels, C is projected into the hull and the distance is reported.

Source: paper, integration section: pressure proportional to the image (grey), or linear from a binary image. The
matched rule is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.contact import Contact, not_numbers
from slipd.fusion.hull import Outline
from slipd.types.arrays import Array, Indices

ON_HULL = 1e-6
"""Fraction of the contact's extent within which a centroid counts as lying on the hull. The tilt that meets it would
spread the loads over more than six decades, which no image supports."""
MAX_NEWTON_STEPS = 100  # both problems are convex and take 4–10
LONGEST_OVERSHOOT = 8.0
"""A step of the tilt that changes the exponent of a load by more than this must not overshoot: beyond the minimum one
taxel carries everything, the curvature vanishes, and no step leads back."""


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """Normal forces on the taxels.

    Attributes:
        loads: Shape (n,), N, none negative; they sum to the normal force ("no_image": all zero).
        centroid_residual_m: Distance of the loads' centroid from the requested one, m: 0 where it was met and for the
            grey rule, which has none; NaN without an image.
        status: "ok", "projected" (the centroid lay outside the hull) or "no_image" (no active taxel).
        x: Centres of the taxels, shape (n,), m; None where they were not given.
        y: Likewise.
    """

    loads: Array
    centroid_residual_m: float
    status: str
    x: Array | None = None
    y: Array | None = None


def grey_loads(
    pressure: ArrayLike, normal_n: float | Contact, x: ArrayLike | None = None, y: ArrayLike | None = None
) -> Loads:
    """Distribute the normal force in proportion to the pressures: F_i = f_n p_i / Σ p.

    Args:
        pressure: Taxel readings, shape (n,), any unit; negative ones count as zero.
        normal_n: f_n, N, or the contact.
        x: Taxel centres, shape (n,), m; needed only to ask about the loads with a `Contact`.
        y: Likewise.

    Raises:
        ValueError: A shape is wrong, a pressure is not finite, or the normal force is negative or not finite.
        TypeError: An argument is not numbers.

    >>> grey_loads([1.0, 3.0, -0.1], normal_n=8.0).loads.tolist()
    [2.0, 6.0, 0.0]
    """
    p, force_n = _pressure(pressure), _normal(normal_n)
    xs, ys = (None, None) if x is None else _positions(x, y)
    if not p.any():
        return Loads(np.zeros(p.size), math.nan, "no_image", xs, ys)
    share = p / p.max()  # first, so that no sum overflows
    return Loads(force_n * (share / share.sum()), 0.0, "ok", xs, ys)


def binary_loads(x: ArrayLike, y: ArrayLike, normal_n: float | Contact, centroid: ArrayLike | None = None) -> Loads:
    """Distribute the normal force linearly in (x, y) over the active taxels so that it acts at the centroid.

    Where the linear rule would pull on a taxel, that taxel carries nothing: F_i = max(0, a + b·r_i).

    Args:
        x: Centres of the active taxels, shape (n,), m.
        y: Likewise, shape (n,), m.
        normal_n: f_n, N, or the contact.
        centroid: C, shape (2,), m; not beside a contact, which has one.

    Raises:
        ValueError: A shape is wrong, or a value is not finite.
        TypeError: An argument is not numbers.

    >>> binary_loads([0.0, 0.01], [0.0, 0.0], normal_n=4.0, centroid=(0.0025, 0.0)).loads.round(9).tolist()
    [3.0, 1.0]
    """
    xs, ys = _positions(x, y)
    return _balance(xs, ys, np.ones(xs.size), normal_n, centroid, binary=True)


def matched_loads(
    x: ArrayLike, y: ArrayLike, pressure: ArrayLike, normal_n: float | Contact, centroid: ArrayLike | None = None
) -> Loads:
    """Tilt the image by exp(a + b·r) until it balances the normal force at the centroid.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Likewise, shape (n,), m.
        pressure: Taxel readings, shape (n,), any unit; negative ones count as zero.
        normal_n: As in `binary_loads`, like what it raises.
        centroid: Likewise.

    >>> from slipd.fusion import contact_from_wrench
    >>> contact = contact_from_wrench(force=(0.0, 0.0, -4.0), torque=(0.0, 0.01, 0.0))
    >>> matched_loads([0.0, 0.01], [0.0, 0.0], [1.0, 1.0], contact).loads.round(9).tolist()
    [3.0, 1.0]
    """
    xs, ys = _positions(x, y)
    p = _pressure(pressure)
    if p.shape != xs.shape:
        raise ValueError(f"pressure must have the shape of x, {xs.shape}, got {p.shape}")
    return _balance(xs, ys, p, normal_n, centroid)


def active_loads(x: Array, y: Array, p: Array | None, centroid: tuple[float, float], outline: Outline) -> Loads:
    """Distribute 1 N as `matched_loads` or, without pressures, as `binary_loads`; nothing is checked.

    Args:
        x: Centres of the active taxels, shape (n,), n ≥ 1, finite, m.
        y: Likewise, shape (n,), m.
        p: Pressures, all positive, shape (n,); None for the binary rule.
        centroid: C, finite, m.
        outline: Of these taxels.
    """
    cx, cy = centroid
    extent = outline.extent_m
    margin, qx, qy, a, b = outline.nearest(cx, cy)
    if margin > ON_HULL * extent:
        loads = (
            _clipped_linear(np.vstack((x - cx, y - cy)).T / extent)
            if p is None
            else tilt((x - cx) / extent, (y - cy) / extent, p)
        )
    else:
        face, along = _edge(x, y, qx, qy, a, b, extent)
        loads = np.zeros(x.size)
        loads[face] = _clipped_linear(along[:, None]) if p is None else tilt(along, np.zeros(along.size), p[face])
    outside = -margin > ON_HULL * extent or (extent == 0.0 and margin < 0.0)
    return Loads(loads, -margin if outside else 0.0, "projected" if outside else "ok")


def _balance(
    x: Array, y: Array, p: Array, normal_n: float | Contact, centroid: ArrayLike | None, *, binary: bool = False
) -> Loads:
    """Distribute the force over the taxels with a pressure."""
    force_n = _normal(normal_n)
    centroid = normal_n.centroid_m if isinstance(normal_n, Contact) else centroid
    cx, cy = _finite("centroid", centroid, (2,)).tolist()
    active = np.flatnonzero(p > 0.0)
    loads = np.zeros(x.size)
    if active.size == 0:
        return Loads(loads, math.nan, "no_image", x, y)
    ax, ay, ap = x[active], y[active], p[active]
    found = active_loads(ax, ay, None if binary else ap, (cx, cy), Outline(ax, ay))
    loads[active] = force_n * found.loads
    return Loads(loads, found.centroid_residual_m, found.status, x, y)


def _edge(ax: Array, ay: Array, qx: float, qy: float, a: int, b: int, extent: float) -> tuple[Indices, Array]:
    """Return the taxels of the hull's edge or corner at q, and their positions along it, shape (k,)."""
    ex, ey = ax[b] - ax[a], ay[b] - ay[a]
    length = math.hypot(ex, ey)
    if length == 0.0:
        return np.arange(ax.size), np.zeros(ax.size)
    along = ((ax - qx) * ex + (ay - qy) * ey) / length
    across = ((ax - qx) * ey - (ay - qy) * ex) / length
    face = np.flatnonzero(np.abs(across) <= 1e-9 * extent)
    ends = along[face]
    for end in (ends.min(), ends.max()):
        if abs(end) <= ON_HULL * extent:
            corner = face[np.abs(ends - end) <= 1e-9 * extent]
            return corner, np.zeros(corner.size)
    return face, ends / length


def _clipped_linear(position: Array) -> Array:
    """Return loads max(0, a + b·r) with Σ F = 1 and Σ F r = 0, by Newton's method on the convex dual.

    Where all positions are 0 along an axis, nothing is tilted along it.
    """
    basis = np.column_stack((np.ones(len(position)), position))
    target = np.zeros(basis.shape[1])
    target[0] = 1.0
    theta = np.zeros(basis.shape[1])
    theta[0] = 1.0 / len(basis)

    def dual(t: Array) -> float:
        return float(0.5 * np.square(np.maximum(basis @ t, 0.0)).sum() - t @ target)

    for _step in range(MAX_NEWTON_STEPS):
        value = basis @ theta
        on = value > 0.0
        slope = basis[on].T @ value[on] - target
        if np.abs(slope).max() <= 1e-13:
            break
        curvature = basis[on].T @ basis[on]
        curvature[np.diag_indices_from(curvature)] += 1e-14 * max(float(np.trace(curvature)), 1.0)
        step = np.linalg.solve(curvature, slope)
        here, size = dual(theta), 1.0
        while dual(theta - size * step) > here - 1e-4 * size * float(slope @ step) and size > 1e-12:
            size *= 0.5
        theta = theta - size * step
    share = np.maximum(basis @ theta, 0.0)
    return np.asarray(share / share.sum())


@compiled
def tilt(x: Array, y: Array, p: Array) -> Array:
    """Return loads p exp(b·r) / Σ p exp(b·r) with Σ F r = 0, by Newton's method on the convex log Σ p exp(b·r).

    Args:
        x: Positions from the centroid in units of the contact's extent, shape (n,): max x − min x ≤ 1.
        y: Likewise, shape (n,).
        p: Pressures, all positive, shape (n,).
    """
    n = p.size
    logs = np.log(p / p.max())
    share, trial = np.empty(n), np.empty(n)
    bx, by = 0.0, 0.0
    value, mx, my = _tilt_to(x, y, logs, bx, by, share)
    for _step in range(MAX_NEWTON_STEPS):
        if max(abs(mx), abs(my)) <= 1e-13:
            break
        cxx, cxy, cyy = 0.0, 0.0, 0.0
        for i in range(n):
            dx, dy = x[i] - mx, y[i] - my
            cxx += share[i] * dx * dx
            cxy += share[i] * dx * dy
            cyy += share[i] * dy * dy
        floor = 1e-14 * (cxx + cyy) + 1e-300
        cxx += floor
        cyy += floor
        det = cxx * cyy - cxy * cxy
        sx, sy = (cyy * mx - cxy * my) / det, (cxx * my - cxy * mx) / det
        slope, reach = mx * sx + my * sy, abs(sx) + abs(sy)
        size = 1.0
        while size > 1e-12:
            next_value, next_mx, next_my = _tilt_to(x, y, logs, bx - size * sx, by - size * sy, trial)
            falls = next_value <= value - 1e-4 * size * slope + 1e-15
            if falls and (size * reach <= LONGEST_OVERSHOOT or next_mx * sx + next_my * sy >= 0.0):
                break
            size *= 0.5
        bx, by, value, mx, my = bx - size * sx, by - size * sy, next_value, next_mx, next_my
        share, trial = trial, share
    return share


@compiled_part
def _tilt_to(x: Array, y: Array, logs: Array, bx: float, by: float, share: Array) -> tuple[float, float, float]:
    """Write the loads of a tilt into ``share``; return log Σ p exp(b·r) and its gradient, Σ F r."""
    top = -np.inf
    for i in range(logs.size):
        share[i] = logs[i] + bx * x[i] + by * y[i]
        top = max(top, share[i])
    total = 0.0
    for i in range(logs.size):
        share[i] = math.exp(share[i] - top)
        total += share[i]
    mx, my = 0.0, 0.0
    for i in range(logs.size):
        share[i] /= total
        mx += share[i] * x[i]
        my += share[i] * y[i]
    return top + math.log(total), mx, my


def _finite(name: str, value: ArrayLike | None, shape: tuple[int, ...] | None = None) -> Array:
    """Return an argument as an array of a shape; None: of any shape (n,)."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise not_numbers(**{name: value}) from None
    if array.ndim != 1 or (shape is not None and array.shape != shape):
        raise ValueError(f"{name} must have shape {shape or '(n,)'}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite")
    return array


def _normal(normal_n: float | Contact) -> float:
    force_n = normal_n.normal_n if isinstance(normal_n, Contact) else normal_n
    if np.shape(force_n) or not isinstance(force_n, SupportsFloat):
        raise not_numbers(normal_n=force_n)
    if not 0.0 <= force_n < math.inf:
        raise ValueError(f"normal_n must be finite and not negative, got {force_n}")
    return force_n


def _pressure(pressure: ArrayLike) -> Array:
    return np.maximum(_finite("pressure", pressure), 0.0)


def _positions(x: ArrayLike | None, y: ArrayLike | None) -> tuple[Array, Array]:
    xs, ys = _finite("x", x), _finite("y", y)
    if xs.shape != ys.shape:
        raise ValueError(f"x and y must share one shape (n,), got {xs.shape} and {ys.shape}")
    return xs, ys
