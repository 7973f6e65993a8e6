"""The contact as the force sensor alone sees it: paper eqs. (1)–(4).

The print of (3) has ``M_x F_y`` in its last term; the moment balance M = C × F + (0, 0, m) gives ``M_x F_x``, and that
is what stands here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Below this normal force the centroid's error (torque noise / normal force) exceeds the size of a fingertip.
DEFAULT_MIN_NORMAL_N = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """A contact in the pad frame.

    Attributes:
        centroid_m: C, shape (2,), m; NaN when not valid.
        centroid_std_m: One standard deviation of each coordinate of C, shape (2,), m, from the noise given; it grows
            like torque noise / normal force towards lift-off. NaN when not valid.
        normal_n: f_n = −F_z, N, positive when pressed.
        tangential_n: f_t = (F_x, F_y) on the finger, shape (2,), N.
        spin_nm: m, the torque about the pad normal through C, N·m; NaN when not valid.
        friction_ratio: R = |f_t| / f_n; NaN when not valid.
        valid: The wrench is finite and presses with at least the least normal force.
    """

    centroid_m: NDArray[np.float64]
    centroid_std_m: NDArray[np.float64]
    normal_n: float
    tangential_n: NDArray[np.float64]
    spin_nm: float
    friction_ratio: float
    valid: bool

    @property
    def tangential_norm_n(self) -> float:
        """|f_t|, N."""
        return math.hypot(self.tangential_n[0], self.tangential_n[1])


def contact_from_wrench(
    force: ArrayLike,
    torque: ArrayLike,
    *,
    min_normal_n: float = DEFAULT_MIN_NORMAL_N,
    force_std_n: float = 0.0,
    torque_std_nm: float = 0.0,
) -> Contact:
    """Finds the contact centroid, forces and spin torque of a wrench on the pad.

    Args:
        force: F on the finger by the object in the pad frame, shape (3,), N.
        torque: M about the pad's origin in the pad frame, shape (3,), N·m.
        min_normal_n: Below this normal force there is no contact: the result is not valid.
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Standard deviation of each torque component, N·m.

    Returns:
        The contact. A wrench that is not finite, or pulls, or presses too little gives one that is not valid.

    Raises:
        ValueError: Wrong shapes, or a least normal force that is not positive and finite.

    Source: paper eqs. (1), (2), (3) corrected, (4).
    """
    f = np.asarray(force, dtype=np.float64)
    t = np.asarray(torque, dtype=np.float64)
    if f.shape != (3,) or t.shape != (3,):
        raise ValueError(f"force and torque must have shape (3,), not {f.shape} and {t.shape}")
    if not 0.0 < min_normal_n < math.inf:
        raise ValueError(f"min_normal_n must be positive and finite, not {min_normal_n}")
    fx, fy, fz = f.tolist()
    mx, my, mz = t.tolist()
    normal = -fz
    if not (math.isfinite(fx + fy + fz + mx + my + mz) and normal >= min_normal_n):
        nan = math.nan
        unknown = np.array((nan, nan))
        return Contact(unknown, unknown, normal, f[:2].copy(), nan, nan, False)
    cx, cy = my / normal, -mx / normal  # (1): C = (−M_y, M_x) / F_z
    spin = mz - (mx * fx + my * fy) / normal  # (3), with F_x where the print has F_y
    ratio = math.hypot(fx, fy) / normal  # (4)
    centroid_std = (
        math.hypot(torque_std_nm, cx * force_std_n) / normal,
        math.hypot(torque_std_nm, cy * force_std_n) / normal,
    )
    return Contact(
        np.array((cx, cy)),
        np.array(centroid_std),
        normal,
        np.array((fx, fy)),
        spin,
        ratio,
        True,
    )
