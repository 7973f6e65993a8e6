"""Values as the wire carries them: what is not known is nil, never 0, NaN or inf."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from slipd.types.arrays import Array

Body = dict[str, Any]
"""A map on the wire: a message, the result of a reply, or a part of either."""


def array(values: Array | None) -> list[float] | None:
    """Return an array as a list of finite floats; None where one of them is not known."""
    return None if values is None else numbers(values.tolist())


def numbers(values: Sequence[float]) -> list[float] | None:
    """Return a list of finite floats; None where one of them is not known."""
    return list(values) if all(map(math.isfinite, values)) else None


def pair(x: float, y: float) -> list[float] | None:
    """Return two finite floats; None where one of them is not known."""
    return [x, y] if math.isfinite(x) and math.isfinite(y) else None
