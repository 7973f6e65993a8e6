"""Draws the image of one pad for a terminal: a heat map of square pixels, two in a character, in the pad's frame.

X points to the right and Y up, as one looks onto the pad. Colours show the load on each taxel relative to the largest;
without colours, shades or ASCII characters do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

from slipd_client.live_view_format import number
from slipd_client.terminal_text import Line

CENTROID, POLE = "+", "o"
"""Marks of the contact centroid and of the velocity pole."""

HEAT = (236, 17, 18, 54, 90, 126, 162, 197, 203, 209, 215, 221, 229)
"""Of the 256 colours of a terminal: an unloaded taxel, and increasing loads."""

SHADES = {False: "·░▒▓█", True: ".:-=+*#%@"}
"""Without colours, likewise; by whether only ASCII can be shown."""

LARGEST_SCALE = 8
MOST_TAXELS = 4096
"""More than any pad has; a picture of more is not drawn."""

_HALF = "▀"


@dataclass(frozen=True, slots=True)
class PadImage:
    """Loads on the taxels in the pad's frame.

    Attributes:
        rows: Rows from above, in the direction of −Y; each in the direction of X. Loads from 0 to 1, the largest.
        peak: The largest load.
        unit: Its unit: "N", or "" where the image is not calibrated.
        pitch_m: Distance of neighbouring taxels; None: not known.
    """

    rows: Sequence[Sequence[float]]
    peak: float
    unit: str
    pitch_m: float | None

    def place(self, point_m: Any) -> tuple[float, float] | None:
        """Return where a point x, y lies: columns from the left and rows from above, in taxels.

        None where the point is not known or not on the pad.
        """
        if not self.pitch_m or not isinstance(point_m, list) or len(point_m) != 2:
            return None
        x_m, y_m = map(number, point_m)
        if x_m is None or y_m is None:
            return None
        column = x_m / self.pitch_m + 0.5 * len(self.rows[0])
        row = 0.5 * len(self.rows) - y_m / self.pitch_m
        return (column, row) if 0.0 <= column < len(self.rows[0]) and 0.0 <= row < len(self.rows) else None


def pad_image(body: Mapping[str, Any]) -> PadImage | None:
    """Return the image of a message ``tactile``; None where it has none that can be used."""
    loads, rows, cols = body.get("loads_n"), body.get("rows"), body.get("cols")
    if not (isinstance(rows, int) and isinstance(cols, int) and isinstance(loads, list)):
        return None
    values = [number(load) for load in loads]
    if not 0 < len(values) == rows * cols <= MOST_TAXELS or rows < 1:
        return None
    known = [value if value is not None and 0.0 < value < math.inf else 0.0 for value in values]
    peak = max(known)
    shares = [value / peak if peak else 0.0 for value in known]
    scan = [shares[at : at + cols] for at in range(0, len(shares), cols)]
    down, across = str(body.get("rows_along") or "+y"), str(body.get("cols_along") or "+x")
    if down.endswith("x"):
        scan, down, across = [list(column) for column in zip(*scan, strict=True)], across, down
    if across.startswith("-"):
        scan = [row[::-1] for row in scan]
    if not down.startswith("-"):  # the first row of the scan has the least Y, the first of the picture the largest
        scan = scan[::-1]
    unit = "N" if body.get("force_unit") == "N" else ""
    return PadImage(scan, peak, unit, number(body.get("pitch_m")))


class Mark(NamedTuple):
    """A character at a place of the pad."""

    sign: str
    point_m: Any


def largest_scale(image: PadImage, columns: int, lines: int) -> int:
    """Return how many pixels wide each taxel may be; 0 where the picture does not fit at all."""
    return min(columns // len(image.rows[0]), 2 * lines // len(image.rows), LARGEST_SCALE)


def pad_picture(
    image: PadImage, scale: int, marks: Sequence[Mark], *, colour: bool, ascii_only: bool
) -> tuple[list[Line], int]:
    """Return the lines of the picture, and their width in columns.

    Args:
        image: The image.
        scale: Pixels along the side of a taxel.
        marks: Drawn above the image where they lie on it, the last one on top.
        colour: Whether colours may be used.
        ascii_only: The terminal shows ASCII only.
    """
    columns = scale * len(image.rows[0])
    signs: dict[tuple[int, int], str] = {}
    for sign, point_m in marks:
        if (place := image.place(point_m)) is not None:
            signs[int(place[1] * scale) // 2, int(place[0] * scale)] = sign
    draw = _heat_line if colour and not ascii_only else _shade_line
    lines = []
    for line in range((scale * len(image.rows) + 1) // 2):
        upper = image.rows[2 * line // scale]
        lower_row = (2 * line + 1) // scale
        lower = image.rows[lower_row] if lower_row < len(image.rows) else None
        marked = {column: sign for (at, column), sign in signs.items() if at == line}
        lines.append(draw(upper, lower, scale, marked, SHADES[ascii_only]))
    return lines, columns


def _heat_line(
    upper: Sequence[float], lower: Sequence[float] | None, scale: int, marked: Mapping[int, str], _: str
) -> Line:
    """Draw half blocks: the foreground is the upper pixel, the background the lower one."""
    above = [_step(share, len(HEAT)) for share in upper]
    below = [-1] * len(above) if lower is None else [_step(share, len(HEAT)) for share in lower]
    cells = [
        (top, bottom, marked.get(at * scale + part, ""))
        for at, (top, bottom) in enumerate(zip(above, below, strict=True))
        for part in range(scale)
    ]
    line: Line = []
    for (top, bottom, sign), alike in groupby(cells):
        count = len(list(alike))
        ground = f"48;5;{HEAT[bottom]}" if bottom >= 0 else "49"
        if sign:
            ink = 16 if top > len(HEAT) // 2 else 231
            line.append((sign * count, f"1;38;5;{ink};48;5;{HEAT[top]}"))
        else:
            line.append((_HALF * count, f"38;5;{HEAT[top]};{ground}"))
    return line


def _shade_line(
    upper: Sequence[float], lower: Sequence[float] | None, scale: int, marked: Mapping[int, str], shades: str
) -> Line:
    """Draw one character for both pixels, by their mean."""
    below = upper if lower is None else lower
    cells = [
        shades[_step(0.5 * (top + bottom), len(shades))]
        for top, bottom in zip(upper, below, strict=True)
        for _ in range(scale)
    ]
    for column, sign in marked.items():
        cells[column] = sign
    return [("".join(cells), "")]


def _step(share: float, steps: int) -> int:
    """Return 0 for no load, else 1 to ``steps`` − 1."""
    return 0 if share <= 0.0 else 1 + min(int(share * (steps - 1)), steps - 2)
