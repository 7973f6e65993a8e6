"""Measured friction: 250 pushes of a sliding object, against each model of the friction limit.

What slides stands *on* the limit surface, so a right model reads utilisation 1 within the scatter of the friction, and
its normal there is the motion that was measured. One μ a layout is fitted, so that the exact reading has median 1.

The sign: friction on the object would oppose its motion, and power f · v + m ω would be negative. In this data it is
positive in every push, so the wrench in the file is the load that friction carries, on the side of the motion; that is
the sign of ``tangential`` and ``spin`` here, and the motion is the *outward* normal.
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from dataclasses import dataclass
from functools import cache

import numpy as np
from bench.tables import Table
from project import DATA

from slipd.fusion import torque_limit, utilisation
from slipd.types.arrays import Array

PUSHES = DATA / "pushes"
WEIGHT_N = 1.518 * 9.81
PATCH_SIDE_M, PATCH_CELLS = 0.150, 60  # the layout "patch" rests on its whole triangle
ABOUT = (0.0, 0.0)  # the centre of mass
LOWER = 0.995  # the same with a μ so much lower, to tell what hangs on the fit


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """The supports of the object and the pushes measured on them; about the centre of mass, in the object's frame.

    Attributes:
        name: Of the log.
        x: Supports, shape (n,), m.
        y: Likewise.
        loads: Normal force on each, N.
        wrenches: Load that friction carries while the object slides, shape (pushes, 3): N, N, N·m.
        motions: Displacement, shape (pushes, 3): m, m, rad.
    """

    name: str
    x: Array
    y: Array
    loads: Array
    wrenches: Array
    motions: Array

    @property
    def gyration_m(self) -> float:
        """Radius of gyration of the loads about the centre of mass: it makes a turn commensurable with a shift."""
        return math.sqrt(self.loads @ (self.x**2 + self.y**2) / self.loads.sum())

    @property
    def arm_m(self) -> float:
        """Mean distance of the loads from the centre of mass: μ times the weight times it is the ellipsoid's torque."""
        return float(self.loads @ np.hypot(self.x, self.y) / self.loads.sum())

    def fitted_mu(self) -> float:
        """The friction coefficient with which the median push reads utilisation 1."""
        return float(np.median([self.exact(push, 1.0)[0] for push in range(len(self.wrenches))]))

    def exact(self, push: int, mu: float) -> tuple[float, Array]:
        """Utilisation, and the motion that would begin: (v_x, v_y, ω) of the centre of mass but for a factor."""
        fx, fy, m = self.wrenches[push]
        found = utilisation(self.x, self.y, self.loads, mu, (fx, fy), m, ABOUT)
        return found.value, np.array(found.twist)

    def ellipsoid(self, push: int, mu: float) -> tuple[float, Array]:
        """Likewise of the ellipsoid (|f| / μN)² + (m / μN r)² = 1."""
        fx, fy, m = self.wrenches[push]
        grip = mu * WEIGHT_N
        value = math.hypot(fx / grip, fy / grip, m / (grip * self.arm_m))
        return value, np.array((fx, fy, m / self.arm_m**2))

    def translation(self, push: int, mu: float) -> tuple[float, Array]:
        """Likewise of a model that knows no torque: R / μ."""
        fx, fy, _ = self.wrenches[push]
        return math.hypot(fx, fy) / (mu * WEIGHT_N), np.array((fx, fy, 0.0))

    def printed(self, push: int, mu: float) -> float:
        """(6) as printed: |m| about C over μ Σ F |r − P|, a torque about P; inf where there is no pole (R ≥ μ)."""
        fx, fy, m = self.wrenches[push]
        pole = torque_limit(self.x, self.y, self.loads, mu, (fx, fy), ABOUT, 1 if m >= 0.0 else -1).pole_m
        if pole is None:
            return math.inf
        return float(abs(m) / (mu * (self.loads @ np.hypot(self.x - pole[0], self.y - pole[1]))))

    def angle_deg(self, push: int, twist: Array) -> float:
        """Between a predicted motion and the measured one, turns times the radius of gyration; 0 to 180."""
        length = np.array((1.0, 1.0, self.gyration_m))
        a, b = twist * length, self.motions[push] * length
        return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))


@cache
def layouts() -> tuple[Layout, ...]:
    """The five layouts, from ``tests/data/pushes``."""
    rows: dict[str, list[list[float]]] = defaultdict(list)
    with (PUSHES / "pushes_board.csv").open() as file:
        for row in csv.DictReader(file):
            rows[row["layout"]].append(
                [float(row[key]) for key in ("fx_n", "fy_n", "m_nm", "dx_m", "dy_m", "dtheta_rad")]
            )
    return tuple(
        Layout(name, *_supports(name), np.array(found)[:, :3], np.array(found)[:, 3:]) for name, found in rows.items()
    )


