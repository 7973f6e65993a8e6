"""The image of one pad in the pad's frame, as pages and charts draw it: X points to the right and Y up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

CENTROID, POLE = "+", "o"
"""Marks of the contact centroid and of the velocity pole."""

MOST_TAXELS = 4096
"""More than any pad has; a picture of more is not drawn."""


@dataclass(frozen=True, slots=True)
class PadImage:
    """Loads on the taxels in the pad's frame.

    Attributes:
        rows: Rows from above, in the direction of −Y; each in the direction of X. Loads from 0 to 1, the largest.
        peak: The largest load.
        unit: Its unit: "N", or "" for an image that is not calibrated.
        pitch_m: Distance of neighbouring taxels; None: not known.
    """

    rows: Sequence[Sequence[float]]
    peak: float
    unit: str
    pitch_m: float | None

    def place(self, point_m: Any) -> tuple[float, float] | None:
        """Return where a point x, y lies: columns from the left and rows from above, in taxels.

        None for a point that is not known or not on the pad.
        """
        if not self.pitch_m or not isinstance(point_m, list) or len(point_m) != 2:
            return None
        x_m, y_m = map(_number, point_m)
        if x_m is None or y_m is None:
            return None
        column = x_m / self.pitch_m + 0.5 * len(self.rows[0])
        row = 0.5 * len(self.rows) - y_m / self.pitch_m
        return (column, row) if 0.0 <= column < len(self.rows[0]) and 0.0 <= row < len(self.rows) else None


def _number(value: Any) -> float | None:
    """Return the value if it is a number, else None."""
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def pad_image(body: Mapping[str, Any]) -> PadImage | None:
    """Return the image of a message ``tactile``; None if it has no usable one."""
    loads, rows, cols = body.get("loads_n"), body.get("rows"), body.get("cols")
    if not (isinstance(rows, int) and isinstance(cols, int) and isinstance(loads, list)):
        return None
    if not 0 < len(loads) == rows * cols <= MOST_TAXELS or rows < 1:
        return None
    known = [load if type(load) in (float, int) and 0.0 < load < math.inf else 0.0 for load in loads]
    peak = max(known)
    shares = [load / peak for load in known] if peak else known
    scan = [shares[at : at + cols] for at in range(0, len(shares), cols)]
    down, across = str(body.get("rows_along") or "+y"), str(body.get("cols_along") or "+x")
    if down.endswith("x"):
        scan, down, across = [list(column) for column in zip(*scan, strict=True)], across, down
    if across.startswith("-"):
        scan = [row[::-1] for row in scan]
    if not down.startswith("-"):  # the first row of the scan has the least Y, the first of the picture the largest
        scan = scan[::-1]
    unit = "N" if body.get("force_unit") == "N" else ""
    return PadImage(scan, peak, unit, _number(body.get("pitch_m")))
