"""Reference for the friction limit: 25 digits, by an algorithm independent of the fast solver.

Nothing is shared with the solver: the doubles of a scene are taken as exact numbers, and the twist that begins to slide
is found on the central path of the cone form. With c_i = μ F_i and e_i(q) the sliding velocity of taxel i under the
twist q = (v, ω) about C, the barrier of |e_i| ≤ s_i leaves, once s_i is eliminated, the friction field

    t_i = c_i² e_i / (ε + √(ε² + c_i² |e_i|²)),    |t_i| < c_i,

which balances where Σ c_i |e_i| less what the load gains is least but for at most n ε. The function so smoothed is
self-concordant: Newton's damped steps converge from anywhere, on hinges, segments and duplicates alike, and however far
the pole. ε falls until field and twist enclose the answer to 25 digits; where they do not, nothing is returned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from chart.scenes import Scene
from mpmath import mp, mpf, workdps

Real = Any
"""An mpf: mpmath has no types."""

Vector = Sequence[Real]
_Newton = tuple[list[Real], Real, list[Real]]
"""A step, its length, and the direction of the path."""

DIGITS = 110
"""Poles 10¹⁶ radii away, loads and widths over 24 decades and 25 certified digits take 90 at the worst."""

GAP = "1e-25"
"""Certified, of the contact's own torque scale or of the utilisation."""

LAST_EPSILON = "1e-28"
"""Of the scaled problem, whose terms sum to about 1: leaves n · 1e-28 to GAP."""

NEAR, THERE = "0.1", "1e-15"
"""Newton's decrement at the last step where ε falls on, and at the end; every full step squares it."""

FULL_STEPS, TOO_FAR = 0.25, 3.0
"""Decrements: below the first full steps converge quadratically, above the second ε fell too fast."""

MOST_PASSES = 3000
"""A scene takes some tens to some hundreds."""


@dataclass(slots=True)
class _Contact:
    """The contact in its own units: Σ c_i = 1, lengths over Σ c_i |r_i − centroid|, positions from ``about``."""

    c: list[Real]
    x: list[Real]
    y: list[Real]
    force: tuple[Real, Real]
    centroid: tuple[Real, Real]
    unit_n: Real
    unit_m: Real


@dataclass(slots=True)
class _Plane:
    """Twists origin + z_1 first + z_2 second, and the load whose work is taken off."""

    origin: Vector
    first: Vector
    second: Vector
    work: Vector

    def at(self, z: Vector) -> list[Real]:
        return [o + z[0] * a + z[1] * b for o, a, b in zip(self.origin, self.first, self.second, strict=True)]


def exact_limit(scene: Scene) -> float:
    """The largest spin torque along +Z beside the scene's force, N·m, rounded once (that along −Z: the force turned).

    Args:
        scene: Loads ≥ 0 that do not all vanish, everything finite.

    Returns:
        The limit; its infimum where R = μ; NaN where R > μ.

    Raises:
        ArithmeticError: The answer could not be enclosed to 25 digits.
    """
    with workdps(DIGITS):
        beyond = _beyond_translation(scene)
        if beyond > 0:
            return math.nan
        if beyond == 0 or _one_place(scene):
            return float(_only_field(scene))
        contact = _scaled(scene)
        zero, one = mpf(0), mpf(1)
        plane = _Plane((zero, zero, one), (one, zero, zero), (zero, one, zero), (*contact.force, zero))
        start = (contact.centroid[1], -contact.centroid[0])  # turning about the centroid
        twist, wrench = _least(contact, plane, start)
        upper = _dissipation(contact, twist) - _dot(plane.work, twist)
        _check(wrench[2], upper, mpf(1))
        return float(upper * contact.unit_n * contact.unit_m)


def exact_utilisation(scene: Scene, spin: float) -> float:
    """The least factor on all loads with which friction carries the scene's force and a spin torque about ``about``.

    Args:
        scene: Loads ≥ 0 that do not all vanish, everything finite.
        spin: N·m.

    Returns:
        λ, rounded once; 0 unloaded, inf when no grip holds it.

    Raises:
        ArithmeticError: The answer could not be enclosed to 25 digits.
    """
    if spin == 0.0 and not scene.tangential.any():
        return 0.0
    with workdps(DIGITS):
        if _one_place(scene):
            return float(mp.hypot(*_pair(scene.tangential)) / _grip(scene)) if _only_field(scene) == spin else math.inf
        contact = _scaled(scene)
        load = (*contact.force, mpf(spin) / (contact.unit_n * contact.unit_m))
        plane = _unit_work(load)
        twist, wrench = _least(contact, plane, (mpf(0), mpf(0)))
        lower, upper = 1 / _dissipation(contact, twist), 1 / _dot(wrench, plane.origin)
        _check(lower, upper, upper)
        return float(upper)


