"""Whether the motion of the arm explains how the load changes.

The tangential force of an object that sticks is its mass times the apparent gravity γ along the pad. So the force after
a change over that before is γ after over γ before, in length and in direction, whatever the mass and the axes of γ are.
Friction of an object that slides does not follow γ.

The spin need not follow: where the centre of mass is aside, the object swings on its soft pads after the arm has moved,
so that the required friction falls and jumps. Only a fall while the arm keeps its motion shows a slip by rotation.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.load_blocks import LEVEL, RING, mean_force
from slipd.fusion.rows import Row, Rows

LEFT = 0.4
"""Motion that explains a fall leaves at most this part of it. In simulated grasps that are carried it leaves mostly
less than 0.3 where the object sticks, and more than 0.6 where it slides."""
MOVED, TURNED_RADPS = 0.05, 0.1
"""The arm has moved if the apparent gravity changed by this part, or the speed of its turn about the normal of the pad
by so much."""
CARRIED_S, GAVE = 0.1, 0.12
"""A contact gave way if its force beside the apparent gravity fell by the latter part within the former time, s. In
simulated grasps that are lifted while the arm accelerates it falls by up to 0.07; in half of the slips by 0.12 to 0.33.
For CARRIED_S after a motion of the arm the object may begin to swing back."""


@compiled_part
def is_explained(drop: Row, ring: Rows, p: int, top: int, b: int, low: float, high: float) -> bool:
    """Return whether a fall follows a motion of the arm; False where that was not known all the time.

    The stream may lag by some milliseconds, so its newest value counts as well as the mean since the fall.

    Args:
        drop: State.
        ring: Blocks.
        p: Newest blocks, after the fall.
        top: The last block before it.
        b: Blocks up to that one.
        low: Mean q of the former.
        high: Mean q of the latter.
    """
    if drop["unfelt"] > top - b or not _has_moved(drop, ring, top):
        return False
    left = min(_unexplained(drop, ring, p, p, top, b), _unexplained(drop, ring, p, 1, top, b))
    return left <= LEFT * (1.0 - low / high)


@compiled_part
def is_arm_made(drop: Row, ring: Rows, top: int) -> bool:
    """Return whether the arm made q jump; False where its motion was not known since CARRIED_S before the jump.

    It did if it has moved, and the contact did not give way: an object that is lifted while the arm accelerates hands
    its weight over and may stop at a corner, but takes up no less of the motion than before.

    Args:
        drop: State.
        ring: Blocks.
        top: The last block before the jump.
    """
    b = int(CARRIED_S / drop["dt"] + 0.5)
    if max(drop["unfelt"], drop["block"] - drop["count"]) > top - b or not _has_moved(drop, ring, top):
        return False
    return not _gave_way(drop, ring, b)


@compiled_part
def _gave_way(drop: Row, ring: Rows, b: int) -> bool:
    """Return whether the force beside the apparent gravity fell within the newest ``b`` blocks.

    In a turn of the gripper it may: the apparent gravity at the centre of mass is another. The stream may lag by some
    milliseconds, so that of the next level counts as well.
    """
    k = drop["block"]
    force, (gx, gy, turn) = math.hypot(*mean_force(ring, k, LEVEL)), mean_motion(ring, k, LEVEL)
    gravity = math.hypot(gx, gy)
    for back in range(LEVEL, b, LEVEL):
        gx, gy, turn_then = mean_motion(ring, k - back, LEVEL)
        if abs(turn - turn_then) > TURNED_RADPS:
            return False
        gx_soon, gy_soon, _ = mean_motion(ring, k - back + LEVEL, LEVEL)
        fell = force * max(math.hypot(gx, gy), math.hypot(gx_soon, gy_soon))
        if fell * (1.0 + GAVE) < gravity * math.hypot(*mean_force(ring, k - back, LEVEL)):
            return True
    return False


@compiled_part
def _has_moved(drop: Row, ring: Rows, top: int) -> bool:
    """Return whether the motion of the arm changed since shortly before block ``top``."""
    k = drop["block"]
    gx, gy, turn = mean_motion(ring, k, 1)
    known = min(k - top + int(CARRIED_S / drop["dt"]), k - drop["unfelt"], drop["count"])
    for back in range(LEVEL, known - LEVEL, LEVEL):
        gx_then, gy_then, turn_then = mean_motion(ring, k - back, LEVEL)
        moved = math.hypot(gx - gx_then, gy - gy_then) > MOVED * math.hypot(gx_then, gy_then)
        if moved or abs(turn - turn_then) > TURNED_RADPS:
            return True
    return False


@compiled_part
def mean_motion(ring: Rows, end: int, count: int) -> tuple[float, float, float]:
    """Return the mean apparent gravity of the blocks up to ``end``, and the mean speed of the turn."""
    last, first = ring[end % RING], ring[(end - count) % RING]
    return (
        (last["gx"] - first["gx"]) / count,
        (last["gy"] - first["gy"]) / count,
        (last["turn"] - first["turn"]) / count,
    )


@compiled_part
def _unexplained(drop: Row, ring: Rows, p: int, felt: int, top: int, b: int) -> float:
    """Return what γ leaves unexplained of a change of the force, as a part of the force; infinite where either was 0.

    Args:
        drop: State.
        ring: Blocks.
        p: Newest blocks, after the change.
        felt: Newest blocks of γ that belong to them.
        top: The last block before the change.
        b: Blocks up to that one.
    """
    k = drop["block"]
    gx, gy, _ = mean_motion(ring, k, felt)
    gx_then, gy_then, _ = mean_motion(ring, top, b)
    along, across = ratio(*mean_force(ring, k, p), *mean_force(ring, top, b))
    felt_along, felt_across = ratio(gx, gy, gx_then, gy_then)
    left = math.hypot(along - felt_along, across - felt_across)
    return math.inf if math.isnan(left) else left


@compiled_part
def ratio(ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Return the quotient of two vectors as complex numbers: how the first is scaled and turned; NaN where b is 0."""
    size = bx * bx + by * by
    return (ax * bx + ay * by) / size, (ay * bx - ax * by) / size
