from __future__ import annotations

from typing import Any

import pytest

from slipd_client.pad_picture import Mark, PadImage, pad_image, pad_picture

BODY: dict[str, Any] = {
    "rows": 2,
    "cols": 3,
    "pitch_m": 0.01,
    "force_unit": "N",
    "loads_n": [0.0, 0.0, 4.0, 1.0, 0.0, 0.0],
}
"""Scanned from below: the load 4 is at the lower right, 1 at the upper left, in the pad's frame."""


def image(**fields: Any) -> PadImage:
    found = pad_image(BODY | fields)
    assert found is not None
    return found


def shades(found: PadImage, scale: int = 2, *marks: Mark, ascii_only: bool = True) -> list[str]:
    lines, columns = pad_picture(found, scale, marks, colour=False, ascii_only=ascii_only)
    drawn = ["".join(text for text, _ in line) for line in lines]
    assert {len(line) for line in drawn} == {columns}
    return drawn


def test_x_points_right_and_y_up() -> None:
    assert shades(image()) == ["==....", "....@@"]
    assert shades(image(), ascii_only=False) == ["▒▒····", "····██"]


@pytest.mark.parametrize(
    ("rows_along", "cols_along", "place"),
    [
        ("+y", "+x", (0.01, -0.005)),
        ("-y", "+x", (0.01, 0.005)),
        ("+y", "-x", (-0.01, -0.005)),
        ("+x", "+y", (-0.005, 0.01)),
        ("-x", "+y", (0.005, 0.01)),
        ("+x", "-y", (-0.005, -0.01)),
        ("-x", "-y", (0.005, -0.01)),
    ],
)
def test_the_scan_may_run_in_any_direction(rows_along: str, cols_along: str, place: tuple[float, float]) -> None:
    found = image(rows_along=rows_along, cols_along=cols_along)
    at = found.place(list(place))
    assert at is not None
    assert found.rows[int(at[1])][int(at[0])] == 1.0, "the largest load is there"


def test_marks_stand_where_the_points_are() -> None:
    at_load = Mark("+", [0.01, -0.005])
    assert shades(image(), 2, at_load) == ["==....", "....@+"]
    lines, _ = pad_picture(image(), 2, (at_load,), colour=True, ascii_only=False)
    assert "+" in [text for text, _ in lines[1]]
    assert shades(image(), 2, Mark("o", [0.1, 0.0]), Mark("+", None), Mark("x", [0.0, "a"])) == shades(image())
    assert shades(image(pitch_m=None), 2, at_load) == shades(image())


@pytest.mark.parametrize(
    "fields",
    [
        {"loads_n": None},
        {"loads_n": [1.0]},
        {"rows": 0, "loads_n": []},
        {"rows": -2, "cols": -3},
        {"rows": "2"},
        {"rows": 1000, "cols": 1000, "loads_n": [0.0] * 1_000_000},
    ],
)
def test_what_is_no_image_is_not_drawn(fields: dict[str, Any]) -> None:
    assert pad_image(BODY | fields) is None
