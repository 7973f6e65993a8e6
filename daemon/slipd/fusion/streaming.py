"""Force readings in sequence: from the sensor's wrench to contact, utilisation and level, in rows of READING.

Two kernels take all readings of one read at once: `find_contacts` moves them into the pad frame and finds their
contact phase; `judge_readings` solves and assesses them with the loads on the taxels, which may depend on the contact,
and learns friction from them. Both read the conditions in force and keep what the next read continues from. Nothing
here checks its arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np

from slipd.fusion.assess import assess_readings
from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.contact import Contact, contact_numbers
from slipd.fusion.contact_state import Assessment
from slipd.fusion.friction_learning import learn
from slipd.fusion.hull import fill_margins
from slipd.fusion.limit.batch import solve_readings
from slipd.fusion.limit.frame import Load
from slipd.fusion.limit.solve import GOAL, KINDS, MAX_PASSES, Stop, utilisation_of
from slipd.fusion.limit.sweep import Twist
from slipd.fusion.limit_surface import Utilisation, pole_or_none
from slipd.fusion.recent_forces import keep_force
from slipd.fusion.rows import (
    FREE,
    LATE,
    PENDING,
    PULLED,
    READING,
    TOUCHING,
    UNSOLVED,
    UNTRUSTED,
    Row,
    Rows,
)
from slipd.types.arrays import Array

DECISION_GAP = 1e-6
"""Relative gap between the bounds of the utilisation; far below what a threshold or a message resolves."""
PULLED_S = 0.05
"""What follows a clearly negative normal force within this time is not believed either, s: the sensor has just been
wrong, and one whose sign alternates would change the level with each reading."""
_GIVEN = Struct("7dq")
"""The first fields of READING, which are given: wrench, time in s, and time in ns."""


def new_readings(wrenches: Sequence[Sequence[float]], times_ns: Sequence[int]) -> Rows:
    """Make PENDING readings.

    Args:
        wrenches: Force, N, and torque, N·m, of each: six numbers in the sensor's frame.
        times_ns: Time of each, ns.

    Returns:
        Rows of READING, shape (n,).
    """
    size = READING.itemsize
    memory = bytearray(len(wrenches) * size)
    for k, wrench in enumerate(wrenches):
        t_ns = times_ns[k]
        _GIVEN.pack_into(memory, k * size, *wrench, t_ns * 1e-9, t_ns)
    return np.ndarray(len(wrenches), READING, memory)


def contact_at(readings: Rows, index: int) -> Contact:
    """Return the contact of one row."""
    numbers: Any = readings["contact"].item(index)
    return Contact(*numbers)


def first_contact(readings: Rows) -> Contact:
    """Return the contact of the first row that is TOUCHING."""
    return contact_at(readings, readings["phase"].tolist().index(TOUCHING))


def wrench_at(readings: Rows, index: int) -> list[float]:
    """Return the wrench of one row: force, N, and torque, N·m."""
    wrench: list[float] = readings["wrench"][index].tolist()
    return wrench


def utilisation_at(readings: Rows, index: int) -> Utilisation | None:
    """Return the utilisation of one row; None where it was not solved."""
    numbers: Any = readings["utilisation"].item(index)
    value, lower, upper, pole_m, twist, kind = numbers
    if kind == UNSOLVED:
        return None
    vx, vy, omega = twist.tolist()
    return Utilisation(value, lower, upper, pole_or_none(*pole_m.tolist()), KINDS[kind], (vx, vy, omega))


def assessment_at(readings: Rows, index: int) -> Assessment:
    """Return the assessment of one row."""
    numbers: Any = readings["assessment"].item(index)
    return Assessment(*numbers)


def without_verdict(reading: Rows) -> Rows:
    """Return a copy of rows of READING that has their wrenches and contacts alone."""
    bare = reading.copy()
    bare["phase"], bare["tipping_margin_m"], bare["utilisation"]["kind"] = PENDING, math.nan, UNSOLVED
    bare["assessment"]["evidence"], bare["assessment"]["required_friction"] = 0, math.nan
    return bare


@compiled
def move_to_pad(readings: Rows, states: Rows) -> None:
    """Move the wrenches of readings into the pad frame, in one order of arithmetic whatever their number.

    Args:
        readings: Rows of READING, shape (n,); their wrenches are replaced.
        states: One row of CONTACT_STATE.
    """
    conditions = states[0]["conditions"]
    matrix, offset, weight = conditions["matrix"], conditions["offset"], conditions["weight"]
    for k in range(len(readings)):
        wrench = readings[k]["wrench"]
        given = (wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5])
        for i in range(6):
            total = 0.0
            for j in range(3 if i < 3 else 6):  # the force does not depend on the torque, which may be unknown
                total += matrix[i, j] * (given[j] - offset[j])
            wrench[i] = total - weight[i]


@compiled
def find_contacts(readings: Rows, states: Rows, oldest_ns: int, moved: bool) -> tuple[int, int]:
    """Find phase and contact of readings in sequence; a contact lasts down to a lower force than it begins at.

    Without torque, the centroid and the spin of a contact are NaN.

    Args:
        readings: Rows of READING, shape (n,), PENDING or UNTRUSTED. Their contacts are filled in, and nothing is known
            yet of margin and utilisation.
        states: One row of CONTACT_STATE, as the reading before left it.
        oldest_ns: Readings from before this time are LATE.
        moved: The wrenches are in the pad frame already. Otherwise they are moved into it.

    Returns:
        Index of the first reading with which a contact ends, n where none does; and the phases that occur, a bit each.

    Source: paper eqs. (1) to (4), see `slipd.fusion.contact`.
    """
    if not moved:
        move_to_pad(readings, states)
    conditions, forces, memory = states[0]["conditions"], states[0]["forces"], states[0]["memory"]
    in_contact = memory["in_contact"]
    force_std, torque_std = (
        conditions["force_std_n"] + conditions["unknown_n"],
        conditions["torque_std_nm"] + conditions["unknown_nm"],
    )
    ends_at, phases = len(readings), 0
    for k in range(len(readings)):
        row = readings[k]
        wrench, phase = row["wrench"], row["phase"]
        fx, fy, fz, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
        normal = -fz
        if row["t_ns"] < oldest_ns:
            phase = LATE
        elif phase == PENDING:
            pressed = normal >= (conditions["lasts_n"] if in_contact else conditions["begins_n"])
            phase = TOUCHING if pressed and math.isfinite(fx + fy + fz) else FREE
            if normal < -conditions["pulled_n"]:
                memory["pulled_s"] = row["t_s"]
            if abs(row["t_s"] - memory["pulled_s"]) <= PULLED_S:
                phase = PULLED
            elif not conditions["zero_known"]:
                phase = UNTRUSTED
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
        phases |= 1 << phase
        if phase == UNTRUSTED:
            continue
        if in_contact and phase != TOUCHING and ends_at == len(readings):
            ends_at = k
        in_contact = phase == TOUCHING
        if in_contact or phase == FREE:
            keep_force(forces, row["t_ns"], wrench)
    return ends_at, phases


@compiled
def judge_readings(
    readings: Rows, states: Rows, learnings: Rows, x: Array, y: Array, shares: Array, outline_x: Array,
    outline_y: Array, shape_error: float, teaches_from: int,
) -> None:  # fmt: skip
    """Fill in margin, utilisation and assessment of readings in sequence, and learn friction from them.

    Args:
        readings: Rows of READING with their contacts, shape (n,).
        states: One row of CONTACT_STATE. Where μ is unknown, λ is solved for μ = 1: it is the required friction.
        learnings: One row of LEARNING.
        x: Centres of the active taxels, shape (k,), contiguous, m; k = 0 without an image.
        y: Likewise, shape (k,), m.
        shares: Load on each for a normal force of 1 N, shape (k,).
        outline_x: Corners of the outline of the active taxels, counter-clockwise, m.
        outline_y: Likewise, m.
        shape_error: As of `learn`.
        teaches_from: Likewise.
    """
    conditions, memory, spin_1n = states[0]["conditions"], states[0]["memory"], 0.0
    if x.size > 0:
        mu = 1.0 if math.isnan(conditions["mu"]) else conditions["mu"]
        twist, nan = memory["twist"], math.nan
        fill_margins(outline_x, outline_y, readings)
        solve_readings(
            readings, x, y, shares, mu, conditions["spin_scale"], twist[0], twist[1], twist[2], DECISION_GAP, MAX_PASSES
        )
        if conditions["unknown_n"] > 0.0:
            load, start, stop = (
                Load(0.0, 0.0, conditions["unknown_nm"], 0.0, 0.0),
                Twist(nan, nan, nan),
                Stop(GOAL, MAX_PASSES),
            )
            spin_1n = utilisation_of(x, y, shares, mu, load, start, stop, np.empty((3, x.size))).upper
    assess_readings(readings, states, spin_1n)
    learn(readings, learnings, shape_error, teaches_from)
    _remember(readings, memory, x.size > 0)


@compiled_part
def _remember(readings: Rows, memory: Row, solved: bool) -> None:
    """Keep contact and twist of the newest reading that could be trusted."""
    for k in range(len(readings) - 1, -1, -1):
        row = readings[k]
        if row["phase"] != UNTRUSTED:
            touches = row["phase"] == TOUCHING
            memory["in_contact"] = touches
            twist, found = memory["twist"], row["utilisation"]["twist"]
            for i in range(3):
                twist[i] = found[i] if touches and solved else math.nan
            return
