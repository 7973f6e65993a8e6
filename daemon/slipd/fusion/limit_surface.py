"""The friction limit of a contact given by taxels: paper eqs. (5) to (7) as one convex problem, with certified answers.

The pole that (5) seeks minimises Φ(P) = μ Σ F_i |r_i − P| + (P − C) × f_t. By duality the minimum *is* the largest spin
torque about C that friction carries beside f_t. Eq. (7), the perfect hinge, is the optimality condition where Φ has a
kink. Eq. (6) as printed compares a torque about C with one about the pole, which calls sliding contacts safe; it is not
used.

Every answer is bracketed: any pole gives an upper bound of what friction can carry, any admissible friction field
(|t_i| ≤ μ F_i) a lower bound. Both are widened by the rounding of their own sums. The method is in
`slipd.fusion.limit`; `slipd.fusion.limit_batch` answers the same questions for many frames.

Every question takes arrays, ``(x, y, loads, mu, tangential, spin, about)``, or ``(contact, loads, mu)``.
"""

from __future__ import annotations

import math
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from slipd.fusion.contact import Contact, not_numbers
from slipd.fusion.hull import Outline
from slipd.fusion.limit.grip_factor import solve_grip_factor
from slipd.fusion.limit.solve import (
    GOAL,
    KINDS,
    MAX_PASSES,
    NO_TWIST,
    solve_torque_limit,
    solve_utilisation,
)
from slipd.fusion.loads import Loads
from slipd.types.arrays import Array

