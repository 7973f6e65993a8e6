from __future__ import annotations

import math
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.tools.plot.binned_track import Held, Window
from slipd.tools.plot.chart import Curve, Panel, Span, StripGroup
from slipd.tools.plot.chart_svg import LEFT, PANEL, RIGHT, TAXEL, TITLE, WIDTH, chart_svg, snapshot_svg

END_S = 10.0


def at(t_s: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * t_s / END_S


def drawn(*parts: Panel | StripGroup) -> ElementTree.Element:
    return ElementTree.fromstring(chart_svg(parts, Window(0.0, END_S)))


def of_class(root: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    return [each for each in root.iter() if name in each.get("class", "").split()]


def curve(*points: tuple[float, float, float], kind: str = "line") -> Curve:
    ends = [point[0] for point in points[1:]] + [END_S]
    return Curve(
        "left <now>",
        "finger0",
        [Held(t, end, (low, high)) for (t, low, high), end in zip(points, ends, strict=True)],
        kind,
    )


def path_of(root: ElementTree.Element, kind: str) -> str:
    _sample, path = of_class(root, kind)
    assert "finger0" in path.get("class", "").split()
    return path.get("d", "")


def points_of(path: str) -> list[tuple[float, float]]:
    found = [pair.split() for pair in path.strip("MZ").replace("Z", "").replace("M", "L").split("L")]
    return [(float(x), float(y)) for x, y in found]


def test_a_curve_goes_through_least_and_largest_value_at_their_times_and_holds_the_last() -> None:
    root = drawn(Panel("force, N", [curve((0.0, 0.0, 0.0), (5.0, -1.0, 1.0))]))
    points = points_of(path_of(root, "line"))
    assert [x for x, _ in points] == pytest.approx([at(0.0), at(5.0), at(5.0), at(10.0), at(10.0)], abs=0.1)
    zero, low, high, *last = (y for _, y in points)
    assert last == [low, high]
    assert high < zero < low, "up is less y"
    assert "force, N" in [text.text for text in of_class(root, "title")]


@pytest.mark.parametrize("kind", ["line", "band"])
@pytest.mark.parametrize("largest", [2.5, 1e300, math.inf])
def test_a_value_beyond_the_axis_is_drawn_at_its_edge(largest: float, kind: str) -> None:
    panel = Panel("μ", [curve((0.0, 0.4, 0.6), (5.0, 0.4, largest), kind=kind)], most=2.0)
    path = path_of(drawn(panel), kind)
    assert path.endswith("Z") == (kind == "band")
    heights = sorted({y for _, y in points_of(path)})
    least, most = panel.span

    def height_of(value: float) -> float:
        return TITLE + PANEL * (most - value) / (most - least)

    assert most < largest
    assert heights == pytest.approx([TITLE, height_of(0.6), height_of(0.4)], abs=0.06)


@given(st.lists(st.tuples(st.floats(-5.0, 15.0), *[st.floats(-1e6, 1e9)] * 2), min_size=1, max_size=20), st.booleans())
def test_whatever_is_drawn_lies_within_its_panel(points: list[tuple[float, float, float]], band: bool) -> None:
    times = sorted(points, key=lambda point: point[0])
    values = [(t_s, min(one, other), max(one, other)) for t_s, one, other in times]
    panel = Panel("x", [curve(*values, kind="band" if band else "line")], limits=[(1.0, "slips")], most=100.0)
    for x, y in points_of(path_of(drawn(panel), "band" if band else "line")):
        assert LEFT <= x <= WIDTH - RIGHT
        assert TITLE - 0.1 <= y <= TITLE + PANEL + 0.1


def test_spans_stand_at_their_times_with_the_text_that_fits() -> None:
    texts = ("caution: rotation <x>", "rotation <x>")
    spans = [
        Span(0.0, 5.0, "caution", texts, texts[0]),
        Span(5.0, 5.9, "slipping", texts, "all"),
        Span(6.0, 6.4, "ERROR", ("ERROR",), "capitals are wider"),
        Span(9.99, 10.0, "stable", texts, "s"),
    ]
    root = drawn(StripGroup("levels", {"a finger with a name that is far too long": spans}, "note & more"))
    first, *_, last = [each for each in root.iter() if each.get("fill")]
    place = [float(first.get(key, "")) for key in ("x", "width")]
    assert place == pytest.approx([at(0.0), at(5.0) - at(0.0)], abs=0.1)
    assert float(last.get("width", "")) > 0.5, "a short one stays visible"
    assert [text.text for text in of_class(root, "dark")] == ["caution: rotation <x>"]
    assert [text.text for text in of_class(root, "light")] == ["rotation <x>"]
    titles = {each.text for each in root.iter() if each.tag == "title"}
    told = {"0.000 to 5.000 s: caution: rotation <x>", "a finger with a name that is far too long", "note & more"}
    assert told <= titles
    assert "a finger with a name th…" in [each.text for each in of_class(root, "end")]


IMAGE = {"rows": 2, "cols": 2, "pitch_m": 0.01, "loads_n": [0.0, 4.0, 2.0, 2.0]}


def test_a_snapshot_shows_loads_and_marks_in_the_frame_of_the_pad() -> None:
    root = ElementTree.fromstring(snapshot_svg(IMAGE, {"centroid_m": [0.005, -0.005], "pole_m": [-0.005, 0.005]}))
    shown = {(each.get("x"), each.get("y")): each.get("fill-opacity") for each in of_class(root, "load")}
    zero, one = "0", f"{TAXEL}"
    assert shown == {(one, one): "1.00", (zero, zero): "0.50", (one, zero): "0.50"}, "the largest is at the lower right"
    (cross,) = (each for each in root.iter("path"))
    assert cross.get("d", "").startswith(f"M{1.5 * TAXEL:.1f} {1.5 * TAXEL:.1f}m")
    (circle,) = root.iter("circle")
    assert (float(circle.get("cx", "")), float(circle.get("cy", ""))) == (0.5 * TAXEL, 0.5 * TAXEL)
    assert "mark" not in snapshot_svg(IMAGE, {"centroid_m": None, "pole_m": [1.0, 0.0]})
    assert "load" not in snapshot_svg(IMAGE | {"loads_n": [0.0] * 4}, {})


@pytest.mark.parametrize(
    ("rows_along", "cols_along", "place"),
    [
        ("+y", "+x", (2, 1)),
        ("-y", "+x", (2, 0)),
        ("+y", "-x", (0, 1)),
        ("+x", "+y", (0, 0)),
        ("-x", "+y", (1, 0)),
        ("+x", "-y", (0, 2)),
        ("-x", "-y", (1, 2)),
    ],
)
def test_the_scan_of_a_pad_may_run_in_any_direction(rows_along: str, cols_along: str, place: tuple[int, int]) -> None:
    scan = {"rows": 2, "cols": 3, "pitch_m": 0.01, "loads_n": [0.0, 0.0, 4.0, 0.0, 0.0, 0.0]}
    root = ElementTree.fromstring(snapshot_svg(scan | {"rows_along": rows_along, "cols_along": cols_along}, {}))
    (load,) = of_class(root, "load")
    assert (load.get("x"), load.get("y")) == tuple(str(TAXEL * at) for at in place)
