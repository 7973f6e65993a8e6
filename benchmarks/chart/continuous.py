"""Contacts as they are before any taxel sees them, and what the pad's image makes of them.

A patch has a pressure at every point, so its friction limit is an integral; a quadrature of a hundred thousand points
stands for it here, three orders of magnitude finer than any image. The same pressure averaged over the electrodes is
the image. The two side by side tell what an image costs, which no comparison of solvers can.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from chart.scenes import COLS, PITCH_M, ROWS

from slipd.types.arrays import Array

Random = np.random.Generator

PAD_X_M, PAD_Y_M = COLS * PITCH_M, ROWS * PITCH_M
ELECTRODE_M = 1.5e-3  # diameter
ELECTRODE_POINTS = 64  # of the average over an electrode: 1 % of its area each
RINGS, SPOKES = 200, 512  # quadrature of a round patch
SIDE = 320  # quadrature of a rectangular patch: SIDE² points
LEAST_M, MOST_M = 2e-3, 12e-3  # half sizes: from one taxel to the whole width of the pad


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A contact with a pressure at every point.

    Its own coordinates (u, v) are those of the unit disc or of the square [−1, 1]², turned, stretched and moved.

    Attributes:
        shape: Name of the shape.
        centre: Of the patch in the pad frame, not of its pressure; m.
        half: Half sizes along u and v, m.
        turn: Angle of the u axis, rad.
        round: The patch is an ellipse, else a rectangle.
        hole: Inner radius of a ring, as a share of the outer; 0: none.
        tilt: Slope of the pressure max(0, 1 + tilt · (u, v)); where it is negative the object has lifted off.
        hertz: The pressure is a semi-ellipsoid instead.
    """

    shape: str
    centre: tuple[float, float]
    half: tuple[float, float]
    turn: float = 0.0
    round: bool = True
    hole: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    hertz: bool = False

    def pressure(self, x: Array, y: Array) -> Array:
        """Pressure at points of the pad frame, any unit; nothing presses beyond the pad's edge."""
        ct, st = math.cos(self.turn), math.sin(self.turn)
        dx, dy = x - self.centre[0], y - self.centre[1]
        u, v = (ct * dx + st * dy) / self.half[0], (ct * dy - st * dx) / self.half[1]
        square = u * u + v * v
        inside = (square <= 1.0) & (square >= self.hole**2) if self.round else np.maximum(abs(u), abs(v)) <= 1.0
        on_pad = (abs(x) <= 0.5 * PAD_X_M) & (abs(y) <= 0.5 * PAD_Y_M)
        if self.hertz:
            height = np.sqrt(np.maximum(1.0 - square, 0.0))
        else:
            height = np.maximum(1.0 + self.tilt[0] * u + self.tilt[1] * v, 0.0)
        return np.asarray(np.where(inside & on_pad, height, 0.0))

    def points(self, finer: int = 1) -> tuple[Array, Array, Array]:
        """The continuous contact: midpoints of cells of equal area and their loads, which sum to 1.

        Args:
            finer: So many times the cells along each direction.

        Returns:
            x, y and loads, each shape (n,); cells without pressure are left out.
        """
        if self.round:
            k = (np.arange(finer * RINGS) + 0.5) / (finer * RINGS)
            radius = np.sqrt(self.hole**2 + (1.0 - self.hole**2) * k)
            angle = 2.0 * math.pi * (np.arange(finer * SPOKES) + 0.5) / (finer * SPOKES)
            u, v = np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel()
        else:
            k = (2.0 * np.arange(finer * SIDE) + 1.0) / (finer * SIDE) - 1.0
            u, v = (a.ravel() for a in np.meshgrid(k, k))
        ct, st = math.cos(self.turn), math.sin(self.turn)
        a, b = self.half[0] * u, self.half[1] * v
        x, y = self.centre[0] + ct * a - st * b, self.centre[1] + st * a + ct * b
        pressure = self.pressure(x, y)
        on = pressure > 0.0
        return x[on], y[on], pressure[on] / pressure.sum()


def image(patch: Patch, pitch_m: float = PITCH_M, electrode_m: float = ELECTRODE_M) -> tuple[Array, Array, Array]:
    """What a perfect pad reads of a patch: its pressure averaged over each round electrode.

    Args:
        patch: The contact.
        pitch_m: Distance of the taxels.
        electrode_m: Diameter of the electrodes.

    Returns:
        Taxel centres x and y and readings, each shape (n,); a taxel that nothing touches reads 0.
    """
    cols, rows = round(PAD_X_M / pitch_m), round(PAD_Y_M / pitch_m)
    x, y = np.meshgrid((np.arange(cols) - 0.5 * (cols - 1)) * pitch_m, (np.arange(rows) - 0.5 * (rows - 1)) * pitch_m)
    x, y = x.ravel(), y.ravel()
    k = np.arange(ELECTRODE_POINTS) + 0.5  # a sunflower: equal areas
    radius, angle = 0.5 * electrode_m * np.sqrt(k / ELECTRODE_POINTS), k * math.pi * (3.0 - math.sqrt(5.0))
    at_x, at_y = x[:, None] + radius * np.cos(angle), y[:, None] + radius * np.sin(angle)
    return x, y, patch.pressure(at_x, at_y).mean(axis=1)