Twist = tuple[float, float, float]


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
            up to a common factor; NaN when there is none.
    """

    value: float
    lower: float
    upper: float
    pole_m: Array | None
    kind: str
    twist: Twist


def torque_limit(
    x: ArrayLike | Contact,
    y: ArrayLike | Loads,
    loads: ArrayLike | Loads,
    mu: float | None = None,
    tangential: ArrayLike | None = None,
    about: ArrayLike | None = None,
    sense: int = 1,
    *,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> TorqueLimit:
    """Find the largest spin torque that friction carries beside a tangential force.

    The admissible spin about ``about`` is the interval [−limit(sense=−1), limit(sense=+1)].

    Args:
        x: Taxel centres in the pad frame, shape (n,), m; or the contact, and then only its loads and μ follow.
        y: Taxel centres in the pad frame, shape (n,), m.
        loads: Normal force on each taxel, shape (n,), N.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (2,), N.
        about: The point that the torque refers to, shape (2,), m.
        sense: +1 for a torque along +Z, −1 for one along −Z.
        gap: Gap of the bounds at which to stop, relative to the contact's torque without force.
        passes: Most passes over the taxels; the bounds hold after any number, and meet after 3–7, at a hinge some 20.

    Returns:
        The limit with its certified bounds. Data that is not finite, a negative load, and no load at all give kind
        "none" and NaN.

    Raises:
        ValueError: A shape is wrong, μ is not positive and finite, or the sense is not ±1.
        TypeError: An argument is missing, or not numbers.

    Source: paper eqs. (5) and (7) as the minimum of Φ; its (6) with the torque taken about the pole.

    >>> round(torque_limit([-0.01, 0.01], [0.0, 0.0], [2.0, 2.0], 0.5, (0.0, 0.0), (0.0, 0.0)).torque_nm, 9)
    0.02
    """
    xs, ys, fs, friction, fx, fy, _, ax, ay = _checked(x, y, loads, mu, tangential, 0.0, about)
    if sense not in (1, -1):
        raise ValueError(f"sense must be +1 or -1, got {sense}")
    kind, value, lower, upper, px, py = solve_torque_limit(xs, ys, fs, friction, fx, fy, ax, ay, sense, gap, passes)
    return TorqueLimit(value, lower, upper, pole_or_none(px, py), KINDS[kind])


def utilisation(
    x: ArrayLike | Contact,
    y: ArrayLike | Loads,
    loads: ArrayLike | Loads,
    mu: float | None = None,
    tangential: ArrayLike | None = None,
    spin: float | None = None,
    about: ArrayLike | None = None,
    *,
    start: Twist | None = None,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> Utilisation:
    """Find which share of the friction limit a tangential force and a spin torque use together.

    Args:
        x: As in `torque_limit`.
        y: As in `torque_limit`.
        loads: As in `torque_limit`.
        mu: As in `torque_limit`.
        tangential: As in `torque_limit`.
        spin: Torque about the pad normal through ``about``, N·m.
        about: As in `torque_limit`.
        start: A twist to start from, such as that of the previous frame; any twist gives the same answer.
        gap: Relative gap of the bounds at which to stop.
        passes: As in `torque_limit`.

    Raises:
        ValueError: A shape is wrong, or μ is not positive and finite.
        TypeError: An argument is missing, or not numbers.

    >>> from slipd.fusion import contact_from_wrench, matched_loads
    >>> contact = contact_from_wrench(force=(1.0, 0.0, -4.0), torque=(0.0, 0.0, 0.0))
    >>> loads = matched_loads([-0.01, 0.01], [0.0, 0.0], [1.0, 1.0], contact)
    >>> round(utilisation(contact, loads, 0.5).value, 9)
    0.5
    """
    xs, ys, fs, friction, fx, fy, m, ax, ay = _checked(x, y, loads, mu, tangential, spin, about)
    vx, vy, omega = NO_TWIST if start is None else start
    kind, value, lower, upper, px, py, vx, vy, omega = solve_utilisation(
        xs, ys, fs, friction, fx, fy, m, ax, ay, vx, vy, omega, gap, passes
    )
    return Utilisation(value, lower, upper, pole_or_none(px, py), KINDS[kind], (vx, vy, omega))


def grip_needed_n(
    x: ArrayLike | Contact,
    y: ArrayLike | Loads,
    loads: ArrayLike | Loads,
    mu: float | None = None,
    tangential: ArrayLike | None = None,
    spin: float | None = None,
    about: ArrayLike | None = None,
    *,
    growth: float = 0.0,
    safety: float = 1.0,
) -> float:
    """Find the least normal force that holds a load with a contact that grows as it is pressed.

    A rigid contact keeps its shape, so λ · f_n is the answer. A compliant one grows: its size is proportional to
    (f / f_n)^growth about the load centroid, and the larger contact resists more spin.

    Args:
        x: As in `utilisation`, like all but the last two.
        y: Likewise.
        loads: Likewise.
        mu: Likewise.
        tangential: Likewise.
        spin: Likewise.
        about: Likewise.
        growth: Exponent γ ≥ 0 of the contact's size; 0 is rigid, 1/3 is Hertz.
        safety: Factor ≥ 1 on the load.

    Returns:
        The normal force, N, from the certified upper bound of λ; inf when no force holds the load, NaN when the data is
        not finite.

    Raises:
        ValueError: A shape is wrong, μ is not positive and finite, the growth is negative, or the safety is below 1.
        TypeError: An argument is missing, or not numbers.

    >>> round(grip_needed_n([0.0, 0.01], [0.0, 0.0], [1.0, 1.0], 0.5, (2.0, 0.0), 0.0, (0.005, 0.0), safety=1.5), 9)
    6.0
    """
    if not (0.0 <= growth < math.inf and 1.0 <= safety < math.inf):
        raise ValueError(f"growth must be ≥ 0 and safety ≥ 1, got {growth} and {safety}")
    xs, ys, fs, friction, fx, fy, m, ax, ay = _checked(x, y, loads, mu, tangential, spin, about)
    factor = solve_grip_factor(xs, ys, fs, friction, safety * fx, safety * fy, safety * m, ax, ay, growth)
    return factor * float(fs.sum()) if math.isfinite(factor) else factor


def tipping_margin(x: ArrayLike | Contact, y: ArrayLike | Loads, point: ArrayLike | None = None) -> float:
    """Find how far a point lies inside the hull of the active taxels.

    The hull of one taxel or of collinear taxels has no inside. A taxel senses over its electrode, so the hull is
    uncertain by half a pitch.

    Args:
        x: Centres of the active taxels, shape (n,), m; or the contact, and then only its loads follow.
        y: Likewise, shape (n,), m.
        point: The contact centroid, shape (2,), m.

    Returns:
        Signed distance to the hull, m, positive inside; NaN without taxels or with data that is not finite.

    Raises:
        ValueError: A shape is wrong.
        TypeError: An argument is missing, or not numbers.

    Source: paper, last paragraph of the integration section.

    >>> tipping_margin([0.0, 0.02, 0.02, 0.0], [0.0, 0.0, 0.01, 0.01], (0.004, 0.005))
    0.004
    """
    if isinstance(x, Contact):
        taxels_x, taxels_y, loads = _placed(y)
        return tipping_margin(taxels_x[loads > 0.0], taxels_y[loads > 0.0], x.centroid_m)
    try:
        xs, ys, p = (np.asarray(value, np.float64) for value in (x, y, point))
    except (TypeError, ValueError):
        raise not_numbers(x=x, y=y, point=point) from None
    if xs.ndim != 1 or xs.shape != ys.shape or p.shape != (2,):
        raise ValueError(f"x and y must share one shape (n,) and point be (2,), got {xs.shape}, {ys.shape}, {p.shape}")
    if xs.size == 0 or not (np.isfinite(xs).all() and np.isfinite(ys).all() and np.isfinite(p).all()):
        return math.nan
    return Outline(xs, ys).margin_m(float(p[0]), float(p[1]))


def pole_or_none(px: float, py: float) -> Array | None:
    """Return a pole as an array, shape (2,); None where there is none (NaN)."""
    return None if math.isnan(px) else np.array((px, py))


def _placed(loads: object) -> tuple[Array, Array, Array]:
    """Return centres and loads of the taxels beside a contact."""
    if not isinstance(loads, Loads) or loads.x is None or loads.y is None:
        known = "of matched_loads, of binary_loads, or of grey_loads with x and y"
        raise TypeError(f"loads beside a Contact must be Loads with their places, {known}; got {type(loads).__name__}")
    return loads.x, loads.y, loads.loads


def _checked(
    x: ArrayLike | Contact,
    y: ArrayLike | Loads,
    loads: ArrayLike | Loads,
    mu: float | None,
    tangential: ArrayLike | None,
    spin: float | None,
    about: ArrayLike | None,
) -> tuple[Array, Array, Array, float, float, float, float, float, float]:
    """Return taxels, friction, load and its point as the kernels take them."""
    if isinstance(x, Contact):
        friction = cast("float", loads if mu is None else mu)
        return _checked(*_placed(y), friction, (x.fx_n, x.fy_n), x.spin_nm, (x.cx_m, x.cy_m))
    forces = loads.loads if isinstance(loads, Loads) else loads
    try:
        xs = np.ascontiguousarray(x, np.float64)
        ys = np.ascontiguousarray(cast("ArrayLike", y), np.float64)
        fs = np.ascontiguousarray(forces, np.float64)
        force, point = np.asarray(tangential, np.float64), np.asarray(about, np.float64)
        friction, torque = float(cast("float", mu)), float(cast("float", spin))
    except (TypeError, ValueError):
        arguments = {"x": x, "y": y, "loads": forces, "mu": mu, "tangential": tangential, "spin": spin, "about": about}
        raise not_numbers(**arguments) from None
    if xs.ndim != 1 or not xs.shape == ys.shape == fs.shape:
        raise ValueError(f"x, y and loads must share one shape (n,), got {xs.shape}, {ys.shape}, {fs.shape}")
    if not 0.0 < friction < math.inf:
        raise ValueError(f"mu must be positive and finite, got {mu}")
    if force.shape != (2,):
        raise ValueError(f"tangential must have shape (2,), got {force.shape}")
    if point.shape != (2,):
        raise ValueError(f"about must have shape (2,), got {point.shape}")
    (fx, fy), (ax, ay) = force.tolist(), point.tolist()
    return xs, ys, fs, friction, fx, fy, torque, ax, ay
