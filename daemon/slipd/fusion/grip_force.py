"""The least normal force that holds a load: what a gripper should be asked for."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from slipd.fusion.limit_kernels import solve_grip_factor
from slipd.fusion.limit_surface import checked_pair, checked_taxels


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
        The normal force, N, from the certified upper bound of λ; inf when no force holds the load, NaN when the data is
        not finite.

    Raises:
        ValueError: Wrong shapes, μ not positive and finite, a negative growth, a safety below 1.
    """
    if not (0.0 <= growth < math.inf and 1.0 <= safety < math.inf):
        raise ValueError(f"growth must be ≥ 0 and safety ≥ 1, not {growth} and {safety}")
    xs, ys, fs = checked_taxels(x, y, loads, mu)
    f, a = checked_pair("tangential", tangential), checked_pair("about", about)
    factor = solve_grip_factor(xs, ys, fs, mu, safety * f[0], safety * f[1], safety * float(spin), a[0], a[1], growth)
    return factor * float(fs.sum()) if math.isfinite(factor) else factor
