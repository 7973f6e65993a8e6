"""What a count or a sample says: Poisson and binomial bounds, quantiles with values that never came."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import betaincinv, gammaincinv

CONFIDENCE = 0.95
"""Of every one-sided bound in the report."""


def rate_upper(count: int, hours: float) -> float:
    """Return the exact upper Poisson bound on a rate, per hour; infinite without exposure.

    Args:
        count: Events seen.
        hours: Exposure.
    """
    if hours <= 0.0:
        return math.inf
    return float(gammaincinv(count + 1, CONFIDENCE)) / hours


def share_upper(count: int, of: int) -> float:
    """Return the exact upper binomial bound (Clopper-Pearson, one-sided) on a share; 1 without a trial."""
    if count >= of:
        return 1.0
    return float(betaincinv(count + 1, of - count, CONFIDENCE))


def quantile(values: Sequence[float], q: float) -> float:
    """Return the smallest value that at least the share ``q`` of the values do not exceed; NaN without values.

    Infinity stands for what never came, and may be the result: no interpolation, which infinity does not allow.
    """
    if len(values) == 0:
        return math.nan
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    return float(ordered[max(math.ceil(q * ordered.size - 1e-9) - 1, 0)])


def share(count: float, of: float) -> float:
    """Return count / of; NaN of nothing."""
    return count / of if of > 0.0 else math.nan
