"""The least normal force that holds a load: what a gripper should be asked for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from slipd.fusion.limit_surface import utilisation

#: A grip force is not needed to more digits than any gripper has.
RELATIVE_TOLERANCE = 1e-6


def grip_needed_n(
    x: ArrayLike,
    y: ArrayLike,
    loads: ArrayLike,
    mu: float,
    tangential: ArrayLike,
    spin: float,
    about: ArrayLike,
    *,
    growth: float = 0.0,
    safety: float = 1.0,
) -> float:
    """Finds the least normal force that holds a load with a contact that grows as it is pressed.

    A rigid contact keeps its shape, so λ · f_n is the answer. A compliant one grows: its size goes like
    (f / f_n)^growth about the load centroid, and the larger contact resists more spin.

    Args:
        x: Taxel centres in the pad frame, shape (n,), m.
        y: Likewise, shape (n,), m.
        loads: Normal force on each taxel, shape (n,), N.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (2,), N.
        spin: Torque about the pad normal through ``about``, N·m.
        about: The point the spin is taken about, shape (2,), m.
        growth: Exponent γ ≥ 0 of the contact's size; 0 is rigid, 1/3 Hertz.
        safety: Factor ≥ 1 on the load.

    Returns:
        The normal force, N; inf when no force holds the load, NaN when the data is not finite.

    Raises:
        ValueError: Wrong shapes, μ not positive and finite, a negative growth, a safety below 1.
    """
    if not (0.0 <= growth < math.inf and 1.0 <= safety < math.inf):
        raise ValueError(f"growth must be ≥ 0 and safety ≥ 1, not {growth} and {safety}")
    f = safety * np.asarray(tangential, dtype=np.float64)
    forces = np.asarray(loads, dtype=np.float64)
    rigid = utilisation(x, y, forces, mu, f, safety * spin, about).value
    normal = float(forces.sum())
    if normal == 0.0:
        return rigid  # nothing presses: no load needs nothing, any load more than no contact has
    if growth == 0.0 or rigid in (0.0, math.inf) or math.isnan(rigid):
        return rigid * normal if rigid > 0.0 else rigid
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if np.ptp(xs[forces > 0.0]) == np.ptp(ys[forces > 0.0]) == 0.0:  # a point has no size that could grow
        return rigid * normal
    centre = np.array((xs @ forces, ys @ forces)) / normal
    a = np.asarray(about, dtype=np.float64)
    spin_there = safety * spin + (a[0] - centre[0]) * f[1] - (a[1] - centre[1]) * f[0]

    def excess(log_factor: float) -> float:
        """Log of the factor still missing when the contact has grown by exp(growth · log_factor)."""
        shrunk = spin_there * math.exp(-growth * log_factor)
        return math.log(utilisation(xs, ys, forces, mu, f, shrunk, centre).value) - log_factor

    # A larger contact carries more of the spin and as much of the force, so the root lies between here and rigid.
    low, high = sorted((0.0, math.log(rigid)))
    while (missing := excess(low)) < 0.0:
        low -= 1.0
    while missing < math.inf and (missing := excess(high)) > 0.0:
        high += 1.0
    if missing == math.inf:  # all but one taxel carry next to nothing, and the rounding of its place is a torque
        return rigid * normal
    root = low if low == high else float(brentq(excess, low, high, xtol=RELATIVE_TOLERANCE))
    return normal * math.exp(root)
