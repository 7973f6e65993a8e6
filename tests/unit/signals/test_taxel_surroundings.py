"""What the neighbours and the lines of taxels do, against the same by arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from slipd.signals import taxel_surroundings as surroundings
from slipd.signals.pad import neighbours
from slipd.types.arrays import Array

ROWS, COLS = 5, 7
TAXELS = ROWS * COLS
AROUND = neighbours(ROWS, COLS)


KERNELS = (
    "count_trusted",
    "find_motion",
    "count_along",
    "mean_around",
    "lowest_around",
    "highest_around",
    "in_lines",
)


@pytest.fixture(autouse=True, params=["compiled", "interpreted"])
def kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "interpreted":
        for name in KERNELS:
            kernel = getattr(surroundings, name)
            monkeypatch.setattr(surroundings, name, getattr(kernel, "py_func", kernel))


@pytest.fixture(params=[0.0, 0.2, 1.0], ids=["all are trusted", "some are not", "none is trusted"])
def trusted(request: pytest.FixtureRequest) -> NDArray[np.bool_]:
    return np.random.default_rng(7).random(TAXELS) >= request.param


@pytest.fixture
def values() -> Array:
    return np.random.default_rng(8).random(TAXELS)


def near(values: Array, trusted: NDArray[np.bool_], otherwise: float) -> Array:
    """The neighbours' values, shape (taxels, 8)."""
    return np.where(np.append(trusted, False)[AROUND], np.append(values, 0.0)[AROUND], otherwise)


def test_trusted_neighbours_are_counted(trusted: NDArray[np.bool_]) -> None:
    expected = near(np.ones(TAXELS), trusted, 0.0).sum(axis=1)
    assert_array_equal(surroundings.count_trusted(AROUND, trusted), expected)


def test_corners_have_three_neighbours_and_edges_five() -> None:
    count = surroundings.count_trusted(AROUND, np.ones(TAXELS, dtype=bool)).reshape(ROWS, COLS)
    assert [count[0, 0], count[0, 1], count[1, 0], count[1, 1]] == [3, 5, 5, 8]


def test_motion_is_that_of_the_neighbours_mean(trusted: NDArray[np.bool_]) -> None:
    means = np.random.default_rng(9).normal(size=(8, TAXELS))
    count = np.maximum(surroundings.count_trusted(AROUND, trusted), 1)
    around = np.array([near(block, trusted, 0.0).sum(axis=1) / count for block in means])
    assert_allclose(surroundings.find_motion(means, AROUND, trusted), np.ptp(around, axis=0))


def test_neighbours_that_move_along_are_counted(trusted: NDArray[np.bool_], values: Array) -> None:
    moves = np.full(TAXELS, 0.5)
    expected = (near(values, trusted, -1.0) >= 0.5).sum(axis=1)
    assert_array_equal(surroundings.count_along(moves, values, AROUND, trusted), expected)


def test_mean_and_highest_of_the_neighbours_are_zero_without_any(trusted: NDArray[np.bool_], values: Array) -> None:
    count = np.maximum(surroundings.count_trusted(AROUND, trusted), 1)
    expected = near(values, trusted, 0.0).sum(axis=1) / count
    assert_allclose(surroundings.mean_around(values, AROUND, trusted), expected)
    assert_array_equal(surroundings.highest_around(values, AROUND, trusted), near(values, trusted, 0.0).max(axis=1))


@pytest.mark.parametrize("rank", [0, 1, 4])
def test_a_low_value_is_chosen_by_its_rank(trusted: NDArray[np.bool_], values: Array, rank: int) -> None:
    expected = np.sort(near(values, trusted, math.inf), axis=1)[:, rank]
    assert_array_equal(surroundings.lowest_around(values, AROUND, trusted, rank, math.inf), expected)


def test_the_median_counts_trusted_neighbours_only(trusted: NDArray[np.bool_], values: Array) -> None:
    found = surroundings.lowest_around(values, AROUND, trusted, -1, math.inf)
    for taxel, around in enumerate(AROUND):
        known = sorted(values[i] for i in around if i >= 0 and trusted[i])
        assert found[taxel] == (known[len(known) // 2] if known else math.inf)


@pytest.mark.parametrize("down", [False, True])
def test_lines_are_found_by_the_number_of_their_taxels(down: bool) -> None:
    which = np.random.default_rng(3).random((ROWS, COLS)) < 0.5
    expected = np.broadcast_to(which.sum(axis=0 if down else 1, keepdims=True) >= 3, (ROWS, COLS)).ravel()
    assert_array_equal(surroundings.in_lines(which.ravel(), ROWS, COLS, 3, down=down), expected)
