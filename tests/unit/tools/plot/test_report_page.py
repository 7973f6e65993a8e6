from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import Any

from slipd.config import Levels
from slipd.tools.plot.chart import chart
from slipd.tools.plot.report_page import Report, page


def page_of(tracks: Any, *, title: str = "a.mcap", faults: tuple[str, ...] = ()) -> str:
    return page(Report(title, ["Recorded."], faults, tracks.window, chart(tracks, Levels()), tracks.changes))


class Tags(HTMLParser):
    """Collects tags and attributes, and sees to it that each is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_asks_nobody_for_anything(demo: Any) -> None:
    text = page_of(demo[0])
    tags = Tags(text).found
    assert not {tag for tag, _ in tags} & {"script", "link", "img", "iframe", "object", "base", "form", "a"}
    assert not [name for _, attributes in tags for name in attributes if name in ("src", "href", "action")]
    assert not re.search(r"https?:|url\(|@import", text)
    assert any("default-src 'none'" in (attributes.get("content") or "") for _, attributes in tags)


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
    text = page_of(run.tracks, title="<i>.mcap", faults=("cut & off",))
    Tags(text)
    assert "<b>" not in text
    assert "<i>" not in text
    assert '<p class="fault">cut &amp; off</p>' in text


def test_a_quiet_run_says_so(run: Any) -> None:
    run.add("slip.left", 1.0)
    text = page_of(run.tracks)
    assert "No finger rose to “warning” or “slipping”." in text
    assert "<p>None.</p>" in text
