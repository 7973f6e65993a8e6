"""The friction limit of a contact given by taxels: paper eqs. (5)–(7) as one convex problem, with certified answers.

The pole that (5) seeks minimises Φ(P) = μ Σ F_i |r_i − P| + (P − C) × f_t, and by duality the minimum *is* the largest
spin torque about C that friction carries beside f_t; (7), the perfect hinge, is the optimality condition where Φ has a
kink. (6) as printed compares a torque about C with one about the pole, which calls sliding contacts safe: not used.

Every answer is bracketed: any pole gives an upper bound of what friction can carry, any admissible friction field
(|t_i| ≤ μ F_i) a lower one. Both are widened by the rounding of their own sums.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipd.fusion.limit_kernels import (
    GOAL,
    KINDS,
    MAX_PASSES,
    Twist,
    follow_utilisation,
    solve_torque_limit,
    solve_utilisation,
)

Array = NDArray[np.float64]
_NO_TWIST = (math.nan, math.nan, math.nan)


class TorqueLimit(NamedTuple):
    """The largest spin torque that friction carries beside a tangential force.

    Attributes:
        torque_nm: The limit about ``about`` in the given sense, N·m; negative where friction already needs the other
            sense; NaN for kind "none", and for "translating" when R > μ.
        lower_nm: Certified lower bound, N·m.
        upper_nm: Certified upper bound, N·m.
        pole_m: Velocity pole of the motion that would begin, shape (2,), m; None when translating or without load.
        kind: "interior", "hinge" (the pole is a taxel), "translating" (R ≥ μ) or "none" (no load, or data that is
            not finite or negative).
    """

    torque_nm: float
    lower_nm: float
    upper_nm: float
    pole_m: Array | None
    kind: str


class Utilisation(NamedTuple):
    """How much of the friction limit a load uses.

    Attributes:
        value: λ, the least factor on all normal forces with which friction carries the load: 0 unloaded, 1 when slip
            begins, inf when no grip holds it; NaN when unknown (data that is not finite or negative).
        lower: Certified lower bound.
        upper: Certified upper bound.
        pole_m: Velocity pole of the motion that would begin, shape (2,), m; None when there is none.
        kind: "interior", "hinge", "translating" (the motion is a translation) or "none" (nothing to carry, or nothing
            to carry it).
        twist: The motion that would begin: velocity of the point ``about`` (2) and angular velocity, in m/s and rad/s
            but for a common factor; NaN when there is none.
    """

    value: float
    lower: float
    upper: float
    pole_m: Array | None
    kind: str
    twist: Twist


NO_UTILISATION = Utilisation(math.nan, math.nan, math.nan, None, "none", _NO_TWIST)


def torque_limit(
    x: ArrayLike,
    y: ArrayLike,
    loads: ArrayLike,
    mu: float,
    tangential: ArrayLike,
    about: ArrayLike,
    sense: int = 1,
    *,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> TorqueLimit:
    """Finds the largest spin torque that friction carries beside a tangential force.

    The admissible spin about ``about`` is the interval [−limit(sense=−1), limit(sense=+1)].

    Args:
        x: Taxel centres in the pad frame, shape (n,), m.
        y: Likewise, shape (n,), m.
        loads: Normal force on each taxel, shape (n,), N.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (2,), N.
        about: The point the torque is taken about, shape (2,), m.
        sense: +1 for a torque along +Z, −1 for one along −Z.
        gap: Gap of the bounds at which to stop, relative to the contact's torque without force.
        passes: Most passes over the taxels; the bounds hold after any number, and meet after 3–7, at a hinge some 20.

    Returns:
        The limit with its certified bounds. Data that is not finite, a negative load, and no load at all give kind
        "none" and NaN.

    Raises:
        ValueError: Wrong shapes, μ not positive and finite, a sense other than ±1.

    Source: paper eqs. (5) and (7) as the minimum of Φ; its (6) with the torque taken about the pole.
    """
    xs, ys, fs = checked_taxels(x, y, loads, mu)
    f, a = checked_pair("tangential", tangential), checked_pair("about", about)
    if sense not in (1, -1):
        raise ValueError(f"sense must be +1 or -1, not {sense}")
    kind, value, lower, upper, px, py = solve_torque_limit(xs, ys, fs, mu, f[0], f[1], a[0], a[1], sense, gap, passes)
    return TorqueLimit(value, lower, upper, _pole(px, py), KINDS[kind])


def utilisation(
    x: ArrayLike,
    y: ArrayLike,
    loads: ArrayLike,
    mu: float,
    tangential: ArrayLike,
    spin: float,
    about: ArrayLike,
    *,
    start: Twist | None = None,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> Utilisation:
    """Finds which share of the friction limit a tangential force and a spin torque use together.

    Args:
        x: Taxel centres in the pad frame, shape (n,), m.
        y: Likewise, shape (n,), m.
        loads: Normal force on each taxel, shape (n,), N.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (2,), N.
        spin: Torque about the pad normal through ``about``, N·m.
        about: The point the spin is taken about, shape (2,), m.
        start: A twist to start from, such as that of the frame before: a scene that moves little needs fewer passes.
        gap: Relative gap of the bounds at which to stop.
        passes: Most passes over the taxels; the bounds hold after any number.

    Returns:
        The gauge λ of the limit surface with its certified bounds; λ · Σ loads is the least normal force that holds
        this load with this pressure shape.

    Raises:
        ValueError: Wrong shapes, or μ not positive and finite.
    """
    xs, ys, fs = checked_taxels(x, y, loads, mu)
    f, a = checked_pair("tangential", tangential), checked_pair("about", about)
    return utilisation_of(xs, ys, fs, mu, f, float(spin), a, start=start, gap=gap, passes=passes)


def utilisation_of(
    x: Array,
    y: Array,
    loads: Array,
    mu: float,
    tangential: tuple[float, float],
    spin: float,
    about: tuple[float, float],
    *,
    start: Twist | None = None,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> Utilisation:
    """`utilisation` for what needs no checking: contiguous float64 arrays of one shape, floats, a positive μ."""
    return utilisation_told(
        solve_utilisation(
            x, y, loads, mu, tangential[0], tangential[1], spin, about[0], about[1], start or _NO_TWIST, gap, passes
        )
    )


def follow_readings(
    x: Array,
    y: Array,
    shares: Array,
    mu: float,
    contacts: Array,
    start: Twist | None,
    gap: float,
) -> Array:
    """`utilisation` of readings that follow each other, each started from the one before; nothing is checked.

    Args:
        x: Centres of the active taxels, shape (k,), contiguous float64, m.
        y: Likewise, shape (k,), m.
        shares: Load on each for a normal force of 1 N, shape (k,).
        mu: Coefficient of static friction.
        contacts: As from `find_contacts`, shape (n, 15).
        start: Twist of the reading before; None where there is none.
        gap: Relative gap of the bounds at which to stop.

    Returns:
        A row of numbers each, of which `utilisation_told` makes a `Utilisation`, shape (n, 9); NaN for readings that do
        not touch. Of a row, 1 is λ, 2 and 3 are its bounds.
    """
    return follow_utilisation(x, y, shares, mu, contacts, start or _NO_TWIST, gap, MAX_PASSES)


def utilisation_told(row: Sequence[float]) -> Utilisation:
    """Makes a `Utilisation` of a row of numbers."""
    kind, value, lower, upper, px, py, vx, vy, om = row
    if math.isnan(kind):
        return NO_UTILISATION
    return Utilisation(value, lower, upper, _pole(px, py), KINDS[int(kind)], (vx, vy, om))


def _pole(px: float, py: float) -> Array | None:
    return None if math.isnan(px) else np.array((px, py))


def checked_pair(name: str, value: ArrayLike) -> tuple[float, float]:
    """Two numbers of an array-like of shape (2,)."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (2,):
        raise ValueError(f"{name} must have shape (2,), not {array.shape}")
    first, second = array.tolist()
    return first, second


def checked_taxels(x: ArrayLike, y: ArrayLike, loads: ArrayLike, mu: float) -> tuple[Array, Array, Array]:
    """Positions and loads as arrays of one shape (n,)."""
    xs = np.ascontiguousarray(x, dtype=np.float64)
    ys = np.ascontiguousarray(y, dtype=np.float64)
    fs = np.ascontiguousarray(loads, dtype=np.float64)
    if xs.ndim != 1 or not xs.shape == ys.shape == fs.shape:
        raise ValueError(f"x, y and loads must share one shape (n,), not {xs.shape}, {ys.shape}, {fs.shape}")
    if not 0.0 < mu < math.inf:
        raise ValueError(f"mu must be positive and finite, not {mu}")
    return xs, ys, fs
