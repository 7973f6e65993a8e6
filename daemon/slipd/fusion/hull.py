"""The convex hull of the active taxels, and where the contact centroid lies in it: tipping (paper Fig. 2c)."""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.rows import Rows
from slipd.types.arrays import Array, Indices


@compiled_part
def convex_hull(x: Array, y: Array) -> Indices:
    """Return the indices of the hull's corners, counter-clockwise, without collinear points.

    Source: Andrew's monotone chain, Inf. Process. Lett. 9(5), 1979.
    """
    n, size = x.size, 0
    order, hull = np.empty(n, np.int64), np.empty(2 * n, np.int64)
    for k in range(n):  # by x, then by y; taxels come in rows, so this takes a few microseconds
        at = k
        while at > 0 and (x[k] < x[order[at - 1]] or (x[k] == x[order[at - 1]] and y[k] < y[order[at - 1]])):
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
    for turn in range(2):  # the lower chain from left to right, then the upper one back
        start = size
        for step in range(n):
            k = order[step] if turn == 0 else order[n - 1 - step]
            while size - start >= 2:
                a, b = hull[size - 2], hull[size - 1]
                if (x[b] - x[a]) * (y[k] - y[a]) - (y[b] - y[a]) * (x[k] - x[a]) > 0.0:
                    break
                size -= 1
            hull[size] = k
            size += 1
        size -= 1  # the chain's last point opens the next chain
    distinct = 0
    for i in range(size):
        a, b = hull[i], hull[(i + 1) % size]
        if x[a] != x[b] or y[a] != y[b]:
            hull[distinct] = a
            distinct += 1
    return hull[:distinct].copy() if distinct > 0 else order[:1].copy()


@compiled
def _outline(x: Array, y: Array) -> tuple[Indices, Array, Array, float]:
    """Return the attributes of an `Outline`."""
    taxels = convex_hull(x, y)
    corners_x, corners_y = x[taxels], y[taxels]
    return taxels, corners_x, corners_y, max(corners_x.max() - corners_x.min(), corners_y.max() - corners_y.min())


@compiled
def nearest_on_outline(x: Array, y: Array, px: float, py: float) -> tuple[float, float, float, int, int]:
    """Find the nearest point on a convex outline.

    Args:
        x: Corners of the outline, counter-clockwise, shape (n,); fewer than three have no inside.
        y: Likewise.
        px: The point.
        py: Likewise.

    Returns:
        Signed distance (positive inside), the nearest point (2), and the indices of the corners at its edge's ends.
    """
    size = x.size
    best, qx, qy, ea, eb = math.inf, x[0], y[0], 0, 0
    inside = size > 2
    for a in range(size):
        b = (a + 1) % size
        ex, ey = x[b] - x[a], y[b] - y[a]
        length2 = ex * ex + ey * ey
        share = ((px - x[a]) * ex + (py - y[a]) * ey) / length2 if length2 > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        nx, ny = x[a] + share * ex, y[a] + share * ey
        distance = math.hypot(px - nx, py - ny)
        if distance < best:
            best, qx, qy, ea, eb = distance, nx, ny, a, b
        if ex * (py - y[a]) - ey * (px - x[a]) < 0.0:
            inside = False
    return (best if inside else 0.0 - best), qx, qy, ea, eb


@compiled
def fill_margins(x: Array, y: Array, readings: Rows) -> None:
    """Fill in ``tipping_margin_m`` of rows of READING where the centroid is finite.

    Args:
        x: Corners of the outline, counter-clockwise, shape (n,), m.
        y: Likewise.
        readings: Rows of READING.
    """
    for k in range(len(readings)):
        contact = readings[k]["contact"]
        px, py = contact["cx_m"], contact["cy_m"]
        if math.isfinite(px + py):
            readings[k]["tipping_margin_m"] = nearest_on_outline(x, y, px, py)[0]


class Outline:
    """The convex outline through the centres of the active taxels, found once per image.

    Args:
        x: Centres of the active taxels, shape (n,), n ≥ 1, finite, m.
        y: Likewise, shape (n,), m.

    Attributes:
        taxels: Indices of the outline's corners, counter-clockwise.
        x: Those corners along X, m.
        y: Likewise along Y, m.
        extent_m: Its extent along X or Y, the larger one, m.
    """

    def __init__(self, x: Array, y: Array) -> None:
        self.taxels, self.x, self.y, self.extent_m = _outline(x, y)

    def margin_m(self, px: float, py: float) -> float:
        """Return the signed distance of a point to the outline, m, positive inside; NaN where it is not finite."""
        return nearest_on_outline(self.x, self.y, px, py)[0] if math.isfinite(px + py) else math.nan

    def nearest(self, px: float, py: float) -> tuple[float, float, float, int, int]:
        """Return a point's signed distance, the nearest point on the outline, and the taxels at its edge's ends."""
        margin, qx, qy, a, b = nearest_on_outline(self.x, self.y, px, py)
        return margin, qx, qy, int(self.taxels[a]), int(self.taxels[b])
