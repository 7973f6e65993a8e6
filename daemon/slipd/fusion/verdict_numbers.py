"""The numbers of the verdict on one reading, with what its load needs: all that a message states, in one call.

`slipd.fusion.streaming` has judged the reading; what only a message needs is solved here.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.friction_learning import Z
from slipd.fusion.limit.frame import Load
from slipd.fusion.limit.grip_factor import solve_grip_factor
from slipd.fusion.limit.solve import GOAL, MAX_PASSES, Stop, torque_limit_of
from slipd.fusion.rows import TOUCHING, UNSOLVED, UNTRUSTED, Rows
from slipd.types.arrays import Array

MODELS = ("none", "translation", "exact")
"""What a utilisation takes into account."""
NONE, TRANSLATION, EXACT = range(3)
VerdictNumbers = namedtuple(
    "VerdictNumbers",
    "model normal_n fx_n fy_n spin_nm cx_m cy_m cx_std_m cy_std_m friction_ratio friction_ratio_std required_friction"
    " utilisation utilisation_lower utilisation_upper pole_x_m pole_y_m tipping_margin_m torque_limit_nm needed_n",
)
"""What `find_numbers` finds, in its order; None is unknown.

``model`` is an index of MODELS, ``f`` the tangential force, ``c`` the contact centroid, ``torque_limit_nm`` the torque
that friction carries in the sense of the spin, ``needed_n`` the least normal force that holds the load.
"""
UNKNOWN_NUMBERS = VerdictNumbers(NONE, *(None,) * 19)
"""Where there is no reading."""


@compiled
def find_numbers(
    reading: Rows, x: Array, y: Array, shares: Array, mu: float, spin_scale: float, force_std: float, torque_std: float,
    safety: float, growth: float,
) -> tuple[Any, ...]:  # fmt: skip
    """Find the numbers of the verdict on one reading; one that is not known is not finite.

    Args:
        reading: One judged row of READING, shape (1,).
        x: Centres of the active taxels, shape (k,), contiguous, m; k = 0 without an image.
        y: Likewise, shape (k,), m.
        shares: Load on each for a normal force of 1 N, shape (k,).
        mu: Coefficient of friction; NaN if unknown.
        spin_scale: How many times as much friction a spin uses.
        force_std: Standard deviation of each force component, N; 0 where it is not known.
        torque_std: Standard deviation of each torque component, N·m; likewise.
        safety: Factor on the load that has to be held.
        growth: Exponent with which the contact grows, see `slipd.fusion.limit.grip_factor.solve_grip_factor`.

    Returns:
        The fields of `VerdictNumbers`.
    """
    nan, row = math.nan, reading[0]
    contact, used, found, twist = row["contact"], row["utilisation"], row["assessment"], row["utilisation"]["twist"]
    normal, fx, fy, spin = contact["normal_n"], contact["fx_n"], contact["fy_n"], contact["spin_nm"]
    cx, cy, cx_std, cy_std = contact["cx_m"], contact["cy_m"], contact["cx_std_m"], contact["cy_std_m"]
    ratio, ratio_std, margin = contact["friction_ratio"], contact["friction_ratio_std"], row["tipping_margin_m"]
    value, lower, upper, px, py, torque_limit, needed = nan, nan, nan, nan, nan, nan, nan
    exact = used["kind"] != UNSOLVED and not math.isnan(spin)
    if exact:
        px, py = used["pole_m"]
    if exact and mu > 0.0:
        value, lower, upper, loads = used["value"], used["lower"], used["upper"], shares * normal
        motion = (twist[0], twist[1], twist[2])
        held = safety * (1.0 + Z * relative_noise((fx, fy), spin, (cx, cy), motion, force_std, torque_std))
        factor = solve_grip_factor(x, y, loads, mu, held * fx, held * fy, held * (spin * spin_scale), cx, cy, growth)
        load, sense, stop = Load(fx, fy, 0.0, cx, cy), 1 if spin >= 0.0 else -1, Stop(GOAL, MAX_PASSES)
        limit = torque_limit_of(x, y, loads, mu, load, sense, stop, np.empty((3, x.size)))
        torque_limit = limit.torque / spin_scale
        needed = factor * _sum(loads)
    if row["phase"] == UNTRUSTED:
        normal = nan
    if not contact["valid"]:
        fx, fy = nan, nan
    model = NONE
    if row["phase"] == TOUCHING and not math.isnan(mu):
        model = EXACT if exact else TRANSLATION
    return (
        model, normal, fx, fy, spin, cx, cy, cx_std, cy_std, ratio, ratio_std,
        found["required_friction"], value, lower, upper, px, py, margin, torque_limit, needed,
    )  # fmt: skip


@compiled_part
def _sum(values: Array) -> float:
    """Return the sum of up to 128 values to the last bit as NumPy does: in eight parts, then the rest."""
    parts, rest = np.zeros(8), values.size % 8
    for k in range(values.size - rest):
        parts[k % 8] += values[k]
    total = ((parts[0] + parts[1]) + (parts[2] + parts[3])) + ((parts[4] + parts[5]) + (parts[6] + parts[7]))
    for k in range(values.size - rest, values.size):
        total += values[k]
    return float(total)


@compiled
def relative_noise(
    force: tuple[float, float], spin: float, about: tuple[float, float], twist: tuple[float, float, float],
    force_std: float, torque_std: float,
) -> float:  # fmt: skip
    """Return the relative standard deviation of a utilisation; 0 where no motion is known that would begin.

    The gradient of λ with respect to the load is the motion that would begin, over its frictional power. Components of
    force and torque about the pad's origin have independent noise.

    Args:
        force: Tangential force, N.
        spin: Torque about the pad normal through ``about``, N·m.
        about: Centroid of the contact, m.
        twist: Velocity of that point (2) and angular velocity of the motion that would begin.
        force_std: Standard deviation of each force component, N.
        torque_std: Standard deviation of each torque component, N·m.

    Source: envelope theorem on λ = max ℓ·q / D(q).
    """
    vx, vy, omega = twist
    power = abs(force[0] * vx + force[1] * vy + spin * omega)
    if not power > 0.0:
        return 0.0
    origin = math.hypot(vx + omega * about[1], vy - omega * about[0])
    return math.hypot(origin * force_std, omega * torque_std) / power
