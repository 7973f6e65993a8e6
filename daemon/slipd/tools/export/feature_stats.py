"""Statistics of the numbers of a data set, in one pass over blocks of frames."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Names and levels of the quantiles that LeRobot keeps."""

MOST_SAMPLES = 10_000
"""Most frames from which quantiles are computed; of a longer run, every second, fourth … frame is taken."""


class FeatureStats:
    """Statistics of each number of a feature over frames; values that are not known (NaN) do not count.

    Args:
        size: Numbers of the feature.
    """

    def __init__(self, size: int) -> None:
        self._frames = 0
        self._known = np.zeros(size)
        self._mean = np.zeros(size)
        self._squares = np.zeros(size)
        self._least = np.full(size, np.inf)
        self._largest = np.full(size, -np.inf)
        self._sample = np.empty((0, size))
        self._stride = 1

    def add(self, block: Floats) -> None:
        """Count frames: one row each."""
        known = np.isfinite(block)
        count = known.sum(axis=0)
        total = self._known + count
        mean = _ratio(np.where(known, block, 0.0).sum(axis=0), count)
        squares = np.where(known, block - mean, 0.0) ** 2
        step = np.where(count > 0, mean - self._mean, 0.0)
        # Chan, Golub, LeVeque 1983, (2.1): means and sums of squares of two parts give those of the whole.
        self._squares += squares.sum(axis=0) + step**2 * _ratio(self._known * count, total)
        self._mean += _ratio(step * count, total)
        self._known = total
        self._least = np.minimum(self._least, np.where(known, block, np.inf).min(axis=0))
        self._largest = np.maximum(self._largest, np.where(known, block, -np.inf).max(axis=0))
        self._keep(block)
        self._frames += len(block)

    def summary(self) -> dict[str, list[float] | list[int]]:
        """Return LeRobot's statistics; 0 for a number that was never known. There is at least one frame."""
        never = self._known == 0
        found: dict[str, list[float] | list[int]] = {
            "min": np.where(never, 0.0, self._least).tolist(),
            "max": np.where(never, 0.0, self._largest).tolist(),
            "mean": self._mean.tolist(),
            "std": np.sqrt(_ratio(self._squares, self._known)).tolist(),
            "count": [self._frames],
        }
        sample = self._sample.copy()
        unseen = ~np.isfinite(sample).any(axis=0)
        sample[:, unseen] = self._mean[unseen]
        for name, level in QUANTILES.items():
            found[name] = np.nanquantile(sample, level, axis=0).tolist()
        return found

    def _keep(self, block: Floats) -> None:
        self._sample = np.concatenate((self._sample, block[-self._frames % self._stride :: self._stride]))
        while len(self._sample) > MOST_SAMPLES:
            self._sample, self._stride = self._sample[::2], self._stride * 2


def _ratio(one: Floats, other: Floats) -> Floats:
    """Return the ratio; 0 where the divisor is."""
    found = np.zeros(one.shape)
    np.divide(one, other, out=found, where=other > 0)
    return found
