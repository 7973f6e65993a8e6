"""The table of an evaluation, and what differs between configs."""

from __future__ import annotations

import json
from pathlib import Path

from slipd.tools.evaluation.config_run import RECORDED, ConfigRun, Largest, LevelSpan
from slipd.tools.evaluation.evaluate import Evaluation
from slipd.tools.evaluation.evaluate_command import as_map, comparisons, table


def run(*parts: tuple[str, float, float], used: float = 0.5) -> ConfigRun:
    spans = [LevelSpan(level, ("rotation",) if level == "warning" else (), (), *times) for level, *times in parts]
    return ConfigRun({"left": spans}, Largest(used, "left", 1.0), 4.0)


BEFORE = run(("stable", 0.0, 2.0), ("warning", 2.0, 4.0), used=0.9)
AFTER = run(("stable", 0.0, 1.5), ("warning", 1.5, 3.0), ("slipping", 3.0, 3.5), ("unknown", 3.5, 4.0), used=1.2)
QUIET = run(("stable", 0.0, 4.0))


def evaluation(**runs: ConfigRun | str) -> Evaluation:
    return Evaluation("a.mcap", Path("/data/a.mcap"), {RECORDED: BEFORE, **runs})


def test_the_table_has_a_row_for_each_recording_and_config() -> None:
    head, first, second, third = table([evaluation(after=AFTER, broken="no such file")])
    assert head.split()[:9] == [
        "recording", "config", "length", "no_contact", "stable", "unknown", "caution", "warning", "slipping"
    ]  # fmt: skip
    assert " ".join(first.split()) == "a.mcap recorded 4.00 - 2.00 - - 2.00 - 1 1 2.000 - 0.90 - rotation"
    told = "after 4.00 - 1.50 0.50 - 1.50 0.50 3 1 1.500 3.00…3.50 1.20 no reason 0.50 rotation"
    assert " ".join(second.split()) == told
    assert " ".join(third.split()) == "broken no run, see below"


def test_what_a_config_changes_is_told_against_the_recorded_one() -> None:
    assert list(comparisons([evaluation(after=AFTER)])) == [
        "a.mcap, after: other levels than recorded for 1.50 s; changes 1 → 3, warnings 1 as before, "
        "first warning 2 s → 1.5 s",
        "       1.500…2.000 s  stable → warning",
        "       3.000…3.500 s  warning → slipping",
        "       3.500…4.000 s  warning → unknown",
    ]
    (gone, _) = comparisons([evaluation(quiet=QUIET)])
    assert gone.endswith("changes 1 → 0, warnings 1 → 0, first warning 2 s → none")
    again = run(("stable", 0.0, 2.0), ("warning", 2.0, 4.0))
    assert list(comparisons([evaluation(same=again)])) == ["a.mcap, same: the same levels as recorded"]


def test_of_many_differences_the_longest_are_told() -> None:
    lengths_s = (0.1, 0.5, 0.3, 0.2, 0.4, 0.6)
    parts: list[tuple[str, float, float]] = []
    for at_s, length_s in enumerate(lengths_s):
        parts += [("slipping", at_s, at_s + length_s), ("stable", at_s + length_s, at_s + 1.0)]
    one = Evaluation("a.mcap", Path("/data/a.mcap"), {RECORDED: run(("stable", 0.0, 6.0)), "after": run(*parts)})
    _, *times, more = comparisons([one])
    assert [float(line.split("…")[0]) for line in times] == [1.0, 2.0, 4.0, 5.0]
    assert more == "    and 2 shorter times"
    assert "0.00…0.10, 1.00…1.50, 2.00…2.30, 3.00…3.20 and 2 more" in list(table([one]))[2]


def test_a_config_that_reports_nothing_is_not_said_to_report_the_same() -> None:
    (told,) = comparisons([evaluation(deaf=ConfigRun({}, end_s=4.0))])
    assert told == "a.mcap, deaf: no levels; the sensors of a config must be those of the recording"


def test_the_map_has_everything() -> None:
    (found,) = json.loads(json.dumps(as_map([evaluation(after=AFTER, broken="no such file")])))
    assert found["recording"] == "/data/a.mcap"
    runs, after = found["runs"], found["runs"]["after"]
    assert (runs[RECORDED]["largest"]["finger"], runs["broken"]) == ("left", {"fault": "no such file"})
    assert (after["level_s"]["slipping"], after["spans"]["left"][0]["level"]) == (0.5, "stable")
    assert after["differences"][0] == [1.5, 2.0, "stable", "warning"]
