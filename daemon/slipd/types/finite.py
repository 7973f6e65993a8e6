"""Convert numbers that are not finite to None; a leaf module, so that every room can use it."""

from __future__ import annotations

import math


def finite_or_none(value: float | None) -> float | None:
    """Return a finite number as a float; None for NaN, an infinity, or None."""
    return None if value is None or not math.isfinite(value) else float(value)
