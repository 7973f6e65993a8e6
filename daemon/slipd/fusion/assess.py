"""The level of each reading of a contact, in compiled code: utilisation against thresholds, tipping, and slip."""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.level_hysteresis import DWELL_S, held_step, settle
from slipd.fusion.load_blocks import GAP_S, forget_load
from slipd.fusion.load_drop import follow_load
from slipd.fusion.load_growth import grows
from slipd.fusion.rows import (
    CAUTION,
    FREE,
    LOAD_DROP_BIT,
    NO_CONTACT,
    SLIPPING,
    STABLE,
    TOUCHING,
    UNKNOWN,
    UNSOLVED,
    UNTRUSTED,
    WARNING,
    Row,
    Rows,
)

SPIN_ARM_M = 0.005
"""Arm that makes a spin torque comparable with a force: friction in a contact of 15 mm acts about this far from its
centre. It weighs noise, and stands in for the limit surface where there is no image."""
NOISE_WIDTH = 4.0
"""The hysteresis is at least this many standard deviations of the utilisation."""


@compiled
def assess_readings(readings: Rows, states: Rows, spin_utilisation_1n: float) -> None:
    """Fill in the assessment of readings in sequence.

    Args:
        readings: Rows of READING with contacts and, where an image shows the rotation, margins and utilisations,
            shape (n,); their times rise.
        states: One row of CONTACT_STATE.
        spin_utilisation_1n: λ of the uncertain torque alone at a normal force of 1 N.
    """
    state = states[0]
    conditions, memory, drop, ring = state["conditions"], state["memory"], state["drop"], state["ring"]
    mu, unknown_n = conditions["mu"], conditions["unknown_n"]
    for k in range(len(readings)):
        row = readings[k]
        contact, found = row["contact"], row["assessment"]
        normal, phase, t_s = contact["normal_n"], row["phase"], row["t_s"]
        _find_nothing(found)
        if phase == UNTRUSTED:
            continue
        if phase != TOUCHING:
            _forget(memory, drop)
            if phase == FREE and normal + unknown_n < conditions["begins_n"]:
                found["level"] = NO_CONTACT
            continue
        exact = row["utilisation"]["kind"] != UNSOLVED and not math.isnan(contact["spin_nm"])
        slips = _find_motion(row, conditions, memory, drop, ring, exact)
        if math.isnan(mu):
            if slips:
                found["level"] = SLIPPING
            continue
        measured = contact["friction_ratio"] / mu  # R / μ of paper eq. (4)
        upper = measured
        if exact:
            measured = row["utilisation"]["upper"]
            measured = math.inf if math.isnan(measured) else measured  # an unknown bound is not a safe one
            upper = measured
            if unknown_n > 0.0:  # the gauge of a sum is at most the sum of the gauges
                free = normal - unknown_n
                upper = (measured * normal + unknown_n / mu + spin_utilisation_1n) / free if free > 0.0 else math.inf
        width = max(conditions["hysteresis"], NOISE_WIDTH * max(drop["std"], drop["rough"]) / mu)
        used = settle(row, conditions, memory, upper, measured, exact)
        warning = conditions["warning"]
        sooner = warning - conditions["hysteresis"]
        if sooner <= used < warning and grows(drop, ring, mu, sooner):
            warning = sooner
        step = held_step(used, conditions, memory, warning, width, t_s)
        found["friction_step"], found["utilisation_upper"] = step, upper
        if exact:
            tipping = _find_tipping(row, conditions, memory)
            found["level"] = SLIPPING if slips else max(step, tipping) + 1
        elif slips or step == WARNING:  # translation alone can prove a grip unsafe, never safe
            found["level"] = SLIPPING if slips else WARNING + 1


@compiled_part
def _find_nothing(found: Row) -> None:
    """Fill in an assessment in which nothing is known."""
    found["level"], found["friction_step"], found["tipping_step"] = UNKNOWN, STABLE, STABLE
    found["utilisation_upper"], found["slips"], found["tipping_by_unknown_load"] = math.nan, False, False
    found["evidence"], found["drop_surprise"], found["required_friction"] = 0, 0.0, math.nan
    found["peak_required"], found["plateau_required"] = math.nan, math.nan


