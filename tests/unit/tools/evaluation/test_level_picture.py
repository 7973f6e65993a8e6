"""The picture of the levels over time."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from slipd.tools.evaluation.config_run import RECORDED, ConfigRun, Truth
from slipd.tools.evaluation.evaluate import Evaluation
from slipd.tools.evaluation.level_picture import COLOURS, DIFFERENT, LEFT, MARK, RIGHT, STRIP, TRUE_SLIP, WIDTH, picture
from slipd.tools.evaluation.level_spans import LevelSpan

Rect = dict[str, float]


def run(*parts: tuple[str, float, float], truth: Truth | None = None) -> ConfigRun:
    spans = [LevelSpan(level, ("<why>",), (), *times) for level, *times in parts]
    return ConfigRun({"left": spans}, None, 4.0, truth=truth)


RUNS: dict[str, ConfigRun | str] = {
    RECORDED: run(("stable", 0.0, 2.0), ("slipping", 2.0, 4.0), truth=Truth([(2.5, 3.0)], 1.0)),
    "a & b.toml": run(("stable", 0.0, 3.0), ("slipping", 3.0, 4.0)),
    "bad.toml": "no run",
}
DRAWN = picture([Evaluation("a<b>.mcap", Path("a"), RUNS), Evaluation("gone", Path("g"), {})])


def rects(colour: str) -> list[Rect]:
    """Rectangles of a colour below the legend."""
    found = [dict(rect.attrib) for rect in ElementTree.fromstring(DRAWN).iter("{http://www.w3.org/2000/svg}rect")]
    drawn = [rect for rect in found if rect["fill"] == colour and float(rect.get("y", "0")) > 20.0]
    return [{key: float(rect[key]) for key in ("x", "y", "width", "height")} for rect in drawn]


def at(t_s: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * t_s / 4.0


def test_each_strip_shows_its_levels_at_their_times() -> None:
    stable, slipping = rects(COLOURS["stable"]), rects(COLOURS["slipping"])
    assert [rect["x"] for rect in stable] == pytest.approx([at(0.0), at(0.0)])
    assert [rect["x"] for rect in slipping] == pytest.approx([at(2.0), at(3.0)])
    assert [rect["x"] + rect["width"] for rect in slipping] == pytest.approx([at(4.0), at(4.0)], abs=0.02)
    assert [rect["height"] for rect in slipping] == [STRIP, STRIP], "the most severe level is the highest"
    assert stable[0]["y"] + stable[0]["height"] == slipping[0]["y"] + STRIP, "strips stand on one line"


def test_what_differs_and_what_is_true_is_marked() -> None:
    (different,), (true,) = rects(DIFFERENT), rects(TRUE_SLIP)
    assert (different["x"], different["width"]) == pytest.approx((at(2.0), at(3.0) - at(2.0)), abs=0.02)
    assert (true["x"], true["width"]) == pytest.approx((at(2.5), at(3.0) - at(2.5)), abs=0.02)
    lowest = max(rect["y"] + rect["height"] for rect in rects(COLOURS["slipping"]))
    assert true["y"] >= lowest
    assert true["height"] == MARK


def test_names_are_escaped_and_long_ones_cut_at_the_front() -> None:
    texts = [text.text for text in ElementTree.fromstring(DRAWN).iter("{http://www.w3.org/2000/svg}text")]
    assert {"a<b>.mcap", RECORDED, "a & b.toml", "bad.toml", "no run", "gone", "0 s", "4 s"} <= set(texts)
    long = picture([Evaluation("x", Path("x"), {f"{'long/' * 20}end.toml": "no run"})])
    assert "/long/end.toml<" in long
    assert "long/" * 6 not in long


def test_nothing_is_outside_of_the_picture() -> None:
    root = ElementTree.fromstring(DRAWN)
    for rect in root.iter("{http://www.w3.org/2000/svg}rect"):
        if "x" in rect.attrib:
            assert float(rect.attrib["x"]) + float(rect.attrib["width"]) <= WIDTH
            assert float(rect.attrib["y"]) + float(rect.attrib["height"]) <= float(root.attrib["height"])
