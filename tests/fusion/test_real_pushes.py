"""250 measured pushes of a sliding object: what slides has utilisation 1, and (6) as printed calls it safe."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from slipd.fusion import torque_limit, utilisation

DATA = Path(__file__).parents[1] / "data" / "pushes"
WEIGHT_N = 1.518 * 9.81
LAYOUTS = (
    "10_130_10_10_10_130",
    "10_90_10_10_30_130",
    "30_63.33_43.33_30_43.33_63.33",
    "30_90_30_30_30_90",
    "patch",
)
ABOUT = (0.0, 0.0)


def supports(layout: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if layout == "patch":  # the full triangle, uniform; its centroid is the origin
        side, cells = 0.150, 60
        grid = (np.arange(cells) + 0.5) * side / cells
        x, y = (a.ravel() for a in np.meshgrid(grid, grid))
        inside = x + y < side
        return x[inside] - 0.05, y[inside] - 0.05, np.full(inside.sum(), WEIGHT_N / inside.sum())
    with (DATA / "supports_board.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["layout"] == layout]
    x, y, share = (np.array([float(row[key]) for row in rows]) for key in ("x_m", "y_m", "load_fraction"))
    return x, y, share * WEIGHT_N


def pushes() -> dict[str, np.ndarray]:
    found = defaultdict(list)
    with (DATA / "pushes_board.csv").open() as file:
        for row in csv.DictReader(file):
            found[row["layout"]].append([float(row[key]) for key in ("fx_n", "fy_n", "m_nm")])
    return {layout: np.array(rows) for layout, rows in found.items()}


def printed_equation_6(x, y, loads, mu, force, spin) -> bool:
    """Whether (6) as printed calls a load safe: it compares m about C with Σ μ F |r − P|, a torque about P."""
    limit = torque_limit(x, y, loads, mu, force, ABOUT, 1 if spin >= 0 else -1)
    if limit.pole_m is None:
        return False
    arms = np.hypot(x - limit.pole_m[0], y - limit.pole_m[1])
    return abs(spin) / float(loads @ arms) <= mu


def test_every_layout_has_fifty_pushes() -> None:
    assert {layout: len(rows) for layout, rows in pushes().items()} == dict.fromkeys(LAYOUTS, 50)


# The friction of the board itself scatters: the spread is that of the measurement, given with the data.
@pytest.mark.parametrize(("layout", "spread"), list(zip(LAYOUTS, (0.105, 0.08, 0.24, 0.08, 0.09), strict=True)))
def test_sliding_pushes_have_utilisation_one_within_the_scatter_of_friction(layout: str, spread: float) -> None:
    x, y, loads = supports(layout)
    rows = pushes()[layout]
    mu = np.median([utilisation(x, y, loads, 1.0, row[:2], row[2], ABOUT).value for row in rows])
    assert 0.29 < mu < 0.35
    used = np.array([utilisation(x, y, loads, mu, row[:2], row[2], ABOUT).value for row in rows])
    assert np.median(used) == pytest.approx(1.0, abs=1e-6)
    assert used.std() < spread
    translation = np.median(np.hypot(rows[:, 0], rows[:, 1]) / WEIGHT_N / mu)
    assert translation < 0.85, "translation alone must miss part of the load, or the pushes would not tell"


def test_equation_6_as_printed_calls_most_sliding_pushes_safe() -> None:
    for layout, rows in pushes().items():
        x, y, loads = supports(layout)
        mu = np.median([utilisation(x, y, loads, 1.0, row[:2], row[2], ABOUT).value for row in rows])
        safe = np.mean([printed_equation_6(x, y, loads, mu, row[:2], row[2]) for row in rows])
        right = np.mean([utilisation(x, y, loads, mu, row[:2], row[2], ABOUT).value < 1.0 for row in rows])
        assert right <= 0.5, layout
        assert safe > 0.65, (layout, safe)
