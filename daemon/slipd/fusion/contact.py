"""The contact as the force sensor alone sees it: paper eqs. (1) to (4).

Eq. (3) is printed with ``M_x F_y`` in its last term. The moment balance M = C × F + (0, 0, m) gives ``M_x F_x``, which
is used here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array

DEFAULT_MIN_NORMAL_N = 0.2
"""Below this normal force, the error of the centroid (torque noise / normal force) exceeds the size of a fingertip."""

_SINGLE = ("mu", "spin", "normal_n")
"""Arguments that are one number."""


class Contact(NamedTuple):
    """A contact in the pad frame.

    Attributes:
        cx_m: C along X, m; NaN when not valid.
        cy_m: C along Y, m; likewise.
        cx_std_m: Standard deviation of ``cx_m`` from the given noise, m. It grows like torque noise / normal force
            towards lift-off. NaN when not valid.
        cy_std_m: Likewise for ``cy_m``.
        normal_n: f_n = −F_z, N, positive when pressed.
        fx_n: f_t along X on the finger, N.
        fy_n: f_t along Y on the finger, N.
        spin_nm: m, the torque about the pad normal through C, N·m; NaN when not valid.
        friction_ratio: R = |f_t| / f_n; NaN when not valid.
        friction_ratio_std: Standard deviation of R; NaN when not valid.
        valid: The wrench is finite and presses with at least the minimum normal force.
    """

    cx_m: float
    cy_m: float
    cx_std_m: float
    cy_std_m: float
    normal_n: float
    fx_n: float
    fy_n: float
    spin_nm: float
    friction_ratio: float
    friction_ratio_std: float
    valid: bool

    @property
    def centroid_m(self) -> Array:
        """C, shape (2,), m."""
        return np.array((self.cx_m, self.cy_m))

    @property
    def tangential_n(self) -> Array:
        """f_t = (F_x, F_y) on the finger, shape (2,), N."""
        return np.array((self.fx_n, self.fy_n))

    @property
    def tangential_norm_n(self) -> float:
        """|f_t|, N."""
        return math.hypot(self.fx_n, self.fy_n)


def contact_from_wrench(
    force: ArrayLike,
    torque: ArrayLike,
    *,
    min_normal_n: float = DEFAULT_MIN_NORMAL_N,
    force_std_n: float = 0.0,
    torque_std_nm: float = 0.0,
) -> Contact:
    """Find the contact centroid, forces and spin torque of a wrench on the pad.

    Args:
        force: F on the finger by the object in the pad frame, shape (3,), N.
        torque: M about the pad's origin in the pad frame, shape (3,), N·m.
        min_normal_n: Below this normal force there is no contact: the result is not valid.
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Standard deviation of each torque component, N·m.

    Returns:
        The contact. It is not valid where the wrench is not finite, pulls, or presses too little.

    Raises:
        ValueError: A shape is wrong, or ``min_normal_n`` is not positive and finite.
        TypeError: An argument is not numbers.

    Source: paper eqs. (1), (2), (3) corrected, (4).

    >>> contact = contact_from_wrench(force=(1.0, 0.0, -10.0), torque=(0.02, 0.05, 0.0))
    >>> contact.centroid_m.tolist(), contact.friction_ratio
    ([0.005, -0.002], 0.1)
    """
    try:
        f, t = np.asarray(force, dtype=np.float64), np.asarray(torque, dtype=np.float64)
    except (TypeError, ValueError):
        raise not_numbers(force=force, torque=torque) from None
    if f.shape != (3,) or t.shape != (3,):
        raise ValueError(f"force and torque must have shape (3,), got {f.shape} and {t.shape}")
    if not 0.0 < min_normal_n < math.inf:
        raise ValueError(f"min_normal_n must be positive and finite, got {min_normal_n}")
    return contact_of((*f.tolist(), *t.tolist()), min_normal_n, force_std_n, torque_std_nm)


def not_numbers(**arguments: object) -> TypeError:
    """Return the error that names the first of these arguments that is missing, not numbers, or not one."""
    for name, value in arguments.items():
        if value is None:
            return TypeError(f"{name} is missing")
        try:
            known = not isinstance(value, Contact) and np.asarray(value, dtype=np.float64) is not None
        except (TypeError, ValueError):
            known = False
        if not known:
            return TypeError(f"{name} must be numbers, got {type(value).__name__}")
    for name in _SINGLE:
        if shape := np.shape(cast("ArrayLike", arguments.get(name))):
            return TypeError(f"{name} must be one number, got an array of shape {shape}")
    return TypeError(f"{', '.join(arguments)} must be numbers")


def contact_of(
    wrench: Sequence[float], min_normal_n: float, force_std_n: float = 0.0, torque_std_nm: float = 0.0
) -> Contact:
    """Find the contact of six numbers, F in N and M in N·m, without checking them (see `contact_from_wrench`)."""
    fx, fy, fz, mx, my, mz = wrench
    normal = -fz
    if not (normal >= min_normal_n and math.isfinite(fx + fy + fz + mx + my + mz)):
        nan = math.nan
        return Contact(nan, nan, nan, nan, normal, fx, fy, nan, nan, nan, False)
    return Contact(*contact_numbers(fx, fy, normal, mx, my, mz, force_std_n, torque_std_nm), True)


@compiled
def contact_numbers(
    fx: float, fy: float, normal: float, mx: float, my: float, mz: float, force_std: float, torque_std: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Return the numbers of a valid `Contact`, (1) to (4), in the order of its fields."""
    cx, cy = my / normal, -mx / normal  # (1): C = (−M_y, M_x) / F_z
    ratio = math.hypot(fx, fy) / normal  # (4)
    return (
        cx,
        cy,
        math.hypot(torque_std, cx * force_std) / normal,
        math.hypot(torque_std, cy * force_std) / normal,
        normal,
        fx,
        fy,
        mz - (mx * fx + my * fy) / normal,  # (3), with F_x where the print has F_y
        ratio,
        force_std * math.hypot(1.0, ratio) / normal,
    )
