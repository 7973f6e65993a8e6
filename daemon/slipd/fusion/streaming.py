"""Force readings in sequence: from the sensor's wrench to contact and utilisation, in rows of READING.

One read of a sensor gives some readings. `new_readings` makes a row of each, then every step fills in its own fields:
`find_contacts`, `slipd.fusion.hull.Outline.fill_margins`, `solve_readings` and
`slipd.fusion.levels.ContactWatch.assess`. Nothing here checks its arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.fusion.contact import Contact, contact_numbers
from slipd.fusion.levels import Assessment
from slipd.fusion.limit import batch
from slipd.fusion.limit.solve import GOAL, KINDS, MAX_PASSES, NO_TWIST, solve_utilisation
from slipd.fusion.limit_surface import Twist, Utilisation, pole_or_none
from slipd.fusion.rows import (
    FREE,
    PENDING,
    PULLED,
    READING,
    TOUCHING,
    UNSOLVED,
    UNTRUSTED,
    Rows,
    new_rows,
)
from slipd.types.arrays import Array


class WrenchTransform(NamedTuple):
    """Moves wrenches of a force sensor into the pad frame: matrix (wrench − offset) − weight.

    Attributes:
        matrix: Maps (F, M) to (F, M); F does not depend on M. Shape (6, 6).
        offset: In the sensor's frame, N and N·m, shape (6,).
        weight: In the pad frame, N and N·m, shape (6,).
    """

    matrix: Array
    offset: Array
    weight: Array


IDENTITY = WrenchTransform(np.eye(6), np.zeros(6), np.zeros(6))
IDENTITY.matrix.flags.writeable = False  # like the matrix of every mounting: kernels are compiled for one kind of array
"""For wrenches that are in the pad frame already."""


class Reading(NamedTuple):
    """A row of READING in Python's terms.

    Attributes:
        wrench: (F, M) on the finger in the pad frame, N and N·m, shape (6,); M is NaN where the sensor measures none.
        t_s: Time, s.
        phase: PENDING, TOUCHING, FREE, PULLED, LATE or UNTRUSTED.
        contact: The contact; not valid unless TOUCHING.
        tipping_margin_m: Signed distance of the centroid to the outline of the contact, m; NaN without an image.
        utilisation: λ with its bounds; None where it was not solved.
        assessment: What `slipd.fusion.levels.ContactWatch` found.
    """

    wrench: Array
    t_s: float
    phase: int
    contact: Contact
    tipping_margin_m: float
    utilisation: Utilisation | None
    assessment: Assessment


def new_readings(wrenches: Sequence[Sequence[float]], times_s: Sequence[float]) -> Rows:
    """Make PENDING readings.

    Args:
        wrenches: Force, N, and torque, N·m, of each: six numbers in the sensor's frame.
        times_s: Time of each, s.

    Returns:
        Rows of READING, shape (n,).
    """
    readings = new_rows(READING, len(wrenches))
    readings["wrench"] = wrenches
    readings["t_s"] = times_s
    return readings


def reading_at(readings: Rows, index: int) -> Reading:
    """Return one row in Python's terms."""
    row: Any = readings.item(index)
    wrench, t_s, phase, contact, margin_m, used, found = row
    return Reading(wrench, t_s, phase, Contact(*contact), margin_m, _utilisation(*used), Assessment(*found))


def contact_at(readings: Rows, index: int) -> Contact:
    """Return the contact of one row."""
    numbers: Any = readings["contact"].item(index)
    return Contact(*numbers)


def wrench_at(readings: Rows, index: int) -> tuple[float, ...]:
    """Return the wrench of one row: force, N, and torque, N·m."""
    return tuple(readings["wrench"][index].tolist())


def move_to_pad(readings: Rows, transform: WrenchTransform) -> None:
    """Move the wrenches of readings into the pad frame, in one order of arithmetic whatever their number.

    Args:
        readings: Rows of READING, shape (n,); their wrenches are replaced.
        transform: How wrenches are moved.
    """
    _move(readings, *transform)


