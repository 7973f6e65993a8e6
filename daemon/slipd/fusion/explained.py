"""Whether the motion of the arm explains a fall of the load.

The tangential force of an object that sticks is its mass times the apparent gravity γ along the pad. So the force after
a fall over that before is γ after over γ before, in length and in direction, and the required friction falls by the
same part, whatever the mass and the axes of γ are. Friction of an object that slides does not follow γ.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled
from slipd.fusion.load_blocks import RING
from slipd.fusion.rows import Row, Rows

LEFT = 0.4
"""Motion that explains a fall leaves at most this part of it. In simulated grasps that are carried it leaves mostly
less than 0.3 where the object sticks, and more than 0.6 where it slides."""


@compiled
def is_explained(drop: Row, ring: Rows, p: int, top: int, b: int, low: float, high: float) -> bool:
    """Return whether a fall follows the motion of the arm; False where that was not known all the time.

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
    k = drop["block"]
    if drop["unfelt"] > top - b:
        return False
    now, end, then, begin = ring[k % RING], ring[(k - p) % RING], ring[top % RING], ring[(top - b) % RING]
    fx, fy, share = then["fx"] - begin["fx"], then["fy"] - begin["fy"], b / p
    force = _ratio(share * (now["fx"] - end["fx"]), share * (now["fy"] - end["fy"]), fx, fy)
    gx, gy = then["gx"] - begin["gx"], then["gy"] - begin["gy"]
    mean = _ratio(share * (now["gx"] - end["gx"]), share * (now["gy"] - end["gy"]), gx, gy)
    last = ring[(k - 1) % RING]
    newest = _ratio(b * (now["gx"] - last["gx"]), b * (now["gy"] - last["gy"]), gx, gy)
    return min(_left(force, low / high, mean), _left(force, low / high, newest)) <= LEFT * (1.0 - low / high)


@compiled
def _ratio(ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Return the quotient of two vectors as complex numbers: how the first is scaled and turned; NaN where b is 0."""
    size = bx * bx + by * by
    return (ax * bx + ay * by) / size, (ay * bx - ax * by) / size


@compiled
def _left(force: tuple[float, float], q: float, felt: tuple[float, float]) -> float:
    """Return what γ leaves unexplained of the change of the force, and of q, as ratios; infinite where γ was 0."""
    left = max(math.hypot(force[0] - felt[0], force[1] - felt[1]), abs(q - math.hypot(felt[0], felt[1])))
    return math.inf if math.isnan(left) else left
