"""Values as the wire carries them: what is not known is nil, never 0, NaN or inf."""

from __future__ import annotations

from math import isfinite
from typing import Any

from slipd.types.arrays import Array

Body = dict[str, Any]
"""A map on the wire: a message, the result of a reply, or a part of either."""


def finite(body: Body) -> Body:
    """Set every number of a body that is not finite to None, and every list of numbers that has such a number."""
    for key, value in body.items():
        if isinstance(value, float):
            if not isfinite(value):
                body[key] = None
        elif type(value) is list and value and isinstance(value[0], float) and not all(map(isfinite, value)):
            body[key] = None
    return body


def array(values: Array | None) -> list[float] | None:
    """Return an array as a list; None where there is none."""
    return None if values is None else values.tolist()
