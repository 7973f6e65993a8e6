from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

from slipd.config import Levels
from slipd.tools.plot.plot_page import DrawnRun, page


def page_of(tracks: Any, *, title: str = "a.mcap", fault: str = "") -> str:
    return page([DrawnRun(title, ["Recorded."], fault, tracks, Levels())])


def elements(text: str) -> list[ElementTree.Element]:
    """Return all elements of a page, whose tags are closed, but for those that have no content."""
    closed = re.sub(r"<(meta|br)\b([^>]*)>", r"<\1\2/>", text.removeprefix("<!doctype html>"))
    return list(ElementTree.fromstring(closed).iter())


def test_the_page_asks_nobody_for_anything(demo: Any) -> None:
    text = page_of(demo[0])
    found = elements(text)
    assert not {each.tag for each in found} & {"script", "link", "img", "iframe", "object", "base", "form", "a"}
    assert not {name for each in found for name in each.attrib} & {"src", "href", "action"}
    assert not re.search(r"https?:|url\(|@import", text)
    assert any("default-src 'none'" in each.get("content", "") for each in found)


def test_a_real_run_is_shown_with_its_alarms_and_changes(demo: Any) -> None:
    tracks = demo[0]
    text = page_of(tracks)
    assert text.count("<figure>") == len(tracks.changes.snapshots) > 0
    assert text.count("<tr>") == tracks.changes.count + 1
    assert "slipped" not in text
    assert 'class="fault"' not in text


def test_names_and_reasons_are_escaped(run: Any) -> None:
    run.add_image(0.0, "left", 0.0, 1.0, 2.0, 4.0)
    run.add_change(1.0, "left", "stable", "warning", "<b>why</b>")
    text = page_of(run.tracks, title="<i>.mcap", fault="cut & off")
    assert not {each.tag for each in elements(text)} & {"b", "i"}
    assert '<p class="fault">cut &amp; off</p>' in text


def test_a_quiet_run_says_so(run: Any) -> None:
    run.add("slip.left", 1.0)
    text = page_of(run.tracks)
    assert "No finger rose to “warning” or “slipping”." in text
    assert "<p>None.</p>" in text
