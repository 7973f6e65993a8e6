"""The continuous contact against closed forms, and the figures of the model error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chart.continuous import LEAST_M, PAD_X_M, PAD_Y_M, SHAPES, Patch, image
from chart.model_error import (
    CHEAP,
    EXACT,
    OWN,
    PASSES,
    RANDOM,
    RATIOS,
    ModelError,
    largest_ratio_enough,
    moment,
    quantile,
    run,
)

from slipd.fusion import grey_loads, torque_limit

A = 5e-3
CENTRE = (3e-3, -2e-3)


def limit(patch: Patch, ratio: float = 0.0, finer: int = 1) -> float:
    """Limit for μ = 1 and f_n = 1, about the load centroid."""
    x, y, loads = patch.points(finer)
    return torque_limit(x, y, loads, 1.0, (0.0, ratio), (loads @ x, loads @ y), passes=PASSES).torque_nm


@pytest.mark.parametrize(
    ("ratio", "expected"), [(0.0, 0.667), (0.2, 0.647), (0.5, 0.539), (0.8, 0.329), (0.9, 0.228), (0.99, 0.071)]
)
def test_the_quadrature_gives_the_known_limits_of_a_disc(ratio: float, expected: float) -> None:
    assert limit(Patch("disc", CENTRE, (A, A)), ratio) / A == pytest.approx(expected, abs=6e-4)


@pytest.mark.parametrize(
    ("patch", "expected"),
    [
        (Patch("disc", CENTRE, (A, A)), 2.0 / 3.0),
        (Patch("Hertz", CENTRE, (A, A), hertz=True), 3.0 * math.pi / 16.0),
        (Patch("ring", CENTRE, (A, A), hole=0.5), 2.0 / 3.0 * (1.0 - 0.5**3) / (1.0 - 0.5**2)),
        (Patch("square", CENTRE, (A, A), turn=0.3, round=False), (math.sqrt(2.0) + math.asinh(1.0)) / 3.0),
        (Patch("line", CENTRE, (A, 1e-3 * A), turn=1.0, round=False), 0.5),
    ],
    ids=lambda value: getattr(value, "shape", ""),
)
def test_limits_without_force_in_closed_form(patch: Patch, expected: float) -> None:
    assert limit(patch) / A == pytest.approx(expected, rel=1e-4)


def test_a_hundred_thousand_points_are_enough_for_every_shape() -> None:
    for shape in SHAPES.values():
        patch = shape(np.random.default_rng(3))
        coarse, fine = limit(patch, 0.9), limit(patch, 0.9, finer=2)
        assert coarse == pytest.approx(fine, rel=1e-3), patch


def test_a_quadrature_has_a_hundred_thousand_points() -> None:
    for round_ in (True, False):
        assert Patch("whole", (0.0, 0.0), (A, A), round=round_).points()[0].size >= 100_000


def test_pressure_ends_at_the_edge_of_the_pad_and_where_the_object_lifts_off() -> None:
    x, y, loads = Patch("over", (0.5 * PAD_X_M, 0.0), (A, A)).points()
    assert x.max() <= 0.5 * PAD_X_M
    assert loads @ x == pytest.approx(0.5 * PAD_X_M - 4.0 * A / (3.0 * math.pi), rel=1e-4)
    x, y, loads = Patch("lifted", (0.0, 0.0), (A, A), round=False, tilt=(0.0, 2.0)).points()
    assert y.min() >= -0.5 * A  # 1 + 2 v ≥ 0
    assert loads @ y == pytest.approx(0.5 * A, rel=1e-3)  # a wedge: two thirds from its thin end
    assert loads.sum() == pytest.approx(1.0)


def test_whole_patches_lie_on_the_pad_and_an_overhanging_one_does_not() -> None:
    for seed in range(20):
        for name, shape in SHAPES.items():
            patch = shape(np.random.default_rng(seed))
            lost = _share_beyond_the_edge(patch)
            assert (0.1 < lost < 0.9) if name == "overhanging" else lost == 0.0, patch


def _share_beyond_the_edge(patch: Patch) -> float:
    """Of the patch's area, ignoring its pressure."""
    plain = Patch("plain", (0.0, 0.0), patch.half, patch.turn, patch.round, patch.hole)
    x, y, _ = plain.points()
    x, y = x + patch.centre[0], y + patch.centre[1]
    return float(np.mean((abs(x) > 0.5 * PAD_X_M) | (abs(y) > 0.5 * PAD_Y_M)))


