"""The pressure of the contact: its profile, its tilt by a moment, and its mean over an electrode.

Lengths in m, forces in N; coordinates in the frame of the left pad unless called local. Local coordinates are those of
the patch's owner: the pad, or the object where the patch moves with it; both agree while the object has not moved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array

DISC, RING, RECTANGLE, STRIPS, EDGE, ROUNDED = range(6)
"""Profiles, see `ContactPatch`."""

TILT_ITERATIONS = 12
"""Most Newton steps for the tilt; three suffice while every cell keeps its pressure."""

TILT_REACH = 0.9
"""The tilt moves the centroid at most this share of the way to the rim; an object that tips further is not modelled."""


class Shape(NamedTuple):
    """A patch and what bounds it, as the kernels take it. Half lengths of a bound may be inf."""

    kind: int
    half_length: float
    half_width: float
    inner: float
    exponent: float
    cx: float
    cy: float
    object_x: float
    object_y: float
    object_half_x: float
    object_half_y: float
    pad_half_x: float
    pad_half_y: float
    blur: float
    moves: bool


class Pose(NamedTuple):
    """Where the object is: a point of it at (x0, y0) without displacement is at (x, y), turned by an angle."""

    x0: float
    y0: float
    x: float
    y: float
    cos: float
    sin: float


@compiled
def profile(shape: Shape, u: float, v: float) -> float:
    """Return the relative pressure at (u, v): local coordinates from the centre over the half lengths."""
    kind, inner = shape.kind, shape.inner
    if abs(u) >= 1.0 or abs(v) >= 1.0:
        return 0.0
    u2, v2 = u * u, v * v
    lean = 1.0
    if kind == DISC:
        rest = 1.0 - u2 - v2
    elif kind == ROUNDED:
        rest = 1.0 - u2 * u2 - v2 * v2
    elif kind == RING:
        across = (2.0 * math.sqrt(u2 + v2) - 1.0 - inner) / (1.0 - inner)
        rest = 1.0 - across * across
    elif kind == STRIPS:
        across = (2.0 * abs(v) - 1.0 - inner) / (1.0 - inner)
        rest = (1.0 - u2 * u2) * (1.0 - across * across) if abs(across) < 1.0 else 0.0
    else:
        rest = (1.0 - u2 * u2) * (1.0 - v2 * v2)
        if kind == EDGE:
            lean = 0.5 * (1.0 + u)
    if rest <= 0.0:
        return 0.0
    if shape.exponent == 0.0:
        return lean
    if shape.exponent == 0.5:
        return lean * math.sqrt(rest)
    return float(lean * rest**shape.exponent)


@compiled
def cell_profile(shape: Shape, scale: float, x: float, y: float) -> float:
    """Return the mean relative pressure of a cell, from a point in each quarter, at local coordinates."""
    a, b, quarter = scale * shape.half_length, scale * shape.half_width, 0.25 * shape.blur
    low_u, high_u = (x - shape.cx - quarter) / a, (x - shape.cx + quarter) / a
    low_v, high_v = (y - shape.cy - quarter) / b, (y - shape.cy + quarter) / b
    low = profile(shape, low_u, low_v) + profile(shape, high_u, low_v)
    return 0.25 * (low + (profile(shape, low_u, high_v) + profile(shape, high_u, high_v)))


@compiled
def inside(half: float, away: float, blur: float) -> float:
    """Return the share of a cell, of side ``blur``, that is within a bound."""
    if half == math.inf:
        return 1.0
    return min(max((half - abs(away)) / blur + 0.5, 0.0), 1.0)


@compiled
def covered(shape: Shape, px: float, py: float, ox: float, oy: float) -> float:
    """Return the share of a cell at (px, py) on the pad and at (ox, oy) on the object that is within both."""
    share = inside(shape.object_half_x, ox - shape.object_x, shape.blur)
    share *= inside(shape.object_half_y, oy - shape.object_y, shape.blur)
    return share * (inside(shape.pad_half_x, px, shape.blur) * inside(shape.pad_half_y, py, shape.blur))


@compiled
def place_cells(shape: Shape, pose: Pose, cells: Array, on_pad: Array, on_object: Array) -> None:
    """Write where the cells, given in local coordinates, are on the pad and on the object; all shapes (2, n)."""
    for i in range(cells.shape[1]):
        x, y = cells[0, i], cells[1, i]
        if shape.moves:
            dx, dy = x - pose.x0, y - pose.y0
            on_pad[0, i] = pose.x + pose.cos * dx - pose.sin * dy
            on_pad[1, i] = pose.y + pose.sin * dx + pose.cos * dy
            on_object[0, i], on_object[1, i] = x, y
        else:
            dx, dy = x - pose.x, y - pose.y
            on_pad[0, i], on_pad[1, i] = x, y
            on_object[0, i] = pose.x0 + pose.cos * dx + pose.sin * dy
            on_object[1, i] = pose.y0 - pose.sin * dx + pose.cos * dy


@compiled
def press(
    shape: Shape, scale: float, normal: float, shift_x: float, shift_y: float,
    on_pad: Array, on_object: Array, loads: Array, field: Array,
) -> None:  # fmt: skip
    """Write the normal force on each cell: the profile, tilted so that its centroid moves by a shift.

    The tilted pressure is max(0, 1 + a (x − x̄) + b (y − ȳ)) times the profile; Newton's method finds (a, b).

    Args:
        shape: The patch.
        scale: Size of the patch over its size at the reference force.
        normal: Normal force, N. The loads are 0 where nothing is left of the contact.
        shift_x: Wanted shift of the centroid, m.
        shift_y: Likewise.
        on_pad: Cells, shape (2, n), m.
        on_object: Likewise.
        loads: Gets the normal force on each cell, shape (n,), N.
        field: Gets (Pa per relative pressure and m² of a cell, a, b, x̄, ȳ, centroid x, centroid y).
    """
    n = loads.size
    total, mx, my = 0.0, 0.0, 0.0
    low_x, high_x, low_y, high_y = math.inf, -math.inf, math.inf, -math.inf
    for i in range(n):
        x, y = on_pad[0, i], on_pad[1, i]
        ox, oy = on_object[0, i], on_object[1, i]
        lx, ly = (ox, oy) if shape.moves else (x, y)
        q = cell_profile(shape, scale, lx, ly)
        if q > 0.0:
            q *= covered(shape, x, y, ox, oy)
        loads[i] = q
        if q > 0.0:
            total, mx, my = total + q, mx + q * x, my + q * y
            low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
    for i in range(field.size):
        field[i] = 0.0
    if total <= 0.0 or normal <= 0.0:
        for i in range(n):
            loads[i] = 0.0
        return
    mx, my = mx / total, my / total
    field[3], field[4] = mx, my
    if shift_x != 0.0 or shift_y != 0.0:
        goal_x = mx + min(max(shift_x, TILT_REACH * (low_x - mx)), TILT_REACH * (high_x - mx))
        goal_y = my + min(max(shift_y, TILT_REACH * (low_y - my)), TILT_REACH * (high_y - my))
        _tilt(on_pad, loads, goal_x, goal_y, field)
    a, b = field[1], field[2]
    total, sx, sy = 0.0, 0.0, 0.0
    for i in range(n):
        if loads[i] > 0.0:
            x, y = on_pad[0, i], on_pad[1, i]
            loads[i] *= max(0.0, 1.0 + a * (x - mx) + b * (y - my))
            total, sx, sy = total + loads[i], sx + loads[i] * x, sy + loads[i] * y
    for i in range(n):
        loads[i] *= normal / total
    field[0], field[5], field[6] = normal / total, sx / total, sy / total


@compiled
def _tilt(on_pad: Array, profiles: Array, goal_x: float, goal_y: float, field: Array) -> None:
    """Find the tilt (a, b) about (x̄, ȳ), all in ``field``, whose centroid is the goal."""
    mx, my = field[3], field[4]
    a, b, da, db = 0.0, 0.0, 0.0, 0.0
    for _ in range(TILT_ITERATIONS):
        s, sxx, sxy, syx, syy, ux, uy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(profiles.size):
            x, y = on_pad[0, i] - mx, on_pad[1, i] - my
            weight = 1.0 + a * x + b * y
            if weight > 0.0 and profiles[i] > 0.0:
                gx, gy = on_pad[0, i] - goal_x, on_pad[1, i] - goal_y
                q = profiles[i]
                s += q * weight
                ux, uy = ux + q * weight * gx, uy + q * weight * gy
                sxx, sxy = sxx + q * x * gx, sxy + q * y * gx
                syx, syy = syx + q * x * gy, syy + q * y * gy
        det = sxx * syy - sxy * syx
        if s <= 0.0 or abs(det) < 1e-30 * s * s:  # too far: nothing, or less than a plane, keeps its pressure
            da, db = 0.5 * da, 0.5 * db
            a, b = a + da, b + db
            continue
        da, db = (ux * syy - uy * sxy) / det, (uy * sxx - ux * syx) / det
        a, b = a - da, b - db
        if abs(ux) + abs(uy) < 1e-9 * s:
            break
    field[1], field[2] = a, b


@compiled
def electrode_loads(
    shape: Shape, scale: float, pose: Pose, field: Array, points: Array, mirror: float, area: float, out: Array
) -> None:
    """Write the reading of every taxel: the mean pressure at its points times the area of its cell.

    Args:
        shape: The patch.
        scale: As in `press`.
        pose: Of the object.
        field: As `press` wrote it, with its first number in Pa per relative pressure.
        points: Points across the electrodes in the frame of their own pad, shape (2, taxels, m), m.
        mirror: 1 for the left pad, −1 for the right one.
        area: Area of a taxel's cell, m².
        out: Gets the readings, shape (taxels,), N.
    """
    a, b = scale * shape.half_length, scale * shape.half_width
    for t in range(out.size):
        total = 0.0
        for j in range(points.shape[2]):
            px, py = points[0, t, j], mirror * points[1, t, j]
            dx, dy = px - pose.x, py - pose.y
            ox, oy = pose.x0 + pose.cos * dx + pose.sin * dy, pose.y0 - pose.sin * dx + pose.cos * dy
            lx, ly = (ox, oy) if shape.moves else (px, py)
            q = profile(shape, (lx - shape.cx) / a, (ly - shape.cy) / b)
            if q > 0.0:
                q *= covered(shape, px, py, ox, oy)
                total += q * max(0.0, 1.0 + field[1] * (px - field[3]) + field[2] * (py - field[4]))
        out[t] = total * field[0] * area / points.shape[2]


@compiled
def map_factors(x0: float, y0: float, cell: float, values: Array, on_object: Array, loads: Array, out: Array) -> None:
    """Write the loads times a map's value at each cell, bilinear between the points of the map and constant beyond."""
    rows, cols = values.shape
    for i in range(loads.size):
        u = min(max((on_object[0, i] - x0) / cell, 0.0), cols - 1.0)
        v = min(max((on_object[1, i] - y0) / cell, 0.0), rows - 1.0)
        j, k = min(int(u), cols - 2), min(int(v), rows - 2)
        u, v = u - j, v - k
        low = values[k, j] * (1.0 - u) + values[k, j + 1] * u
        high = values[k + 1, j] * (1.0 - u) + values[k + 1, j + 1] * u
        out[i] = loads[i] * (low * (1.0 - v) + high * v)
