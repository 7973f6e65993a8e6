"""Shape of the contact in the image: area, centroid, axis, elongation, holes, corners."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.contact import not_numbers
from slipd.fusion.hull import convex_hull
from slipd.types.arrays import Array

CORNER_PITCHES = 0.6
"""A corner of the outline stands out from the chord of its neighbours by at least this share of a pitch; less is a
staircase of the grid."""


@dataclass(frozen=True, slots=True, eq=False)
class ContactShape:
    """Features of a tactile image, in the pad frame.

    Attributes:
        active: Number of active taxels.
        area_m2: Area of their cells, m²; uncertain by half a pitch all round.
        centroid_m: Centre of pressure of the image, shape (2,), m; NaN without contact.
        axis_rad: Direction of the longer principal axis, in (−π/2, π/2], rad; NaN where there is none.
        elongation: Ratio of the principal radii of gyration, ≥ 1 (inf: a line of taxels, each taken as a point); NaN
            without contact.
        holes: Regions of inactive taxels that the contact encloses.
        corners_m: Corners of the convex outline through the taxel centres, counter-clockwise, shape (k, 2), m; k is 2
            for a line of taxels, 1 for one taxel.
    """

    active: int
    area_m2: float
    centroid_m: Array
    axis_rad: float
    elongation: float
    holes: int
    corners_m: Array


def contact_shape(x: ArrayLike, y: ArrayLike, pressure: ArrayLike, pitch_m: float) -> ContactShape:
    """Find the shape of the contact from the image of a rectangular pad.

    Args:
        x: Taxel centres, shape (rows, cols), m, on a grid of the pitch.
        y: Likewise, shape (rows, cols), m.
        pressure: Readings, shape (rows, cols); a taxel is active when positive.
        pitch_m: Distance between neighbouring taxels, m.

    Raises:
        ValueError: A shape is wrong.
        TypeError: An argument is not numbers.

    >>> x, y = np.meshgrid(np.arange(4) * 0.003, np.arange(3) * 0.003)
    >>> found = contact_shape(x, y, [[1, 1, 1, 0], [1, 0, 1, 0], [1, 1, 1, 0]], 0.003)
    >>> found.active, found.holes, len(found.corners_m)
    (8, 1, 4)
    """
    try:
        xs, ys, p = (np.asarray(a, dtype=np.float64) for a in (x, y, pressure))
    except (TypeError, ValueError):
        raise not_numbers(x=x, y=y, pressure=pressure) from None
    if p.ndim != 2 or xs.shape != p.shape or ys.shape != p.shape:
        raise ValueError(f"x, y and pressure must share one shape (rows, cols), got {xs.shape}, {ys.shape}, {p.shape}")
    return shape_of(xs.ravel(), ys.ravel(), p.ravel(), p.shape[1], pitch_m)


def shape_of(x: Array, y: Array, p: Array, cols: int, pitch_m: float) -> ContactShape:
    """Find the shape of the contact as `contact_shape` does; nothing is checked.

    Args:
        x: Taxel centres in scan order, shape (n,), contiguous, m.
        y: Likewise.
        p: Readings, shape (n,), contiguous.
        cols: Number of columns of the pad.
        pitch_m: Distance between neighbouring taxels, m.
    """
    active, cx, cy, xx, yy, xy, holes, corners = _find_shape(x, y, p, cols, CORNER_PITCHES * pitch_m)
    axis, elongation = _principal_axis(xx, yy, xy) if active else (math.nan, math.nan)
    return ContactShape(active, active * pitch_m**2, np.array((cx, cy)), axis, elongation, holes, corners)


@compiled
def _find_shape(
    x: Array, y: Array, p: Array, cols: int, least_m: float
) -> tuple[int, float, float, float, float, float, int, Array]:
    """Return what `_shape_moments` does, the number of holes, and the corners."""
    active, cx, cy, xx, yy, xy = _shape_moments(x, y, p)
    return active, cx, cy, xx, yy, xy, _holes(p, cols), _corners(x, y, p, active, least_m)


@compiled_part
def _shape_moments(x: Array, y: Array, p: Array) -> tuple[int, float, float, float, float, float]:
    """Return the number of active taxels, the centre of pressure, and the second moments of their centres, m²; or NaN.

    The second moments do not weigh by pressure: pressures would make a tilted grip look long.
    """
    active, total, cx, cy, mx, my = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(p.size):
        if p[k] > 0.0:
            active += 1
            total += p[k]
            cx += p[k] * x[k]
            cy += p[k] * y[k]
            mx += x[k]
            my += y[k]
    if active == 0:
        return 0, math.nan, math.nan, math.nan, math.nan, math.nan
    xx, yy, xy = 0.0, 0.0, 0.0
    for k in range(p.size):
        if p[k] > 0.0:
            dx, dy = x[k] - mx / active, y[k] - my / active
            xx += dx * dx
            yy += dy * dy
            xy += dx * dy
    return active, cx / total, cy / total, xx, yy, xy


def _principal_axis(xx: float, yy: float, xy: float) -> tuple[float, float]:
    """Return axis and elongation of a shape by its second moments."""
    radius = math.hypot(0.5 * (xx - yy), xy)
    large, small = 0.5 * (xx + yy) + radius, max(0.5 * (xx + yy) - radius, 0.0)
    if large == 0.0 or radius <= 1e-9 * large:
        return math.nan, 1.0
    elongation = math.sqrt(large / small) if small > 1e-12 * large else math.inf
    return 0.5 * math.atan2(2.0 * xy, xx - yy), elongation


@compiled_part
def _holes(p: Array, cols: int) -> int:
    """Count inactive regions that do not reach the border; taxels connect across corners, gaps only across sides."""
    rows = p.size // cols
    done = np.zeros((rows + 2) * (cols + 2), np.bool_)  # with a frame, so that all that is outside is one region
    for row in range(rows):
        for col in range(cols):
            done[(row + 1) * (cols + 2) + col + 1] = p[row * cols + col] > 0.0
    waiting, regions = np.empty(done.size, np.int64), 0
    for start in range(done.size):
        if done[start]:
            continue
        regions += 1
        done[start], waiting[0], count = True, start, 1
        while count > 0:
            count -= 1
            at = waiting[count]
            for step in (-1, 1, -cols - 2, cols + 2):
                beside = at + step
                if 0 <= beside < done.size and not done[beside]:
                    done[beside], waiting[count] = True, beside
                    count += 1
    return regions - 1


@compiled_part
def _corners(x: Array, y: Array, p: Array, active: int, least_m: float) -> Array:
    """Return the corners of the hull of the active taxels, shape (k, 2), m.

    Those that the grid makes are left out: they are the flattest.
    """
    ax, ay, found = np.empty(active), np.empty(active), 0
    for k in range(p.size):
        if p[k] > 0.0:
            ax[found], ay[found] = x[k], y[k]
            found += 1
    outline = convex_hull(ax, ay)
    count = outline.size
    while count > 3:
        flattest, lowest_m = 0, math.inf
        for k in range(count):
            a, b, c = outline[(k - 1) % count], outline[k], outline[(k + 1) % count]
            ex, ey = ax[c] - ax[a], ay[c] - ay[a]
            height_m = abs(ex * (ay[b] - ay[a]) - ey * (ax[b] - ax[a])) / math.hypot(ex, ey)
            if height_m < lowest_m:
                flattest, lowest_m = k, height_m
        if lowest_m >= least_m:
            break
        count -= 1
        for k in range(flattest, count):
            outline[k] = outline[k + 1]
    corners = np.empty((count, 2))
    for k in range(count):
        corners[k, 0], corners[k, 1] = ax[outline[k]], ay[outline[k]]
    return corners
