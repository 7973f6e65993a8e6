"""Figures of a run, from its levels."""

from __future__ import annotations

from slipd.tools.evaluation.config_run import ConfigRun, Largest, LevelSpan
from slipd.tools.evaluation.run_figures import differences, figures, worst_spans


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
    found = figures(RUN)
    assert found.level_s == {
        "no_contact": 1.0, "stable": 1.25, "unknown": 0.25, "caution": 0.0, "warning": 1.0, "slipping": 0.5
    }  # fmt: skip
    assert (found.changes, found.warnings, found.first_warning_s) == (7, 2, 2.0)
    assert (found.alarms, found.slipping) == ([(2.0, 3.0), (3.5, 4.0)], [(2.5, 3.0)])
    assert found.unknown_s == {"stale": 0.25}
    assert found.largest == Largest(1.1, "left", 2.6)
    assert found.named == ["rotation", "load_drop", "tipping"]


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
