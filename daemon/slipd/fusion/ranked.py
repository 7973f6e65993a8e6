"""Values by their rank, for kernels: a partial sort that compiles in a moment, as those of NumPy do not."""

from __future__ import annotations

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array


@compiled
def ranked(values: Array, rank: int) -> float:
    """Return the value of a rank, 0 for the lowest; the values, none of them NaN, are left in another order.

    Source: C. A. R. Hoare, Algorithm 65: Find, Comm. ACM 4(7), 1961.
    """
    low, high = 0, len(values) - 1
    while low < high:
        pivot, i, j = values[rank], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if j < rank:
            low = i
        if rank < i:
            high = j
    return float(values[rank])
