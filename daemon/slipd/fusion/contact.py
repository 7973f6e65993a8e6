"""The contact as the force sensor alone sees it: paper eqs. (1)–(4).

The print of (3) has ``M_x F_y`` in its last term; the moment balance M = C × F + (0, 0, m) gives ``M_x F_x``, and that
is what stands here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipd.fusion.compiled import compiled

Array = NDArray[np.float64]


#: Below this normal force the centroid's error (torque noise / normal force) exceeds the size of a fingertip.
DEFAULT_MIN_NORMAL_N = 0.2


class Contact(NamedTuple):
    """A contact in the pad frame.

    Attributes:
        cx_m: C along X, m; NaN when not valid.
        cy_m: C along Y, m; likewise.
        cx_std_m: One standard deviation of ``cx_m``, m, from the noise given; it grows like torque noise / normal force
            towards lift-off. NaN when not valid.
        cy_std_m: Likewise of ``cy_m``.
        normal_n: f_n = −F_z, N, positive when pressed.
        fx_n: f_t along X on the finger, N.
        fy_n: f_t along Y on the finger, N.
        spin_nm: m, the torque about the pad normal through C, N·m; NaN when not valid.
        friction_ratio: R = |f_t| / f_n; NaN when not valid.
        friction_ratio_std: One standard deviation of R; NaN when not valid.
        valid: The wrench is finite and presses with at least the least normal force.
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
    def centroid_std_m(self) -> Array:
        """One standard deviation of each coordinate of C, shape (2,), m."""
        return np.array((self.cx_std_m, self.cy_std_m))

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
    return contact_of((*f.tolist(), *t.tolist()), min_normal_n, force_std_n, torque_std_nm)


def contact_of(
    wrench: Sequence[float], min_normal_n: float, force_std_n: float = 0.0, torque_std_nm: float = 0.0
) -> Contact:
    """`contact_from_wrench` for six numbers that need no checking: F in N, then M in N·m."""
    fx, fy, fz, mx, my, mz = wrench
    normal = -fz
    if not (normal >= min_normal_n and math.isfinite(fx + fy + fz + mx + my + mz)):
        nan = math.nan
        return Contact(nan, nan, nan, nan, normal, fx, fy, nan, nan, nan, False)
    return Contact(*_contact(fx, fy, normal, mx, my, mz, force_std_n, torque_std_nm), True)


class Carrier(NamedTuple):
    """Moves readings of a force sensor into the pad frame: matrix (reading − offset) − weight.

    Attributes:
        matrix: Takes (F, M) to (F, M); F does not depend on M. Shape (6, 6).
        offset: In the sensor's frame, N and N·m, shape (6,).
        weight: In the pad frame, N and N·m, shape (6,).
    """

    matrix: Array
    offset: Array
    weight: Array


#: Of readings that are in the pad frame already.
AS_IS = Carrier(np.eye(6), np.zeros(6), np.zeros(6))
AS_IS.matrix.flags.writeable = False  # as of every mounting: kernels are compiled for either kind

#: Contact phase of a reading. A late one ends the contact, and so does one whose normal force is clearly negative
#: (PULLED): no pad is pulled so. An untrusted one is ignored.
PULLED, LATE, UNTRUSTED, FREE, TOUCHING = range(-2, 3)
#: Before it is found out which.
USABLE = FREE
#: Column of readings that says USABLE, UNTRUSTED or LATE, behind the six numbers of the wrench and the time, s.
USE = 7
#: Columns of contacts behind the ten numbers of a `Contact`: what the reading is, the torque on the pad, the time.
TOUCH, TORQUE, CONTACT_TIME = 10, 11, 14


def carry(carrier: Carrier, readings: Array) -> Array:
    """Moves readings into the pad frame, in one order of arithmetic whatever their number.

    Args:
        carrier: How they are moved.
        readings: As for `find_contacts`, shape (n, 8).

    Returns:
        The same with the wrench in the pad frame.
    """
    return _carry(*carrier, readings)


