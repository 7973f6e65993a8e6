"""What the neighbours and the line of each taxel do, for `slipd.signals.taxel_faults`.

These are kernels because a rating of all taxels comes between two readings, and must not delay the next one.

Most take ``around``, the neighbours of every taxel as `slipd.signals.pad.neighbours` returns them, shape (n, k), −1
beyond the border, or some of its columns; and ``trusted``, shape (n,): neighbours that are not trusted do not count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array, Indices

Mask = NDArray[np.bool_]


@compiled
def count_trusted(around: Indices, trusted: Mask) -> Indices:
    """Return how many trusted neighbours each taxel has, shape (n,)."""
    count = np.zeros(len(around), np.int64)
    for i in range(len(around)):
        for j in around[i]:
            count[i] += j >= 0 and trusted[j]
    return count


@compiled
def find_motion(means: Array, around: Indices, trusted: Mask) -> Array:
    """Return how far the mean of the neighbours of each taxel moves over the blocks, shape (n,); 0 without neighbours.

    Args:
        means: Mean reading of each block, shape (blocks, n).
        around: See the module.
        trusted: Likewise.
    """
    moves = np.zeros(len(around))
    for i in range(len(around)):
        low, high = np.inf, -np.inf
        for block in range(len(means)):
            total, count = 0.0, 0
            for j in around[i]:
                if j >= 0 and trusted[j]:
                    total += means[block, j]
                    count += 1
            mean = total / max(count, 1)
            low, high = min(low, mean), max(high, mean)
        moves[i] = high - low
    return moves


@compiled
def count_along(moves: Array, span: Array, around: Indices, trusted: Mask) -> Indices:
    """Return how many trusted neighbours of each taxel move by at least ``moves[i]``, shape (n,).

    Args:
        moves: Least movement for each taxel, shape (n,).
        span: Movement of each taxel, shape (n,); negative for one that must not count.
        around: See the module.
        trusted: Likewise.
    """
    count = np.zeros(len(around), np.int64)
    for i in range(len(around)):
        for j in around[i]:
            count[i] += j >= 0 and trusted[j] and span[j] >= moves[i]
    return count


@compiled
def mean_around(values: Array, around: Indices, trusted: Mask) -> Array:
    """Return the mean of the neighbours' values, shape (n,); 0 for a taxel without trusted neighbours."""
    means = np.zeros(len(around))
    for i in range(len(around)):
        count = 0
        for j in around[i]:
            if j >= 0 and trusted[j]:
                means[i] += values[j]
                count += 1
        means[i] /= max(count, 1)
    return means


@compiled
def lowest_around(values: Array, around: Indices, trusted: Mask, rank: int, beyond: float) -> Array:
    """Return a low one of the neighbours' values, shape (n,).

    Args:
        values: Values of the taxels, shape (n,), at most ``beyond``.
        around: See the module.
        trusted: Likewise.
        rank: 0 for the lowest value, 1 for the next one, and so on; −1 for the upper median.
        beyond: Value of a neighbour that is missing or not trusted.
    """
    found = np.full(len(around), beyond)
    sorted_values = np.empty(around.shape[1])
    for i in range(len(around)):
        count = 0
        for j in around[i]:
            if j >= 0 and trusted[j]:
                at = count
                while at > 0 and sorted_values[at - 1] > values[j]:
                    sorted_values[at] = sorted_values[at - 1]
                    at -= 1
                sorted_values[at] = values[j]
                count += 1
        wanted = count // 2 if rank < 0 else rank
        if wanted < count:
            found[i] = sorted_values[wanted]
    return found


@compiled
def highest_around(values: Array, around: Indices, trusted: Mask) -> Array:
    """Return the highest of the neighbours' values, shape (n,); at least 0."""
    highest = np.zeros(len(around))
    for i in range(len(around)):
        for j in around[i]:
            if j >= 0 and trusted[j]:
                highest[i] = max(highest[i], values[j])
    return highest


@compiled
def in_lines(which: Mask, rows: int, cols: int, least: int, *, down: bool) -> Mask:
    """Return the taxels in lines of which at least ``least`` taxels are set, shape (rows · cols,).

    Args:
        which: The taxels that are set, in scan order, shape (rows · cols,).
        rows: Rows of the scan.
        cols: Columns of the scan.
        least: Number of taxels.
        down: A line is a column of the scan; else a row.
    """
    count = np.zeros(max(rows, cols), np.int64)
    for i in range(which.size):
        count[i % cols if down else i // cols] += which[i]
    found = np.empty(which.size, np.bool_)
    for i in range(which.size):
        found[i] = count[i % cols if down else i // cols] >= least
    return found
