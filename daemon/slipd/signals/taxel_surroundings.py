"""What the neighbours of each taxel do, for `slipd.signals.taxel_faults`."""

from __future__ import annotations

import numpy as np

from slipd.types.arrays import Array, Indices, Mask


class Surroundings:
    """Neighbours of each taxel, and which of them count.

    Args:
        around: Neighbours, shape (taxels, k), −1 beyond the border.

    Attributes:
        count: How many each taxel has, shape (taxels,).
    """

    def __init__(self, around: Indices) -> None:
        self._around, taxels = around, len(around)
        self._linked = np.zeros((taxels + 1, taxels))
        self._linked[around, np.arange(taxels)[:, None]] = 1.0
        self._linked = self._linked[:-1]  # the last one is beyond the border
        self.trust(np.ones(taxels, dtype=bool))

    def trust(self, trusted: Mask) -> Surroundings:
        """Count these taxels only, shape (taxels,); return the same surroundings."""
        self._trusted, self._known = trusted, (self._around >= 0) & trusted[self._around]
        self.count = trusted @ self._linked
        return self

    def values(self, values: Array | Mask, otherwise: float) -> Array:
        """Return the neighbours' values, shape (taxels, k); ``otherwise`` for one that does not count."""
        return np.where(self._known, values.take(self._around), otherwise)

    def mean(self, values: Array) -> Array:
        """Return the mean of the neighbours' values, shape (…, taxels); 0 without any."""
        return np.asarray((values * self._trusted) @ self._linked / np.maximum(self.count, 1.0))

    def lowest(self, values: Array, rank: int | Indices, beyond: float) -> Array:
        """Return the neighbours' value of a rank, 0 for the lowest; ``beyond``, above all, is one that is missing."""
        found: Array = np.sort(self.values(values, beyond), axis=1)[np.arange(len(values)), rank]
        return found
