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

from slipd_client.live_view_parts import number
from slipd_client.terminal import Line

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

_CODES = [[f"38;5;{top};{ground}" for ground in (*(f"48;5;{bottom}" for bottom in HEAT), "49")] for top in HEAT]
"""Colour of a half block, by the steps of the upper and the lower pixel; the last one is without a lower pixel."""


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
        x_m, y_m = map(number, point_m)
        if x_m is None or y_m is None:
            return None
        column = x_m / self.pitch_m + 0.5 * len(self.rows[0])
        row = 0.5 * len(self.rows) - y_m / self.pitch_m
        return (column, row) if 0.0 <= column < len(self.rows[0]) and 0.0 <= row < len(self.rows) else None


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
    signs: dict[int, dict[int, str]] = {}
    for sign, point_m in marks:
        if (place := image.place(point_m)) is not None:
            signs.setdefault(int(place[1] * scale) // 2, {})[int(place[0] * scale)] = sign
    shades = SHADES[ascii_only]
    steps = len(HEAT) if colour and not ascii_only else len(shades)
    # 0 for no load, else 1 to ``steps`` - 1
    rows = [[1 + min(int(share * (steps - 1)), steps - 2) if share > 0.0 else 0 for share in row] for row in image.rows]
    lines = []
    for at in range((scale * len(rows) + 1) // 2):
        upper, lower_row = rows[2 * at // scale], (2 * at + 1) // scale
        lower = rows[lower_row] if lower_row < len(rows) else None
        if colour and not ascii_only:
            line = _heat_line(upper, lower, scale)
        else:
            line = _shade_line(upper, upper if lower is None else lower, scale, shades)
        for column, sign in signs.get(at, {}).items():
            line = _marked(line, column, sign)
        lines.append(line)
    return lines, columns


def _heat_line(upper: Sequence[int], lower: Sequence[int] | None, scale: int) -> Line:
    """Draw half blocks: the foreground is the upper pixel, the background the lower one."""
    below = lower or [-1] * len(upper)
    codes = [_CODES[top][bottom] for top, bottom in zip(upper, below, strict=True)]
    return [(_HALF * (scale * len(list(alike))), code) for code, alike in groupby(codes)]


def _shade_line(upper: Sequence[int], lower: Sequence[int], scale: int, shades: str) -> Line:
    """Draw one character for both pixels, by their mean."""
    return [("".join(shades[(top + bottom + 1) // 2] * scale for top, bottom in zip(upper, lower, strict=True)), "")]


def _marked(line: Line, column: int, sign: str) -> Line:
    """Return a line with a character in one column; in colours it stands on the colour of the upper pixel."""
    marked: Line = []
    for text, code in line:
        if 0 <= column < len(text):
            ink = code and f"1;38;5;{_INK.get(code.split(';')[2], 231)};48;5;{code.split(';')[2]}"
            parts = ((text[:column], code), (sign, ink), (text[column + 1 :], code))
            marked += [part for part in parts if part[0]]
        else:
            marked.append((text, code))
        column -= len(text)
    return marked


_INK = {str(colour): 16 for colour in HEAT[len(HEAT) // 2 + 1 :]}
"""Black on the bright colours; white on the others."""
