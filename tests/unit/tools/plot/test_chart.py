from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slipd.config import Levels
from slipd.tools.plot.binned_track import NO_VALUE, Held
from slipd.tools.plot.chart import (
    COLOURS,
    SPAN_COLOURS,
    Curve,
    Panel,
    Span,
    StripGroup,
    chart,
    ticks,
)
from slipd.tools.plot.run_tracks import RunTracks
from slipd_client.messages import HEALTH, LEVELS

LEVELS_IN_FORCE = Levels(caution=0.5, warning=0.6)


def part(parts: list[Panel | StripGroup], title: str) -> Any:
    (found,) = (each for each in parts if each.title == title)
    return found


def names(panel: Panel) -> list[str]:
    return [curve.name for curve in panel.curves]


def test_a_real_run_has_every_part(demo: tuple[RunTracks, Any]) -> None:
    tracks, _ = demo
    parts = chart(tracks, LEVELS_IN_FORCE)
    assert [each.title for each in parts] == [
        "level and reasons",
        "utilisation λ",
        "evidence of motion",
        "normal force, N",
        "tangential force, N",
        "spin, N·m",
        "grip force on one pad, N",
        "friction coefficient μ",
        "source of μ",
        "health of the streams",
    ]
    assert part(parts, "utilisation λ").limits == ((0.5, "caution"), (0.6, "warning"), (1.0, "slips"))
    assert [names(part(parts, title)) for title in ("utilisation λ", "grip force on one pad, N")] == [
        ["left: bounds", "right: bounds", "left", "right"],
        ["now", "needed", "commanded"],
    ]
    assert list(part(parts, "level and reasons").strips) == ["left", "right"]
    assert set(part(parts, "health of the streams").strips) == set(tracks.streams)
    for each in parts:
        colours = [curve.colour for curve in each.curves] if isinstance(each, Panel) else []
        assert set(colours) <= set(COLOURS)
        spans = [] if isinstance(each, Panel) else [span for spans in each.strips.values() for span in spans]
        assert {span.colour for span in spans} <= set(SPAN_COLOURS)
        assert all(0.0 <= span.begin_s <= span.end_s <= tracks.window.end_s for span in spans)


def test_levels_name_their_reasons_and_evidence_its_finger(run: Any) -> None:
    run.add("slip.left", 0.0, level="caution", reasons=["rotation", "tipping"])
    run.add("slip.left", 1.0, level="slipping", evidence=["load_drop"])
    run.add("slip.left", 2.0, mu_source="one of a later version")
    parts = chart(run.tracks, LEVELS_IN_FORCE)
    (levels,) = part(parts, "level and reasons").strips.values()
    assert levels[0] == Span(
        0.0,
        1.0,
        "caution",
        ("caution: rotation, tipping", "rotation, tipping", "caution"),
        "caution: rotation, tipping",
    )
    assert levels[1].texts == ("slipping",)
    (sources,) = part(parts, "source of μ").strips.values()
    assert [span.colour for span in sources] == ["config", "none"]
    ((name, moved),) = part(parts, "evidence of motion").strips.items()
    (span,) = moved
    assert (name, span.begin_s, span.end_s, span.whole) == ("left: load_drop", 1.0, 2.0, "load_drop")


def test_faults_of_streams_are_counted_beside_the_title(run: Any) -> None:
    for t_s in (0.5, 1.0):
        run.add_stream(t_s, 2, "no such port", lost=3, reconnects=1, masked=[1, 2])
    group = part(chart(run.tracks, LEVELS_IN_FORCE), "health of the streams")
    assert group.note == "left.pad: 3 lost, 1 reconnects, 2 taxels masked"
    assert next(iter(group.strips.values()))[0].texts == ("ERROR: no such port", "ERROR")


def test_every_level_and_health_has_a_colour() -> None:
    assert {*LEVELS, *HEALTH, "evidence", "config", "request", "learned", "none"} == set(SPAN_COLOURS)


def test_an_axis_has_every_value_that_is_finite_and_zero() -> None:
    values = (-2.0, 1.0), NO_VALUE, (3.0, math.inf)
    curve = Curve("x", "now", [Held(float(at), at + 1.0, value) for at, value in enumerate(values)])
    least, most = Panel("x", [curve]).span
    assert least < -2.0 < 3.0 < most < 4.0
    assert Panel("x", [curve], most=2.0).span[1] < 2.5
    assert Panel("x", [Curve("x", "now", [Held(0.0, 1.0, (0.0, 0.0))])]).span == (0.0, 1.0)
    above = Curve("x", "now", [Held(0.0, 1.0, (2.0, 3.0))])
    assert Panel("x", [above], limits=[(4.0, "slips")]).span == (0.0, pytest.approx(4.24))


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(3, 12))
def test_ticks_are_round_and_within_the_axis(least: float, length: float, about: int) -> None:
    most = least + length
    assume(most > least)
    found = ticks(least, most, about)
    assert len(found) <= about + 1
    assert len(found) >= about / 2.5 - 1
    slack = 1e-6 * max(abs(least), abs(most), length)
    assert all(least - slack <= tick <= most + slack for tick in found)
    assert ticks(0.0, 10.0, 10) == list(range(11))
