"""Whether two pads hold a motion of the arm, and how far it must be slowed down (`slipd.fusion.held_pad`)."""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.held_pad import (
    UNBOUNDED,
    HeldPad,
    MovedLoad,
    Triple,
    moved_load,
    moved_utilisation,
    needed_bound,
    pad_utilisation,
    twist_bounds,
)
from slipd.types.arrays import Array

SCALE_STEPS = 16
SCALE_PASSES = 4
"""Searches for a time scale. A point that holds in motion and not at rest may take one more for each other point: with
more than these the time scale is 0."""


@compiled
def force_ratio(
    first: HeldPad, second: HeldPad, rest: Array, motion: Array, scale: float, safety: float, work: Array
) -> float:
    """Return the largest ratio of the normal force that would hold a motion to that of a pad then: it holds up to 1.

    Args:
        first: A pad.
        second: The other one.
        rest: Change of the apparent gravity (3) and couple (3) of `moved_load` at scale 0, shape (6,).
        motion: Their change from scale 0 to 1, shape (6,).
        scale: Factor on ``motion``.
        safety: As in `pad_utilisation`.
        work: As in `pad_utilisation`.
    """
    change, couple = _changed(rest, motion, scale)
    worst = 0.0
    for needed, normal in (
        pad_utilisation(first, change, couple, safety, work)[1:3],
        pad_utilisation(second, change, couple, safety, work)[1:3],
    ):
        worst = max(worst, needed / normal if normal > 0.0 else UNBOUNDED)
    return worst


@compiled_part
def _changed(rest: Array, motion: Array, scale: float) -> tuple[Triple, Triple]:
    return (
        (rest[0] + scale * motion[0], rest[1] + scale * motion[1], rest[2] + scale * motion[2]),
        (rest[3] + scale * motion[3], rest[4] + scale * motion[4], rest[5] + scale * motion[5]),
    )


@compiled
def largest_scale(
    first: HeldPad, second: HeldPad, rest: Array, motion: Array, safety: float, most: float, work: Array
) -> float:
    """Return the largest factor on ``motion``, at most ``most``, with which rest + factor · motion holds; 0: none.

    What holds is convex: the factors that hold are an interval from 0, so that halving finds its end, from below. Steps
    beside the chord are faster, because the ratio is nearly linear.

    Args:
        first: As in `force_ratio`.
        second: Likewise.
        rest: Likewise.
        motion: Likewise.
        safety: As in `pad_utilisation`.
        most: Upper end of the search.
        work: As in `pad_utilisation`.
    """
    low, high, at_low, at_high = 0.0, most, 0.0, 0.0
    for step in range(SCALE_STEPS):
        if step == 0:
            at = most
        elif step == 1:
            at = 0.0
        elif step % 3 == 1:
            at = 0.5 * (low + high)
        else:
            at = low + (high - low) * (1.0 - at_low) / (at_high - at_low)
            at += 0.05 * (high - at) if step % 3 == 0 else -0.05 * (at - low)
        held = force_ratio(first, second, rest, motion, at, safety, work)
        if held <= 1.0:
            if step == 0:
                return most
            low, at_low = at, held
        elif step == 1:
            return 0.0
        else:
            high, at_high = at, held
        if high - low <= 1e-3 * high:
            break
    return low


@compiled
def largest_scales(
    first: HeldPad, second: HeldPad, rest: Array, motions: Array, safety: float, most: float, work: Array, out: Array
) -> None:
    """Find the result of `largest_scale` for several motions, shape (n, 6); fills ``out``, shape (n,)."""
    for k in range(out.size):
        out[k] = largest_scale(first, second, rest, motions[k], safety, most, work)


class Worst(NamedTuple):
    """What the points of a motion so far use at most.

    Attributes:
        used: The largest utilisation.
        point: Its point.
        side: Its pad, 0 or 1.
        tips: That pad tips first.
        lack_n: Normal force that the pads lack, negative where they have more.
        ratio: As of `force_ratio`, without a bound.
        tightest: The point of this ratio.
    """

    used: float
    point: int
    side: int
    tips: bool
    lack_n: float
    ratio: float
    tightest: int