def _least(contact: _Contact, plane: _Plane, start: Vector) -> tuple[list[Real], list[Real]]:
    """Down the central path: the twist, and the wrench of an admissible field that balances it in the plane."""
    epsilon, last = mpf(1), mpf(LAST_EPSILON)
    z, tangent, passes = _centred(contact, plane, start, epsilon, _newton(contact, plane, start, epsilon), mpf(NEAR))
    fall, slowest = mpf("0.01"), mpf("0.1")
    while epsilon > last:
        lower = max(epsilon * fall, last)
        guess = [a + (epsilon - lower) * b for a, b in zip(z, tangent, strict=True)]
        newton = _newton(contact, plane, guess, lower)
        if newton[1] > TOO_FAR:
            passes += 1
            if fall < slowest:
                fall = min(mp.sqrt(fall), slowest)
                continue
            guess, newton = z, _newton(contact, plane, z, lower)
        z, tangent, steps = _centred(contact, plane, guess, lower, newton, mpf(NEAR) if lower > last else mpf(THERE))
        epsilon, passes = lower, passes + steps
        if passes > MOST_PASSES:
            raise ArithmeticError(f"not down the central path after {passes} passes")
        fall = fall**2 if steps <= 3 else fall
    return plane.at(z), _balanced(contact, plane, z, epsilon)


def _centred(
    contact: _Contact, plane: _Plane, z: Vector, epsilon: Real, newton: _Newton, until: Real
) -> tuple[Vector, list[Real], int]:
    """Damped Newton to the point of the path at ε; there, the path's direction (as ε falls), and the steps it took."""
    for steps in range(1, MOST_PASSES):
        step, decrement, tangent = newton
        damped = 1 + decrement if decrement > FULL_STEPS else 1
        z = [a - b / damped for a, b in zip(z, step, strict=True)]
        if decrement < until:
            return z, tangent, steps
        newton = _newton(contact, plane, z, epsilon)
    raise ArithmeticError(f"not on the central path after {MOST_PASSES} passes")


def _newton(contact: _Contact, plane: _Plane, z: Vector, epsilon: Real) -> _Newton:
    """Newton's step, its length in the metric of the Hessian, and the direction of the path."""
    gradient, hessian, slope = _smoothed(contact, plane, z, epsilon)
    step = _solved(hessian, gradient)
    return step, mp.sqrt(abs(_dot(gradient, step)) / epsilon), _solved(hessian, slope)


def _smoothed(contact: _Contact, plane: _Plane, z: Vector, epsilon: Real) -> tuple[list[Real], list[Real], list[Real]]:
    """Gradient and Hessian of the smoothed function in the plane, and the gradient's derivative by ε."""
    vx, vy, omega = plane.at(z)
    force, lag = [mpf(0)] * 3, [mpf(0)] * 3
    stiff = [mpf(0)] * 6
    for c, x, y in zip(contact.c, contact.x, contact.y, strict=True):
        ex, ey = vx - omega * y, vy + omega * x
        square = c * c
        root = mp.sqrt(epsilon * epsilon + square * (ex * ex + ey * ey))
        whole = epsilon + root
        k = square / whole
        tx, ty = k * ex, k * ey
        _add(force, tx, ty, x, y)
        late = (1 + epsilon / root) / whole
        _add(lag, -late * tx, -late * ty, x, y)
        share = square / (root * whole)
        hxx, hxy, hyy = k - share * tx * ex, -share * tx * ey, k - share * ty * ey
        hxo, hyo = x * hxy - y * hxx, x * hyy - y * hxy
        for n, term in enumerate((hxx, hxy, hyy, hxo, hyo, x * hyo - y * hxo)):
            stiff[n] += term
    total = [a - b for a, b in zip(force, plane.work, strict=True)]
    axes = plane.first, plane.second
    xx, xy, yy, xo, yo, oo = stiff
    rows = (xx, xy, xo), (xy, yy, yo), (xo, yo, oo)
    bent = [[_dot(row, axis) for row in rows] for axis in axes]
    hessian = [_dot(axes[0], bent[0]), _dot(axes[0], bent[1]), _dot(axes[1], bent[1])]
    return [_dot(axis, total) for axis in axes], hessian, [_dot(axis, lag) for axis in axes]


