"""Taxel positions follow the config, for every order in which a pad is read."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.pad import STEPS, PadGeometry, loads_above, neighbours, taxel_wrench
from slipd.types.arrays import Array


def test_a_pad_is_read_row_by_row_with_its_columns_along_x() -> None:
    x, y = PadGeometry(2, 3, 0.01, 0.004).positions()
    assert_allclose(x, (-0.01, 0.0, 0.01, -0.01, 0.0, 0.01))
    assert_allclose(y, (-0.005, -0.005, -0.005, 0.005, 0.005, 0.005))


@pytest.mark.parametrize("above", [loads_above, getattr(loads_above, "py_func", loads_above)])
def test_a_taxel_is_active_above_the_threshold(above: Callable[[Array, float], Array]) -> None:
    assert above(np.array((0.2, 0.3, -1.0, 0.4)), 0.3).tolist() == [0.0, 0.0, 0.0, 0.4]


@given(data=st.data(), taxels=st.integers(1, 20))
def test_taxel_forces_sum_to_the_wrench_of_a_plain_loop(data: st.DataObject, taxels: int) -> None:
    number = st.floats(-100.0, 100.0, allow_subnormal=False)
    x, y = (data.draw(arrays(np.float64, taxels, elements=number)) for _ in range(2))
    forces = data.draw(arrays(np.float64, (taxels, 3), elements=number))
    force, torque = np.zeros(3), np.zeros(3)
    for k in range(taxels):
        force += forces[k]
        torque += np.cross((x[k], y[k], 0.0), forces[k])
    assert_allclose(taxel_wrench(x, y, forces), (force, torque), atol=1e-8)


def test_a_taxel_that_is_no_number_makes_the_wrench_unknown() -> None:
    forces = np.ones((2, 3))
    forces[1, 2] = np.nan
    force, torque = taxel_wrench(np.array((0.0, 1.0)), np.zeros(2), forces)
    assert np.isnan((force[2], torque[1])).all()


mountings = st.tuples(st.booleans(), st.booleans(), st.booleans())


def orientation(swap: bool, flip_x: bool, flip_y: bool) -> np.ndarray:
    """What the three switches do to a point of the pad's plane: the swap first, then the flips."""
    swapped = np.array(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))) if swap else np.eye(3)
    return np.diag((-1.0 if flip_x else 1.0, -1.0 if flip_y else 1.0, 1.0)) @ swapped


@given(rows=st.integers(1, 9), cols=st.integers(1, 9), mounting=mountings)
def test_a_pad_is_a_grid_of_its_pitch_whose_rows_and_columns_run_as_swap_and_flips_say(
    rows: int, cols: int, mounting: tuple[bool, bool, bool]
) -> None:
    pad = PadGeometry(rows, cols, 0.0032, 0.0015, *mounting)
    plain = (*PadGeometry(rows, cols, 0.0032, 0.0015).positions(), np.zeros(rows * cols))
    x, y = pad.positions()
    assert_allclose((x, y), (orientation(*mounting) @ plain)[:2], atol=1e-15)
    assert_allclose((x.sum(), y.sum()), (0.0, 0.0), atol=1e-12)
    assert len({(round(a / 0.0016), round(b / 0.0016)) for a, b in zip(x, y, strict=True)}) == pad.taxels
    for direction, second, count in ((pad.rows_along, cols, rows), (pad.cols_along, 1, cols)):
        if count > 1:
            step = np.diff((x if direction[1] == "x" else y)[[0, second]])
            assert_allclose(step, 0.0032 if direction[0] == "+" else -0.0032)


@given(data=st.data(), rows=st.integers(1, 5), cols=st.integers(1, 5), mounting=mountings)
def test_a_pad_that_is_read_another_way_gives_the_wrench_turned_the_same_way(
    data: st.DataObject, rows: int, cols: int, mounting: tuple[bool, bool, bool]
) -> None:
    """Shear is turned with the positions: swapped with them, and by the signs of the axes' scale.

    A torque is a pseudovector: a mirror image turns it about as well.
    """
    forces = data.draw(arrays(np.float64, (rows * cols, 3), elements=st.floats(-100.0, 100.0, allow_subnormal=False)))
    turn = orientation(*mounting)
    force, torque = taxel_wrench(*PadGeometry(rows, cols, 0.01, 0.004).positions(), forces)
    x, y = PadGeometry(rows, cols, 0.01, 0.004, *mounting).positions()
    shear = forces[:, (1, 0, 2)] if mounting[0] else forces
    found = taxel_wrench(x, y, shear * (-1.0 if mounting[1] else 1.0, -1.0 if mounting[2] else 1.0, 1.0))
    assert_allclose(found, (turn @ force, np.linalg.det(turn) * (turn @ torque)), atol=1e-9)


@given(rows=st.integers(1, 9), cols=st.integers(1, 9), mounting=mountings)
def test_neighbours_are_those_within_a_diagonal_of_the_pitch_however_the_pad_is_read(
    rows: int, cols: int, mounting: tuple[bool, bool, bool]
) -> None:
    pad = PadGeometry(rows, cols, 1.0, 0.5, *mounting)
    x, y = pad.positions()
    around = neighbours(rows, cols)
    assert around.shape == (rows * cols, 8)
    for k, near in enumerate(around):
        distance = np.maximum(np.abs(x - x[k]), np.abs(y - y[k]))
        assert set(near[near >= 0]) == set(np.flatnonzero(np.isclose(distance, 1.0)))
        for (down, right), taxel in zip(STEPS, near, strict=True):
            inside = 0 <= k // cols + down < rows and 0 <= k % cols + right < cols
            assert taxel == (k + down * cols + right if inside else -1)
    for side, towards in zip(pad.sides(), ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)), strict=True):
        moved = np.stack((x[side] - x, y[side] - y), axis=1)
        assert ((moved == towards).all(axis=1) | (side == np.arange(x.size))).all()
        beyond = np.stack((x, y), axis=1) @ towards
        assert_array_equal(side == np.arange(x.size), np.isclose(beyond, beyond.max()))