@compiled
def check_points(
    first: HeldPad, second: HeldPad, rest: Array, motion: Array, safety: float, work: Array
) -> tuple[float, int, int, bool, float, float]:
    """Find what a motion uses at most, and how far it must be slowed down.

    Args:
        first: A pad.
        second: The other one.
        rest: As in `force_ratio`, for each point, shape (n, 6).
        motion: Likewise, shape (n, 6); at full speed, both add up.
        safety: As in `pad_utilisation`.
        work: As in `pad_utilisation`.

    Returns:
        The largest utilisation; its point, its pad (0 or 1), and whether that tips; the normal force that the pads
        lack, N, negative where they have more; the largest factor on ``motion``, at most 1, with which all points hold.
    """
    worst, bounds = Worst(-1.0, 0, 0, False, -UNBOUNDED, 0.0, 0), (twist_bounds(first), twist_bounds(second))
    for k in range(rest.shape[0]):
        change, couple = _changed(rest[k], motion[k], 1.0)
        worst = _worst_with(worst, k, 0, first, moved_load(first, change, couple), bounds[0], safety, work)
        worst = _worst_with(worst, k, 1, second, moved_load(second, change, couple), bounds[1], safety, work)
    scale = 1.0
    if worst.ratio > 1.0:
        at = worst.tightest
        scale = largest_scale(first, second, rest[at], motion[at], safety, 1.0, work)
        scale = _scale_of_all(first, second, rest, motion, safety, scale, bounds, work)
    return worst.used, worst.point, worst.side, worst.tips, min(worst.lack_n, UNBOUNDED), scale


@compiled_part
def _worst_with(
    worst: Worst, point: int, side: int, pad: HeldPad, moved: MovedLoad, largest: Triple, safety: float, work: Array
) -> Worst:
    """Return the worst so far, with another pad at another point; a load that cannot be it is not solved."""
    normal, most = moved.normal, needed_bound(moved, largest)
    most_needed = safety * max(most, moved.tipped)
    if not moved.begun and normal > 0.0:
        less = max(most / normal, moved.over) <= worst.used
        if less and most_needed - normal <= worst.lack_n and most_needed <= worst.ratio * normal:
            return worst
    used, needed, tips = moved_utilisation(pad, moved, safety, work)
    ratio = needed / normal if normal > 0.0 else UNBOUNDED
    lack_n, at = max(worst.lack_n, needed - normal), point if ratio > worst.ratio else worst.tightest
    if used > worst.used:
        return Worst(used, point, side, tips, lack_n, max(ratio, worst.ratio), at)
    return Worst(worst.used, worst.point, worst.side, worst.tips, lack_n, max(ratio, worst.ratio), at)


@compiled_part
def _scale_of_all(
    first: HeldPad, second: HeldPad, rest: Array, motion: Array, safety: float, scale: float,
    bounds: tuple[Triple, Triple], work: Array,
) -> float:  # fmt: skip
    """Return the largest factor on ``motion`` with which all points hold, where that of one point is ``scale``."""
    count, held = rest.shape[0], 0
    for step in range(SCALE_PASSES * count):
        if scale == 0.0 or held == count:
            return scale
        k = step % count
        change, couple = _changed(rest[k], motion[k], scale)
        if _holds(first, moved_load(first, change, couple), bounds[0], safety, work) and _holds(
            second, moved_load(second, change, couple), bounds[1], safety, work
        ):
            held += 1
        else:
            scale, held = largest_scale(first, second, rest[k], motion[k], safety, scale, work), 1
    return scale if held == count else 0.0


@compiled_part
def _holds(pad: HeldPad, moved: MovedLoad, largest: Triple, safety: float, work: Array) -> bool:
    """Return whether a pad holds a load; where it must hold it, without solving it."""
    surely = not moved.begun and safety * max(needed_bound(moved, largest), moved.tipped) <= moved.normal
    return surely or moved_utilisation(pad, moved, safety, work)[1] <= moved.normal


@compiled
def follow_gravity(points: Array, begin: Array, out: Array) -> None:
    """Follow gravity through a motion, as the gripper sees it.

    Args:
        points: Rows of time, s, apparent gravity (3), and angular velocity (3), rad/s, shape (n, 7) or wider.
        begin: Gravity at the first point, shape (3,).
        out: Filled with gravity at each, shape (n, 3).

    Between two points the angular velocity counts as their mean. Source: Rodrigues' formula.
    """
    x, y, z = begin[0], begin[1], begin[2]
    for k in range(points.shape[0]):
        if k > 0:
            half = -0.5 * (points[k, 0] - points[k - 1, 0])
            wx, wy, wz = (
                half * (points[k, 4] + points[k - 1, 4]),
                half * (points[k, 5] + points[k - 1, 5]),
                half * (points[k, 6] + points[k - 1, 6]),
            )
            angle = math.sqrt(wx * wx + wy * wy + wz * wz)
            sine = math.sin(angle) / angle if angle > 1e-9 else 1.0
            bend = 0.5 * (math.sin(0.5 * angle) / (0.5 * angle)) ** 2 if angle > 1e-9 else 0.5
            cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
            dx, dy, dz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
            x, y, z = x + sine * cx + bend * dx, y + sine * cy + bend * dy, z + sine * cz + bend * dz
        out[k, 0], out[k, 1], out[k, 2] = x, y, z