def _balanced(contact: _Contact, plane: _Plane, z: Vector, epsilon: Real) -> list[Real]:
    """The wrench of the field, after what Newton left is shared out over what each taxel can still take."""
    vx, vy, omega = plane.at(z)
    field, slack = [], []
    for c, x, y in zip(contact.c, contact.x, contact.y, strict=True):
        ex, ey = vx - omega * y, vy + omega * x
        whole = epsilon + mp.sqrt(epsilon * epsilon + c * c * (ex * ex + ey * ey))
        tx, ty = c * c * ex / whole, c * c * ey / whole
        field.append((tx, ty))
        slack.append(c - mp.hypot(tx, ty))
    wrench, stiff = [mpf(0)] * 3, [mpf(0)] * 3
    pulls = []
    for (tx, ty), s, x, y in zip(field, slack, contact.x, contact.y, strict=True):
        _add(wrench, tx, ty, x, y)
        (ax, ay), (bx, by) = ((a[0] - a[2] * y, a[1] + a[2] * x) for a in (plane.first, plane.second))
        pulls.append((ax, ay, bx, by))
        stiff = [h + s * term for h, term in zip(stiff, (ax * ax + ay * ay, ax * bx + ay * by, bx * bx + by * by),
                                                 strict=True)]  # fmt: skip
    missing = [_dot(axis, plane.work) - _dot(axis, wrench) for axis in (plane.first, plane.second)]
    p, q = _solved(stiff, missing)
    wrench = [mpf(0)] * 3
    for (tx, ty), s, (ax, ay, bx, by), c, x, y in zip(
        field, slack, pulls, contact.c, contact.x, contact.y, strict=True
    ):
        fx, fy = tx + s * (p * ax + q * bx), ty + s * (p * ay + q * by)
        if fx * fx + fy * fy > c * c:
            raise ArithmeticError("the field does not balance")
        _add(wrench, fx, fy, x, y)
    return wrench


def _unit_work(load: Vector) -> _Plane:
    """All twists with which the load does work 1."""
    size = _dot(load, load)
    big = max(range(3), key=lambda n: abs(load[n]))
    axes = []
    for n in range(3):
        if n != big:
            axis = [mpf(0)] * 3
            axis[n], axis[big] = mpf(1), -load[n] / load[big]
            axes.append(axis)
    return _Plane([a / size for a in load], axes[0], axes[1], (mpf(0),) * 3)


def _scaled(scene: Scene) -> _Contact:
    on = scene.loads > 0.0
    ax, ay = _pair(scene.about)
    c = [mpf(float(load)) for load in scene.loads[on]]
    total = mp.fsum(c)
    c = [load / total for load in c]
    x, y = [mpf(float(a)) - ax for a in scene.x[on]], [mpf(float(a)) - ay for a in scene.y[on]]
    gx, gy = mp.fdot(c, x), mp.fdot(c, y)
    unit_m = mp.fdot(c, [mp.hypot(a - gx, b - gy) for a, b in zip(x, y, strict=True)])
    unit_n = mpf(scene.mu) * total
    fx, fy = _pair(scene.tangential)
    return _Contact(
        c,
        [a / unit_m for a in x],
        [b / unit_m for b in y],
        (fx / unit_n, fy / unit_n),
        (gx / unit_m, gy / unit_m),
        unit_n,
        unit_m,
    )


def _dissipation(contact: _Contact, twist: Vector) -> Real:
    vx, vy, omega = twist
    places = zip(contact.x, contact.y, strict=True)
    return mp.fdot(contact.c, [mp.hypot(vx - omega * y, vy + omega * x) for x, y in places])


def _check(lower: Real, upper: Real, scale: Real) -> None:
    if not 0 <= upper - lower + mpf("1e-60") * scale <= mpf(GAP) * scale:
        raise ArithmeticError(f"enclosed to {float((upper - lower) / scale):.1e} of the scale only")


def _beyond_translation(scene: Scene) -> Fraction:
    """R² − μ² times the load's square, exactly: negative inside the friction circle."""
    grip = Fraction(scene.mu) * sum(map(Fraction, scene.loads.tolist()))
    fx, fy = map(Fraction, scene.tangential.tolist())
    return fx * fx + fy * fy - grip * grip


def _one_place(scene: Scene) -> bool:
    on = scene.loads > 0.0
    return bool(np.ptp(scene.x[on]) == 0.0 and np.ptp(scene.y[on]) == 0.0)


def _only_field(scene: Scene) -> Real:
    """Torque of friction that is everywhere along the force: all that can be at R = μ, and in one place."""
    shares = [mpf(float(load)) for load in scene.loads]
    (ax, ay), (fx, fy) = _pair(scene.about), _pair(scene.tangential)
    levers = [(mpf(float(x)) - ax) * fy - (mpf(float(y)) - ay) * fx for x, y in zip(scene.x, scene.y, strict=True)]
    return mp.fdot(shares, levers) / mp.fsum(shares)


def _grip(scene: Scene) -> Real:
    return mpf(scene.mu) * mp.fsum(mpf(float(load)) for load in scene.loads)


def _pair(value: np.ndarray[Any, Any]) -> tuple[Real, Real]:
    return mpf(float(value[0])), mpf(float(value[1]))


def _add(wrench: list[Real], fx: Real, fy: Real, x: Real, y: Real) -> None:
    wrench[0] += fx
    wrench[1] += fy
    wrench[2] += x * fy - y * fx


def _dot(a: Vector, b: Vector) -> Real:
    return sum((p * q for p, q in zip(a, b, strict=True)), mpf(0))


def _solved(matrix: Vector, right: Vector) -> list[Real]:
    """Of a symmetric matrix xx, xy, yy."""
    xx, xy, yy = matrix
    determinant = xx * yy - xy * xy
    return [(yy * right[0] - xy * right[1]) / determinant, (xx * right[1] - xy * right[0]) / determinant]
