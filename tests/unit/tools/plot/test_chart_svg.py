from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import pytest

from slipd.tools.plot.binned_track import NO_VALUE, Held, Window
from slipd.tools.plot.chart import Curve, Panel, Span, Strip, StripGroup
from slipd.tools.plot.chart_svg import LEFT, RIGHT, TAXEL, WIDTH, chart_svg, heat, snapshot_svg
from slipd_client.pad_picture import CENTROID, POLE, PadImage, pad_image

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
        "finger 0",
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


def test_a_curve_goes_through_its_values_at_their_times() -> None:
    root = drawn(Panel("force", "N", [curve((0.0, 0.0, 0.0), (5.0, 1.0, 1.0))]))
    points = points_of(path_of(root, "line"))
    assert [x for x, _ in points] == pytest.approx([at(0.0), at(5.0), at(10.0)], abs=0.1)
    assert points[0][1] > points[1][1] == points[2][1], "up is less y, and the last value holds to the end"
    assert "force, N" in [text.text for text in of_class(root, "title")]


def test_least_and_largest_value_of_a_column_are_both_drawn() -> None:
    root = drawn(Panel("force", "N", [curve((0.0, 0.0, 0.0), (5.0, -1.0, 1.0))]))
    heights = {y for x, y in points_of(path_of(root, "line")) if x == pytest.approx(at(5.0), abs=0.1)}
    assert len(heights) == 2


def test_a_curve_has_a_gap_where_its_value_is_not_known() -> None:
    root = drawn(Panel("force", "N", [curve((0.0, 1.0, 1.0), (4.0, *NO_VALUE), (5.0, 1.0, 1.0))]))
    first, second = path_of(root, "line").strip("M").split("M")
    assert max(x for x, _ in points_of(first)) == pytest.approx(at(4.0), abs=0.1)
    assert min(x for x, _ in points_of(second)) == pytest.approx(at(5.0), abs=0.1)


def test_a_band_is_an_area_between_both_values() -> None:
    root = drawn(Panel("μ", "", [curve((0.0, 0.4, 0.6), (5.0, 0.4, float("inf")), kind="band")], most=2.0))
    path = path_of(root, "band")
    assert path.endswith("Z")
    heights = sorted({y for _, y in points_of(path)})
    assert len(heights) == 3, "the infinite bound is drawn at the edge"


def test_a_value_that_stays_costs_two_points() -> None:
    many = [(n * 0.01, 1.0, 1.0) for n in range(900)]
    assert len(points_of(path_of(drawn(Panel("force", "N", [curve(*many)])), "line"))) == 2


def test_spans_stand_at_their_times_with_the_text_that_fits() -> None:
    texts = ("caution: rotation <x>", "rotation <x>")
    spans = [
        Span(0.0, 5.0, "caution", texts, texts[0]),
        Span(5.0, 5.9, "slipping", texts, "all"),
        Span(9.99, 10.0, "stable", texts, "s"),
    ]
    root = drawn(StripGroup("levels", [Strip("a finger with a name that is far too long", spans)], "note & more"))
    first, _, last = [each for each in root.iter() if each.get("fill")]
    assert float(first.get("x", "")) == pytest.approx(at(0.0), abs=0.1)
    assert float(first.get("width", "")) == pytest.approx(at(5.0) - at(0.0), abs=0.1)
    assert float(last.get("width", "")) > 0.5, "a short one stays visible"
    assert [text.text for text in of_class(root, "dark")] == ["caution: rotation <x>"]
    assert [text.text for text in of_class(root, "light")] == ["rotation <x>"]
    titles = [each.text for each in root.iter() if each.tag == "title"]
    assert "0.000 to 5.000 s: caution: rotation <x>" in titles
    assert "a finger with a name that is far too long" in titles
    assert "note & more" in titles
    assert "a finger with a name th…" in [each.text for each in of_class(root, "end")]


def test_nothing_is_outside_of_the_picture(demo: Any) -> None:
    from slipd.config import Levels
    from slipd.tools.plot.chart import chart

    tracks, _ = demo
    root = ElementTree.fromstring(chart_svg(chart(tracks, Levels()), tracks.window))
    _, _, width, height = map(float, root.get("viewBox", "").split())
    for each in root.iter():
        if each.tag == "rect":
            assert float(each.get("x", "")) + float(each.get("width", "")) <= width
            assert float(each.get("y", "")) + float(each.get("height", "")) <= height
        elif each.get("d", "").endswith("Z") or "L" in each.get("d", ""):
            assert all(0.0 <= x <= width and 0.0 <= y <= height for x, y in points_of(each.get("d", "")))


def image(*loads: float) -> PadImage:
    found = pad_image({"rows": 2, "cols": 2, "pitch_m": 0.01, "force_unit": "N", "loads_n": list(loads)})
    assert found is not None
    return found


def test_a_snapshot_shows_loads_and_marks_in_the_frame_of_the_pad() -> None:
    text = snapshot_svg(image(0.0, 4.0, 2.0, 2.0), ((CENTROID, [0.005, -0.005]), (POLE, [-0.005, 0.005])))
    root = ElementTree.fromstring(text)
    rects = [(float(each.get("x", "")), float(each.get("y", "")), each.get("fill")) for each in root.iter("rect")]
    assert (TAXEL, TAXEL, heat(1.0)) in rects, "the largest load is at the lower right"
    assert (0.0, TAXEL, heat(0.0)) in rects
    (cross,) = (each for each in root.iter("path"))
    assert cross.get("d", "").startswith(f"M{1.5 * TAXEL:.1f} {1.5 * TAXEL:.1f}m")
    (circle,) = root.iter("circle")
    assert (float(circle.get("cx", "")), float(circle.get("cy", ""))) == (0.5 * TAXEL, 0.5 * TAXEL)
    assert "mark" not in snapshot_svg(image(0.0, 1.0, 2.0, 2.0), ((CENTROID, None), (POLE, [1.0, 0.0])))


def test_a_larger_load_is_brighter() -> None:
    def brightness(colour: str) -> float:
        red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
        return 0.3 * red + 0.59 * green + 0.11 * blue

    found = [brightness(heat(share)) for share in (0.01, 0.25, 0.5, 0.75, 1.0, 2.0)]
    assert found[:5] == sorted(found[:5])
    assert found[5] == found[4]
