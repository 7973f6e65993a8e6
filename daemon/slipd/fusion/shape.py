"""Shape of the contact in the image: area, centroid, axis, elongation, holes, corners."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

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
    """
    xs, ys, p = (np.asarray(a, dtype=np.float64) for a in (x, y, pressure))
    if p.ndim != 2 or xs.shape != p.shape or ys.shape != p.shape:
        raise ValueError(f"x, y and pressure must share one shape (rows, cols), got {xs.shape}, {ys.shape}, {p.shape}")
    on = p > 0.0
    count = int(on.sum())
    if count == 0:
        nan2 = np.full(2, math.nan)
        return ContactShape(0, 0.0, nan2, math.nan, math.nan, 0, np.empty((0, 2)))
    ax, ay, weight = xs[on], ys[on], p[on] / p[on].sum()
    centroid = np.array((weight @ ax, weight @ ay))
    axis, elongation = _principal_axis(ax - centroid[0], ay - centroid[1])
    return ContactShape(count, count * pitch_m**2, centroid, axis, elongation, _holes(on), _corners(ax, ay, pitch_m))


def _principal_axis(dx: Array, dy: Array) -> tuple[float, float]:
    """Return axis and elongation of the binary shape: pressures would make a tilted grip look long."""
    dx, dy = dx - dx.mean(), dy - dy.mean()
    xx, yy, xy = float(dx @ dx), float(dy @ dy), float(dx @ dy)
    radius = math.hypot(0.5 * (xx - yy), xy)
    large, small = 0.5 * (xx + yy) + radius, max(0.5 * (xx + yy) - radius, 0.0)
    if large == 0.0 or radius <= 1e-9 * large:
        return math.nan, 1.0
    elongation = math.sqrt(large / small) if small > 1e-12 * large else math.inf
    return 0.5 * math.atan2(2.0 * xy, xx - yy), elongation


def _holes(on: NDArray[np.bool_]) -> int:
    """Count inactive regions that do not reach the border; taxels connect across corners, gaps only across sides."""
    rows, cols = on.shape
    off = np.ones((rows + 2, cols + 2), dtype=bool)  # framed, so that all that is outside is one region
    off[1:-1, 1:-1] = ~on
    _, regions = ndimage.label(off)
    return int(regions) - 1


def _corners(ax: Array, ay: Array, pitch_m: float) -> Array:
    """Return the corners of the hull of the active taxels, without those that the grid makes."""
    outline = [(float(ax[k]), float(ay[k])) for k in convex_hull(ax, ay)]
    while len(outline) > 3:
        heights = [_height(outline[k - 1], outline[k], outline[(k + 1) % len(outline)]) for k in range(len(outline))]
        flattest = int(np.argmin(heights))
        if heights[flattest] >= CORNER_PITCHES * pitch_m:
            break
        del outline[flattest]
    return np.array(outline)


def _height(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return the distance of b from the line through a and c."""
    ex, ey = c[0] - a[0], c[1] - a[1]
    return abs(ex * (b[1] - a[1]) - ey * (b[0] - a[0])) / math.hypot(ex, ey)