@compiled_part
def _forget(memory: Row, drop: Row) -> None:
    """Forget a contact that ended."""
    memory["step"], memory["tipping_step"], memory["moving_until_s"] = STABLE, STABLE, -math.inf
    memory["settled"] = 0.0
    forget_load(drop)


@compiled_part
def _find_motion(row: Row, conditions: Row, memory: Row, drop: Row, ring: Rows, exact: bool) -> bool:
    """Fill in the required friction and what shows that the object moves; return whether it does.

    Without an image, the limit surface is taken for an ellipsoid with the arm SPIN_ARM_M. Where μ is unknown, λ was
    solved for μ = 1, so it is the required friction.
    """
    contact, found = row["contact"], row["assessment"]
    normal, ratio, mu = contact["normal_n"], contact["friction_ratio"], conditions["mu"]
    if exact:
        q = row["utilisation"]["value"] * (1.0 if math.isnan(mu) else mu)
        found["required_friction"] = q
    else:
        spin = abs(contact["spin_nm"])
        q = ratio if math.isnan(spin) else math.hypot(ratio, spin / (normal * SPIN_ARM_M))
    if drop["exact"] and not exact and row["t_s"] - drop["last_s"] <= GAP_S:
        q = math.inf  # the image is late: wait for the next one
    elif exact != drop["exact"]:  # q by an image and q by the force alone are not comparable
        forget_load(drop)
        drop["exact"] = exact
    std = (
        math.hypot(conditions["force_std_n"] * math.hypot(1.0, ratio), conditions["torque_std_nm"] / SPIN_ARM_M)
        / normal
    )
    gx, gy = conditions["gravity_mps2"][0], conditions["gravity_mps2"][1]
    if not abs(row["t_s"] - conditions["gravity_s"]) <= conditions["gravity_lasts_s"]:
        gx, gy = math.nan, math.nan
    force = contact["fx_n"], contact["fy_n"]
    dropped = follow_load(drop, ring, row["t_s"], q, normal, *force, std, mu, gx, gy, conditions["turn_radps"])
    if dropped:
        found["evidence"], found["drop_surprise"] = LOAD_DROP_BIT, drop["surprise"]
        if exact:
            found["peak_required"], found["plateau_required"] = drop["peak"], drop["plateau"]
    if row["t_s"] < memory["moving_until_s"]:
        found["evidence"] |= memory["moving_evidence"]
        dropped = True
    found["slips"] = dropped
    return dropped


@compiled_part
def _find_tipping(row: Row, conditions: Row, memory: Row) -> int:
    """Fill in and return the step that the tipping margin asks for; a lower one is reached only after DWELL_S."""
    contact, found, unknown_n, t_s = row["contact"], row["assessment"], conditions["unknown_n"], row["t_s"]
    normal = contact["normal_n"]
    reach = math.hypot(contact["cx_m"], contact["cy_m"])
    std = math.hypot(conditions["torque_std_nm"], reach * conditions["force_std_n"]) / normal
    shift = (conditions["unknown_nm"] + reach * unknown_n) / max(normal - unknown_n, 1e-9)
    tipping, by_unknown = _tips(row["tipping_margin_m"], 2.0 * std, conditions["half_pitch_m"], shift)
    held_s = memory["tipping_held_s"]
    if tipping == STABLE or not by_unknown:
        for reached in range(tipping):
            held_s[reached] = t_s
        while tipping < memory["tipping_step"] and t_s - held_s[tipping] < DWELL_S:
            tipping += 1
            by_unknown = False
        memory["tipping_step"] = tipping
    found["tipping_step"], found["tipping_by_unknown_load"] = tipping, by_unknown
    return tipping


@compiled_part
def _tips(margin: float, noise: float, half_pitch: float, shift: float) -> tuple[int, bool]:
    """Return the step that the tipping margin asks for, and whether it does so only for the unknown load's shift.

    Taxels sense over a cell, so the outline is uncertain by half a pitch. Noise excuses a centroid outside it; an
    unknown load does not, because it may as well hide one.

    Source: paper Fig. 2c.
    """
    outside = -(margin + noise) / half_pitch
    step = int(outside > 0.0) + int(outside > 1.0)
    if step == STABLE and shift > 0.0 and margin < shift - half_pitch:
        return CAUTION, True
    return step, False
