"""The smallest convex curve round the active taxels, and where a point lies against it (paper Fig. 2c)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipd.fusion.compiled import compiled

Array = NDArray[np.float64]


@compiled
def convex_hull(x: Array, y: Array) -> NDArray[np.int64]:
    """Indices of the hull's corners, counter-clockwise, collinear points left out (monotone chain)."""
    n = x.size
    by_y = np.argsort(y, kind="mergesort")
    order = by_y[np.argsort(x[by_y], kind="mergesort")]
    hull = np.empty(2 * n, np.int64)
    size = 0
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
def nearest_on_outline(x: Array, y: Array, px: float, py: float) -> tuple[float, float, float, int, int]:
    """Signed distance of a point to a convex outline (positive inside), the nearest point on it, and its edge's ends.

    The corners x, y run counter-clockwise; fewer than three have no inside.
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
def margins(x: Array, y: Array, points: Array) -> Array:
    """Signed distance of each point to a convex outline, positive inside; NaN for points that are not finite."""
    out = np.full(len(points), math.nan)
    for k in range(len(points)):
        px, py = points[k, 0], points[k, 1]
        if math.isfinite(px + py):
            out[k] = nearest_on_outline(x, y, px, py)[0]
    return out


class Outline:
    """The convex outline through the centres of the active taxels, found once an image.

    Args:
        x: Centres of the active taxels, shape (n,), n ≥ 1, finite, m.
        y: Likewise, shape (n,), m.
    """

    def __init__(self, x: Array, y: Array) -> None:
        self.taxels = convex_hull(x, y)
        self._x, self._y = x[self.taxels], y[self.taxels]

    def margin_m(self, px: float, py: float) -> float:
        """Signed distance of a point to the outline, m, positive inside; NaN for a point that is not finite."""
        return nearest_on_outline(self._x, self._y, px, py)[0] if math.isfinite(px + py) else math.nan

    def margins_m(self, points: Array) -> Array:
        """`margin_m` of several points: the first two columns, shape (n, 2) or wider."""
        return margins(self._x, self._y, points)

    def nearest(self, px: float, py: float) -> tuple[float, float, float, int, int]:
        """Signed distance of a point, the nearest point on the outline, and the taxels at the ends of its edge."""
        margin, qx, qy, a, b = nearest_on_outline(self._x, self._y, px, py)
        return margin, qx, qy, int(self.taxels[a]), int(self.taxels[b])


def tipping_margin(x: ArrayLike, y: ArrayLike, point: ArrayLike) -> float:
    """Finds how far a point lies inside the hull of the active taxels.

    A hull of one point or of collinear taxels has no inside. A taxel senses over its electrode, so the hull itself is
    uncertain by half a pitch.

    Args:
        x: Centres of the active taxels, shape (n,), m.
        y: Likewise, shape (n,), m.
        point: The contact centroid, shape (2,), m.

    Returns:
        Signed distance to the hull, m, positive inside; NaN without taxels or with data that is not finite.

    Raises:
        ValueError: Wrong shapes.

    Source: paper, last paragraph of the integration section.
    """
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    p = np.asarray(point, dtype=np.float64)
    if xs.ndim != 1 or xs.shape != ys.shape or p.shape != (2,):
        raise ValueError(f"x and y must share one shape (n,) and point be (2,), not {xs.shape}, {ys.shape}, {p.shape}")
    if xs.size == 0 or not (np.isfinite(xs).all() and np.isfinite(ys).all() and np.isfinite(p).all()):
        return math.nan
    return Outline(xs, ys).margin_m(float(p[0]), float(p[1]))