def _size(rng: Random, least: float = LEAST_M, most: float = MOST_M) -> float:
    return float(least * (most / least) ** rng.random())


def _placed(rng: Random, patch: Patch) -> Patch:
    """The patch turned at random and put anywhere on the pad where it fits whole; a long one turns until it fits."""
    while True:
        turn = rng.uniform(0.0, math.pi)
        reach_x, reach_y = _reach(patch.half, turn, patch.round)
        room_x, room_y = 0.5 * PAD_X_M - reach_x, 0.5 * PAD_Y_M - reach_y
        if min(room_x, room_y) >= 0.0:
            centre = (rng.uniform(-room_x, room_x), rng.uniform(-room_y, room_y))
            return _moved(patch, centre, turn)


def _reach(half: tuple[float, float], turn: float, is_round: bool) -> tuple[float, float]:
    """Half extents along the pad's axes, m."""
    c, s = abs(math.cos(turn)), abs(math.sin(turn))
    a, b = half
    if is_round:
        return math.hypot(a * c, b * s), math.hypot(a * s, b * c)
    return a * c + b * s, a * s + b * c


def _moved(patch: Patch, centre: tuple[float, float], turn: float) -> Patch:
    return Patch(patch.shape, centre, patch.half, turn, patch.round, patch.hole, patch.tilt, patch.hertz)


def disc(rng: Random) -> Patch:
    """A flat round end: even pressure."""
    a = _size(rng)
    return _placed(rng, Patch("disc", (0.0, 0.0), (a, a)))


def hertz(rng: Random) -> Patch:
    """A rounded body: the semi-ellipsoid of pressure over an ellipse, the short axis from 0.4 of the long one."""
    a = _size(rng)
    return _placed(rng, Patch("Hertz", (0.0, 0.0), (a, a * rng.uniform(0.4, 1.0)), hertz=True))


def rectangle(rng: Random) -> Patch:
    """A flat bar: even pressure, the short side from 0.2 of the long one."""
    a = _size(rng)
    return _placed(rng, Patch("rectangle", (0.0, 0.0), (a, a * rng.uniform(0.2, 1.0)), round=False))


def ring(rng: Random) -> Patch:
    """The rim of a cup or a tube: even pressure between two circles."""
    a = _size(rng, 4e-3)
    return _placed(rng, Patch("ring", (0.0, 0.0), (a, a), hole=rng.uniform(0.4, 0.9)))


def tilted(rng: Random) -> Patch:
    """A flat end pressed askew: pressure linear over the patch, partly lifted off where the slope exceeds 1."""
    a, slope, along = _size(rng), rng.uniform(0.3, 3.0), rng.uniform(0.0, 2.0 * math.pi)
    tilt = (slope * math.cos(along), slope * math.sin(along))
    return _placed(
        rng, Patch("tilted", (0.0, 0.0), (a, a * rng.uniform(0.4, 1.0)), round=bool(rng.integers(2)), tilt=tilt)
    )


def overhanging(rng: Random) -> Patch:
    """A patch of which the pad's edge cuts off from a quarter to three quarters of the width."""
    a, is_round = _size(rng, 3e-3), bool(rng.integers(2))
    patch = Patch(
        "overhanging", (0.0, 0.0), (a, a * rng.uniform(0.4, 1.0)), round=is_round,
        hertz=is_round and bool(rng.integers(2)),
    )  # fmt: skip
    turn, side = rng.uniform(0.0, math.pi), 1.0 if rng.integers(2) else -1.0
    reach_x, reach_y = _reach(patch.half, turn, is_round)
    inwards = rng.uniform(-0.5, 0.5)
    if rng.integers(2):
        free = max(0.5 * PAD_Y_M - reach_y, 0.0)
        return _moved(patch, (side * (0.5 * PAD_X_M - inwards * reach_x), rng.uniform(-free, free)), turn)
    free = max(0.5 * PAD_X_M - reach_x, 0.0)
    return _moved(patch, (rng.uniform(-free, free), side * (0.5 * PAD_Y_M - inwards * reach_y)), turn)


def line(rng: Random) -> Patch:
    """The edge of a body: 0.4 to 1.6 mm wide, so that it passes between electrodes as often as over them."""
    return _placed(rng, Patch("line", (0.0, 0.0), (_size(rng, 4e-3, 20e-3), _size(rng, 2e-4, 8e-4)), round=False))


SHAPES: dict[str, Callable[[Random], Patch]] = {
    "disc": disc,
    "Hertz": hertz,
    "rectangle": rectangle,
    "ring": ring,
    "tilted": tilted,
    "overhanging": overhanging,
    "line": line,
}