def find_contacts(
    carrier: Carrier,
    readings: Array,
    contact_n: tuple[float, float],
    in_contact: bool,
    force_std_n: float,
    torque_std_nm: float,
    pulled_n: float = math.inf,
) -> Array:
    """`contact_of` of readings that follow each other; a contact lasts down to a lower force than it begins at.

    Args:
        carrier: Moves them into the pad frame.
        readings: Force, N, and torque, N·m, of each; its time, s; and USABLE, UNTRUSTED (says nothing: passed over) or
            LATE (ends the contact). Shape (n, 8). The torque is NaN where the sensor measures none, and with it the
            centroid and the spin.
        contact_n: Normal force at which a contact begins, and down to which it lasts, N.
        in_contact: The reading before touched.
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Standard deviation of each torque component, N·m.
        pulled_n: A normal force below minus this is clearly negative, N.

    Returns:
        The numbers of the `Contact` of each in their order, NaN but for the forces where it does not touch; in place of
        ``valid`` PULLED, LATE, UNTRUSTED, FREE or TOUCHING; behind them the torque about the pad's origin, N·m, and the
        time, s. Shape (n, 15).
    """
    rows = np.empty((len(readings), 15))
    _find(rows, *carrier, readings, *contact_n, in_contact, force_std_n, torque_std_nm, pulled_n)
    return rows


def contact_told(row: Sequence[float]) -> Contact:
    """Makes a `Contact` of the numbers that `find_contacts` gives for it."""
    cx, cy, cx_std, cy_std, normal, fx, fy, spin, ratio, ratio_std, touch, *_ = row
    return Contact(cx, cy, cx_std, cy_std, normal, fx, fy, spin, ratio, ratio_std, touch == TOUCHING)


def wrench_told(row: Sequence[float]) -> tuple[float, ...]:
    """Force, N, and torque, N·m, on the pad: six of the numbers that `find_contacts` gives."""
    return (row[5], row[6], -row[4], *row[TORQUE:CONTACT_TIME])


@compiled
def _carry(matrix: Array, offset: Array, weight: Array, readings: Array) -> Array:
    out = readings.copy()
    for k in range(len(readings)):
        for i in range(6):
            total = 0.0
            for j in range(3 if i < 3 else 6):  # the force does not depend on a torque that may be none
                total += matrix[i, j] * (readings[k, j] - offset[j])
            out[k, i] = total - weight[i]
    return out


@compiled
def _find(
    rows: Array, matrix: Array, offset: Array, weight: Array, readings: Array, begins_n: float, lasts_n: float,
    in_contact: bool, force_std: float, torque_std: float, pulled_n: float,
) -> None:  # fmt: skip
    """Fills ``rows``: an array that a kernel returns costs more than the work on one reading."""
    carried = _carry(matrix, offset, weight, readings)
    for k in range(len(readings)):
        fx, fy, fz, mx, my, mz, t_s, touch = carried[k]
        normal = -fz
        if touch == USABLE:
            pressed = normal >= (lasts_n if in_contact else begins_n)
            touch = TOUCHING if pressed and math.isfinite(fx + fy + fz) else PULLED if normal < -pulled_n else FREE
        if touch == TOUCHING:
            row = _contact(fx, fy, normal, mx, my, mz, force_std, torque_std)
            for i in range(10):
                rows[k, i] = row[i]
        else:
            rows[k] = math.nan
            rows[k, 4], rows[k, 5], rows[k, 6] = normal, fx, fy
        rows[k, 10], rows[k, 11], rows[k, 12], rows[k, 13], rows[k, 14] = touch, mx, my, mz, t_s
        if touch != UNTRUSTED:
            in_contact = touch == TOUCHING


@compiled
def _contact(
    fx: float, fy: float, normal: float, mx: float, my: float, mz: float, force_std: float, torque_std: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """The numbers of a `Contact`."""
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
