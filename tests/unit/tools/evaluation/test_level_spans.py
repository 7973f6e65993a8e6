"""What each source reported over time, from the messages of a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from slipd.recording.reader import Gap
from slipd.tools.evaluation.config_run import NOT_RECORDED, LevelSpan, level_spans


def slip(t_s: float, level: str, *reasons: str, topic: str = "slip.left", **more: Any) -> tuple[str, dict[str, Any]]:
    return topic, {"t_ns": round(t_s * 1e9), "level": level, "reasons": list(reasons), **more}


def test_the_evidence_of_a_span_is_that_of_all_its_messages() -> None:
    named = [["load_drop"], None, ["image_change", "load_drop"], []]
    (span,) = level_spans([slip(float(n), "slipping", evidence=kinds) for n, kinds in enumerate(named)])["left"]
    assert span.evidence == ("load_drop", "image_change")


def test_a_verdict_on_an_old_reading_does_not_turn_time_back() -> None:
    found = level_spans([slip(1.0, "stable"), slip(2.0, "stable"), slip(2.0, "warning"), slip(1.9, "unknown", "stale")])
    assert [(span.begin_s, span.end_s) for span in found["left"]] == [(1.0, 2.0), (2.0, 2.0), (2.0, 2.0)]


def test_no_level_is_known_from_the_begin_of_a_gap_to_the_next_message() -> None:
    """A level that stays needs no message; without events nobody knows that it stays."""
    gaps: list[Gap] = []

    def run() -> Iterator[tuple[str, dict[str, Any]]]:
        yield slip(1.0, "stable")
        yield slip(1.9, "stable")
        gaps.append(Gap(2.0, 4.0))
        yield "status", {"t_ns": 4_000_000_000}
        yield slip(4.5, "stable")
        yield slip(5.0, "warning", topic="slip.right")
        gaps.append(Gap(6.0, 7.0))

    found = level_spans(run(), 7.0, gaps)
    assert found["left"] == [
        LevelSpan("stable", (), (), 1.0, 2.0),
        LevelSpan("unknown", (NOT_RECORDED,), (), 2.0, 4.5),
        LevelSpan("stable", (), (), 4.5, 6.0),
        LevelSpan("unknown", (NOT_RECORDED,), (), 6.0, 7.0),
    ]
    assert [(span.level, span.begin_s) for span in found["right"]] == [("warning", 5.0), ("unknown", 6.0)]
