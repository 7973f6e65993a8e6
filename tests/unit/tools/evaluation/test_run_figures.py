"""What each source reported over time, and the figures that follow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from slipd.recording.reader import EventGaps, Gap
from slipd.tools.evaluation.config_run import NOT_RECORDED, ConfigRun, Largest, LevelSpan, level_spans
from slipd.tools.evaluation.run_figures import RunFigures, differences, figures, worst_spans


def spans(*parts: tuple[str, float]) -> list[LevelSpan]:
    """Levels with their lengths, one after another from 0 on: ``level:reason+evidence``."""
    found: list[LevelSpan] = []
    for text, length_s in parts:
        begin_s = found[-1].end_s if found else 0.0
        text, _, evidence = text.partition("+")
        level, _, reason = text.partition(":")
        named = [(word,) if word else () for word in (reason, evidence)]
        found.append(LevelSpan(level, *named, begin_s, begin_s + length_s))
    return found


RUN = ConfigRun(
    {
        "left": spans(
            ("no_contact", 1.0),
            ("stable", 1.0),
            ("warning:rotation", 0.5),
            ("slipping+load_drop", 0.5),
            ("stable", 1.0),
        ),
        "right": spans(("no_contact", 1.5), ("unknown:stale", 0.25), ("stable", 1.75), ("warning:tipping", 0.5)),
        "grasp": spans(("slipping", 4.0)),
    },
    Largest(1.1, "left", 2.6),
    4.0,
)


def test_the_worse_finger_counts_at_each_time() -> None:
    assert [(span.level, span.begin_s, span.end_s) for span in worst_spans(RUN.spans)] == [
        ("no_contact", 0.0, 1.0),
        ("stable", 1.0, 1.5),
        ("unknown", 1.5, 1.75),
        ("stable", 1.75, 2.0),
        ("warning", 2.0, 2.5),
        ("slipping", 2.5, 3.0),
        ("stable", 3.0, 3.5),
        ("warning", 3.5, 4.0),
    ]


def test_the_figures_of_a_run() -> None:
    levels_s = {"no_contact": 1.0, "stable": 1.25, "unknown": 0.25, "caution": 0.0, "warning": 1.0, "slipping": 0.5}
    assert figures(RUN) == RunFigures(
        length_s=4.0,
        level_s=levels_s,
        changes=7,
        warnings=2,
        first_warning_s=2.0,
        alarms=[(2.0, 3.0), (3.5, 4.0)],
        slipping=[(2.5, 3.0)],
        unknown_s={"stale": 0.25},
        largest=Largest(1.1, "left", 2.6),
        named=["rotation", "load_drop", "tipping"],
    )


def test_the_differences_of_two_runs() -> None:
    before = spans(("stable", 1.0), ("warning:rotation", 1.0), ("warning:tipping", 1.0), ("stable", 1.0))
    after = spans(("stable", 0.5), ("caution", 1.0), ("warning", 2.0))
    assert differences(before, after) == [
        (0.5, 1.0, "stable", "caution"),
        (1.0, 1.5, "warning", "caution"),
        (3.0, 3.5, "stable", "warning"),
    ], "where one run has ended nothing differs"
    assert differences(before, before) == []
    assert differences(before, spans(("stable", 3.0))) == [(1.0, 3.0, "warning", "stable")], "reasons do not divide it"
    apart = [LevelSpan("warning", (), (), 0.0, 1.0), LevelSpan("warning", (), (), 2.0, 3.0)]
    calm = [LevelSpan("stable", (), (), span.begin_s, span.end_s) for span in apart]
    assert [found[:2] for found in differences(apart, calm)] == [(0.0, 1.0), (2.0, 3.0)]


def slip(t_s: float, level: str, *reasons: str, topic: str = "slip.left", **more: Any) -> tuple[str, dict[str, Any]]:
    return topic, {"t_ns": round(t_s * 1e9), "level": level, "reasons": list(reasons), **more}


def test_the_evidence_of_a_span_is_that_of_all_its_messages() -> None:
    named = [["load_drop"], None, ["image_change", "load_drop"], []]
    (span,) = level_spans([slip(float(n), "slipping", evidence=kinds) for n, kinds in enumerate(named)], EventGaps())[
        "left"
    ]
    assert span.evidence == ("load_drop", "image_change")


def test_a_verdict_on_an_old_reading_does_not_turn_time_back() -> None:
    told = [slip(1.0, "stable"), slip(2.0, "stable"), slip(2.0, "warning"), slip(1.9, "unknown", "stale")]
    found = level_spans(told, EventGaps())
    assert [(span.begin_s, span.end_s) for span in found["left"]] == [(1.0, 2.0), (2.0, 2.0), (2.0, 2.0)]


def test_no_level_is_known_from_the_begin_of_a_gap_to_the_next_message() -> None:
    """A level that stays needs no message; without events nobody knows that it stays."""
    events = EventGaps()

    def run() -> Iterator[tuple[str, dict[str, Any]]]:
        yield slip(1.0, "stable")
        yield slip(1.9, "stable")
        events.found.append(Gap(2.0, 4.0))
        yield "status", {"t_ns": 4_000_000_000}
        yield slip(4.5, "stable")
        yield slip(5.0, "warning", topic="slip.right")
        events.add(6_000_000_000)
        events.add(7_000_000_000)

    found = level_spans(run(), events)
    assert found["left"] == [
        LevelSpan("stable", (), (), 1.0, 2.0),
        LevelSpan("unknown", (NOT_RECORDED,), (), 2.0, 4.5),
        LevelSpan("stable", (), (), 4.5, 6.0),
        LevelSpan("unknown", (NOT_RECORDED,), (), 6.0, 7.0),
    ]
    assert [(span.level, span.begin_s) for span in found["right"]] == [("warning", 5.0), ("unknown", 6.0)]