@pytest.mark.parametrize("name", list(SHAPES))
def test_a_fine_image_without_noise_tends_to_the_continuous_limit(name: str) -> None:
    patch = SHAPES[name](np.random.default_rng(1))
    px, py, share = patch.points()
    about = np.array((share @ px, share @ py))
    own = float(share @ np.hypot(px - about[0], py - about[1]))
    for ratio in (0.0, 0.5, 0.9):
        true = torque_limit(px, py, share, 1.0, (ratio, 0.0), about, passes=PASSES).torque_nm
        errors = []
        for pitch in (1.6e-3, 0.2e-3):
            x, y, reading = image(patch, pitch, pitch)
            found = torque_limit(x, y, grey_loads(reading, 1.0).loads, 1.0, (ratio, 0.0), about, passes=PASSES)
            errors.append(abs(found.torque_nm - true) / own)
        assert errors[1] < 5e-3, (ratio, errors)
        assert errors[1] < errors[0] + 1e-3, (ratio, errors)


def test_a_limit_moves_with_the_point_it_is_taken_about() -> None:
    x, y, loads = SHAPES["tilted"](np.random.default_rng(0)).points()
    force, here, arm = np.array((0.4, -0.3)), np.zeros(2), np.array((2e-3, 5e-3))
    first, second = (torque_limit(x, y, loads, 1.0, force, a, passes=PASSES).torque_nm for a in (here, here + arm))
    assert second == pytest.approx(first - moment(arm, force), rel=1e-6)


def test_an_electrode_reads_the_mean_pressure_over_itself() -> None:
    x, _, reading = image(Patch("half plane", (-0.5 * PAD_X_M, 0.0), (0.5 * PAD_X_M, PAD_Y_M), round=False), 3.2e-3)
    assert set(np.round(reading[abs(x) > 1.6e-3], 12)) == {0.0, 1.0}
    x, _, reading = image(Patch("to a middle", (1.6e-3 - LEAST_M, 0.0), (LEAST_M, PAD_Y_M), round=False))
    assert reading[np.isclose(x, 1.6e-3)] == pytest.approx(0.5, abs=0.03)


@pytest.fixture(scope="module")
def quick() -> ModelError:
    return run(quick=True)


def test_a_quick_run_answers_every_contact_with_an_image(quick: ModelError) -> None:
    found = quick
    some = found.taxels > 0
    for key in (EXACT, CHEAP, ("grey", "exact"), ("binary", "exact")):
        assert np.isfinite(found.errors[key][some]).all()
        assert np.isnan(found.errors[key][~some]).all()
    assert np.isinf(found.errors["matched", "translation"][some]).all()
    assert np.isfinite(found.errors[OWN]).all()
    for table in found.tables():
        assert table.rows
        assert all(len(row) == len(table.head) for row in table.rows)
    disc = list(SHAPES).index("disc")
    own = found.errors[OWN][disc]
    assert own[:, RATIOS.index(0.9)] == pytest.approx((2 / 3 * math.sqrt(1 - 0.9**2) - 0.2277) * 1.5, abs=1e-3)
    large = found.taxels >= 16
    assert quantile(np.abs(found.errors[EXACT][large]), 0.95) < 0.1
    assert quantile(np.abs(found.readings[EXACT][large][:, RANDOM] - 1.0), 0.95) < 0.1


def test_a_model_is_enough_up_to_where_it_first_errs_by_a_quarter_more() -> None:
    exact = np.full((9, RANDOM + 1), 0.1)
    assert largest_ratio_enough(exact, exact) == RATIOS[-1]
    assert largest_ratio_enough(1.3 * exact, exact) == -1.0
    late = exact.copy()
    late[:, 4] = 0.2
    assert largest_ratio_enough(late, exact) == RATIOS[3]


def test_the_panel_draws_what_a_quick_run_found(quick: ModelError) -> None:
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16.0, 8.5))
    quick.draw(figure.subfigures(1, 1))
    figure.draw_without_rendering()
    assert len(figure.subfigs[0].axes) == 3 * len(SHAPES)
