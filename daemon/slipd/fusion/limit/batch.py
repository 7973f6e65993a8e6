"""The same questions for many frames in one call, and for readings in sequence."""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.limit.frame import Load
from slipd.fusion.limit.solve import NONE, Stop, UtilisationAnswer, torque_limit_of, utilisation_of
from slipd.fusion.limit.sweep import Twist
from slipd.fusion.rows import TOUCHING, UNTRUSTED, Rows
from slipd.types.arrays import Array


@compiled_part
def gather(x: Array, y: Array, loads: Array, ax: Array, ay: Array, active: Array) -> int:
    """Copy centres and loads of the taxels in contact, those whose load is not zero; return how many."""
    n = 0
    for i in range(x.size):
        ax[n], ay[n], active[n] = x[i], y[i], loads[i]
        n += loads[i] != 0.0
    return n


@compiled_part
def write_utilisation(row: Rows, found: UtilisationAnswer) -> None:
    """Fill a row of UTILISATION."""
    row["kind"], row["value"], row["lower"], row["upper"] = found.kind, found.value, found.lower, found.upper
    pole, twist = row["pole_m"], row["twist"]
    pole[0], pole[1] = found.pole_x, found.pole_y
    twist[0], twist[1], twist[2] = found.vx, found.vy, found.omega


@compiled
def solve_torque_limits(
    x: Array, y: Array, loads: Array, mu: float, tangential: Array, about: Array, sense: int, gap: float, passes: int,
    out: Rows,
) -> None:  # fmt: skip
    """Write `solve.solve_torque_limit` of every frame into ``out``.

    Args:
        x: Taxel centres, shape (frames, n), or (1, n) for all, m.
        y: Likewise.
        loads: Shape (frames, n), N.
        mu: Coefficient of friction.
        tangential: Shape (frames, 2), N.
        about: Shape (frames, 2), or (1, 2) for all, m.
        sense: ±1.
        gap: Gap of the bounds at which to stop.
        passes: Most passes over the taxels of a frame.
        out: Rows of TORQUE_LIMIT, shape (frames,).
    """
    width = x.shape[1]
    memory, ax, ay, active = np.empty(3 * width), np.empty(width), np.empty(width), np.empty(width)
    for i in range(loads.shape[0]):
        k, a = min(i, x.shape[0] - 1), min(i, about.shape[0] - 1)
        n = gather(x[k], y[k], loads[i], ax, ay, active)
        taxels = memory[: 3 * n].reshape((3, n))
        load = Load(tangential[i, 0], tangential[i, 1], 0.0, about[a, 0], about[a, 1])
        found = torque_limit_of(ax[:n], ay[:n], active[:n], mu, load, sense, Stop(gap, passes), taxels)
        row = out[i]
        row["kind"], row["torque_nm"], row["lower_nm"], row["upper_nm"] = (
            found.kind, found.torque, found.lower, found.upper
        )  # fmt: skip
        pole = row["pole_m"]
        pole[0], pole[1] = found.pole_x, found.pole_y


@compiled
def solve_utilisations(
    x: Array, y: Array, loads: Array, mu: float, tangential: Array, spin: Array, about: Array, gap: float, passes: int,
    out: Rows,
) -> None:  # fmt: skip
    """Write `solve.solve_utilisation` of every frame into ``out``, each started from the twist of the one before.

    Args:
        x: As in `solve_torque_limits`, like all but the next.
        y: Likewise.
        loads: Likewise.
        mu: Likewise.
        tangential: Likewise.
        spin: Shape (frames,), N·m.
        about: Likewise.
        gap: Likewise.
        passes: Likewise.
        out: Rows of UTILISATION, shape (frames,).
    """
    width = x.shape[1]
    memory, ax, ay, active = np.empty(3 * width), np.empty(width), np.empty(width), np.empty(width)
    start = Twist(math.nan, math.nan, math.nan)
    for i in range(loads.shape[0]):
        k, a = min(i, x.shape[0] - 1), min(i, about.shape[0] - 1)
        n = gather(x[k], y[k], loads[i], ax, ay, active)
        taxels = memory[: 3 * n].reshape((3, n))
        load = Load(tangential[i, 0], tangential[i, 1], spin[i], about[a, 0], about[a, 1])
        found = utilisation_of(ax[:n], ay[:n], active[:n], mu, load, start, Stop(gap, passes), taxels)
        start = Twist(found.vx, found.vy, found.omega)
        write_utilisation(out[i], found)


@compiled
def solve_readings(
    readings: Rows, x: Array, y: Array, shares: Array, mu: float, spin_scale: float, vx: float, vy: float, omega: float,
    gap: float, passes: int,
) -> None:  # fmt: skip
    """Fill in the utilisation of readings in sequence, each started from the twist of the one before.

    Readings without contact get none, and the next starts anew; UNTRUSTED ones are passed over.

    Args:
        readings: Rows of READING with their contacts, shape (m,).
        x: Centres of the active taxels, shape (n,), m.
        y: Likewise.
        shares: Load on each for a normal force of 1 N, shape (n,).
        mu: Coefficient of friction.
        spin_scale: How many times as much friction a spin uses.
        vx: Twist of the reading before; NaN where there is none.
        vy: Likewise.
        omega: Likewise.
        gap: Gap of the bounds at which to stop.
        passes: Most passes over the taxels of a reading.
    """
    taxels, stop = np.empty((3, x.size)), Stop(gap, passes)
    nan = math.nan
    start = Twist(vx, vy, omega)
    for k in range(len(readings)):
        row = readings[k]
        if row["phase"] != TOUCHING:
            write_utilisation(row["utilisation"], UtilisationAnswer(NONE, nan, nan, nan, nan, nan, nan, nan, nan))
            if row["phase"] != UNTRUSTED:
                start = Twist(nan, nan, nan)
            continue
        contact = row["contact"]
        normal = contact["normal_n"]
        load = Load(
            contact["fx_n"] / normal, contact["fy_n"] / normal, spin_scale * contact["spin_nm"] / normal,
            contact["cx_m"], contact["cy_m"],
        )  # fmt: skip
        found = utilisation_of(x, y, shares, mu, load, start, stop, taxels)
        start = Twist(found.vx, found.vy, found.omega)
        write_utilisation(row["utilisation"], found)