def _supports(layout: str) -> tuple[Array, Array, Array]:
    """Places and loads: of the file, or the triangle's cells, those on its long side halved, centroid at the origin."""
    if layout == "patch":
        row, col = (a.ravel() for a in np.indices((PATCH_CELLS, PATCH_CELLS)))
        beyond = row + col - (PATCH_CELLS - 1)
        whole, half = beyond < 0, beyond == 0
        inward = np.where(half, 1.0 / 6.0, 0.0)  # from a cell's middle to the centroid of its half
        x, y = ((a + 0.5 - inward)[whole | half] * PATCH_SIDE_M / PATCH_CELLS - PATCH_SIDE_M / 3.0 for a in (col, row))
        share = np.where(half, 1.0, 2.0)[whole | half] / PATCH_CELLS**2
        return x, y, share * WEIGHT_N
    with (PUSHES / "supports_board.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["layout"] == layout]
    x, y, share = (np.array([float(row[key]) for row in rows]) for key in ("x_m", "y_m", "load_fraction"))
    return x, y, share * WEIGHT_N


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """What each model makes of the pushes of a layout, every array of shape (pushes,).

    Attributes:
        layout: Which.
        mu: Fitted.
        used: By model: utilisation; of "(6) as printed", the ratio that it compares with 1.
        angle_deg: By model: between the predicted and the measured motion.
    """

    layout: Layout
    mu: float
    used: dict[str, Array]
    angle_deg: dict[str, Array]


@cache
def readings() -> tuple[Readings, ...]:
    """All layouts."""
    return tuple(_read(layout) for layout in layouts())


def _read(layout: Layout) -> Readings:
    mu, pushes = layout.fitted_mu(), range(len(layout.wrenches))
    models = {"exact": layout.exact, "ellipsoid": layout.ellipsoid, "translation": layout.translation}
    used, angles = {}, {}
    for name, model in models.items():
        found = [model(push, mu) for push in pushes]
        used[name] = np.array([value for value, _ in found])
        angles[name] = np.array([layout.angle_deg(push, found[push][1]) for push in pushes])
    used["(6) as printed"] = np.array([layout.printed(push, mu) for push in pushes])
    return Readings(layout, mu, used, angles)


def tables() -> list[Table]:
    """Utilisation where every push slides, and the direction in which it slides."""
    return [_utilisations(), _directions()]


def _utilisations() -> Table:
    table = Table(
        "Real friction: utilisation of 250 measured pushes that slide, median (standard deviation, quartile range)",
        ["supports, mm", "n", "μ", *readings()[0].used, "(6) calls safe"],
    )
    for found in readings():
        cells = [f"{found.mu:.3f}", *map(_spread, found.used.values())]
        share = float(np.mean(found.used["(6) as printed"] <= 1.0))
        table.rows.append((found.layout.name, len(found.layout.wrenches), *cells, f"{100.0 * share:.0f} %"))
    lower = [float(np.mean([_safe(found, push) for push in range(len(found.layout.wrenches))])) for found in readings()]
    power = np.concatenate([(each.wrenches * each.motions).sum(axis=1) for each in layouts()])
    table.notes += [
        "Every push slides, so 1 is correct; a smaller value calls a sliding object safe. μ is fitted for each"
        " layout so that the exact reading has median 1; its spread is that of the friction itself, not of the method.",
        "(6) as printed: |m| about C over μ Σ F |r − P|; its spread is of the pushes with R < μ, for the others have no"
        " pole.",
        f"The share that (6) calls safe hangs on pushes with R close to μ: with μ lower by {100.0 * (1.0 - LOWER):g} %"
        f" it is {100.0 * min(lower):.0f} to {100.0 * max(lower):.0f} %.",
        f"Sign: wrench · displacement > 0 in {int((power > 0.0).sum())} of {power.size} pushes, so the wrench of the"
        " data is the load on the side of the motion; friction on the object is its opposite.",
    ]
    return table


def _safe(found: Readings, push: int) -> bool:
    return found.layout.printed(push, LOWER * found.mu) <= 1.0


def _spread(values: Array) -> str:
    middle, known = float(np.median(values)), values[np.isfinite(values)]
    low, high = np.quantile(known, (0.25, 0.75))
    return f"{middle:.2f} ({known.std():.2f}, {high - low:.2f})"


def _directions() -> Table:
    models = tuple(readings()[0].angle_deg)
    table = Table(
        "Real friction: angle between the predicted and the measured motion, median / p90, degrees",
        ["supports, mm", "n", *models, "exact nearer than ellipsoid"],
    )
    for found in readings():
        angles = [found.angle_deg[model] for model in models]
        nearer = float(np.mean(found.angle_deg["exact"] < found.angle_deg["ellipsoid"]))
        table.rows.append((found.layout.name, angles[0].size, *map(_angles, angles), f"{100.0 * nearer:.0f} %"))
    together = [np.concatenate([found.angle_deg[model] for found in readings()]) for model in models]
    nearer = float(np.mean(together[0] < together[1]))
    table.rows.append(("all", together[0].size, *map(_angles, together), f"{100.0 * nearer:.0f} %"))
    worse = [
        found.layout.name
        for found in readings()
        if np.median(found.angle_deg["exact"]) >= np.median(found.angle_deg["ellipsoid"])
    ]
    table.notes += [
        "Predicted: the outward normal of the model's limit surface where the measured wrench pierces it. Measured: the"
        " displacement. Turns count times the radius of gyration of the loads, so that they weigh as shifts do.",
        f"In the median the exact model is no nearer than the ellipsoid for: {', '.join(worse) or 'none'}.",
    ]
    return table


def _angles(angles: Array) -> str:
    return f"{np.median(angles):.1f} / {np.quantile(angles, 0.9):.0f}"