def find_contacts(
    readings: Rows,
    transform: WrenchTransform,
    contact_n: tuple[float, float],
    in_contact: bool,
    force_std_n: float,
    torque_std_nm: float,
    pulled_n: float = math.inf,
) -> None:
    """Find phase and contact of readings in sequence; a contact lasts down to a lower force than it begins at.

    Without torque, the centroid and the spin of a contact are NaN.

    Args:
        readings: Rows of READING, shape (n,), PENDING, UNTRUSTED or LATE. Their wrenches are moved into the pad frame;
            their contacts are filled in, and nothing is known yet of margin and utilisation.
        transform: Moves wrenches into the pad frame.
        contact_n: Normal force at which a contact begins, and down to which it lasts, N.
        in_contact: The reading before was in contact.
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Standard deviation of each torque component, N·m.
        pulled_n: A normal force below minus this is clearly negative, N.

    Source: paper eqs. (1) to (4), see `slipd.fusion.contact`.
    """
    _find(readings, *transform, *contact_n, in_contact, force_std_n, torque_std_nm, pulled_n)


def solve_readings(
    readings: Rows, x: Array, y: Array, shares: Array, mu: float, start: Twist | None, gap: float
) -> None:
    """Fill in the utilisation of readings in sequence, each started from the twist of the one before.

    Args:
        readings: Rows of READING with their contacts, shape (n,).
        x: Centres of the active taxels, shape (k,), contiguous float64, m.
        y: Likewise, shape (k,), m.
        shares: Load on each for a normal force of 1 N, shape (k,).
        mu: Coefficient of static friction.
        start: Twist of the reading before; None where there is none.
        gap: Relative gap of the bounds at which to stop.
    """
    batch.solve_readings(readings, x, y, shares, mu, *(start or NO_TWIST), gap, MAX_PASSES)


def spin_utilisation_1n(x: Array, y: Array, shares: Array, mu: float, spin_nm: float) -> float:
    """Return the upper bound of λ of a spin torque alone at a normal force of 1 N (see `solve_readings`)."""
    return solve_utilisation(x, y, shares, mu, 0.0, 0.0, spin_nm, 0.0, 0.0, *NO_TWIST, GOAL, MAX_PASSES)[3]


def _utilisation(
    value: float, lower: float, upper: float, pole_m: Array, twist: Array, kind: int
) -> Utilisation | None:
    if kind == UNSOLVED:
        return None
    vx, vy, omega = twist.tolist()
    return Utilisation(value, lower, upper, pole_or_none(*pole_m.tolist()), KINDS[kind], (vx, vy, omega))


@compiled
def _move(readings: Rows, matrix: Array, offset: Array, weight: Array) -> None:
    """Do the work of `move_to_pad`."""
    for k in range(len(readings)):
        wrench = readings[k]["wrench"]
        given = (wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5])
        for i in range(6):
            total = 0.0
            for j in range(3 if i < 3 else 6):  # the force does not depend on the torque, which may be unknown
                total += matrix[i, j] * (given[j] - offset[j])
            wrench[i] = total - weight[i]


@compiled
def _find(
    readings: Rows, matrix: Array, offset: Array, weight: Array, begins_n: float, lasts_n: float, in_contact: bool,
    force_std: float, torque_std: float, pulled_n: float,
) -> None:  # fmt: skip
    """Do the work of `find_contacts`."""
    _move(readings, matrix, offset, weight)
    for k in range(len(readings)):
        row = readings[k]
        wrench, phase = row["wrench"], row["phase"]
        fx, fy, fz, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
        normal = -fz
        if phase == PENDING:
            pressed = normal >= (lasts_n if in_contact else begins_n)
            phase = TOUCHING if pressed and math.isfinite(fx + fy + fz) else PULLED if normal < -pulled_n else FREE
        contact = row["contact"]
        if phase == TOUCHING:
            numbers = contact_numbers(fx, fy, normal, mx, my, mz, force_std, torque_std)
        else:
            nan = math.nan
            numbers = (nan, nan, nan, nan, normal, fx, fy, nan, nan, nan)
        contact["cx_m"], contact["cy_m"], contact["cx_std_m"], contact["cy_std_m"] = numbers[:4]
        contact["normal_n"], contact["fx_n"], contact["fy_n"], contact["spin_nm"] = numbers[4:8]
        contact["friction_ratio"], contact["friction_ratio_std"] = numbers[8:]
        contact["valid"] = phase == TOUCHING
        row["phase"], row["tipping_margin_m"], row["utilisation"]["kind"] = phase, math.nan, UNSOLVED
        if phase != UNTRUSTED:
            in_contact = phase == TOUCHING
