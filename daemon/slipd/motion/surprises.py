"""Surprise of a statistic: −ln of the probability that noise makes it as large."""

from __future__ import annotations

import math

from scipy.special import betainc

MOST_SURPRISE = 700.0
"""No surprise is larger: its probability is no floating-point number."""


def f_surprise(ratio: float, terms: float, freedom: float) -> float:
    """Return the surprise of a ratio of F(terms, freedom).

    Args:
        ratio: Mean square of ``terms`` values over a variance that was measured.
        terms: Their number.
        freedom: Degrees of freedom of the measured variance.
    """
    tail = float(betainc(0.5 * freedom, 0.5 * terms, freedom / (freedom + terms * ratio)))
    return -math.log(tail) if tail > math.exp(-MOST_SURPRISE) else MOST_SURPRISE
