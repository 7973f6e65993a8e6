"""The Parquet file of many runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from replays import RECORDINGS

from slipd.tools.evaluation.config_replay import run_config
from slipd.tools.evaluation.config_run import RECORDED
from slipd.tools.evaluation.evaluate import finished_runs
from slipd.tools.evaluation.result_cache import ResultCache
from slipd.tools.evaluation.run_figures import figures
from slipd.tools.evaluation.run_table import write_table

parquet = pytest.importorskip("pyarrow.parquet")

DEMO = RECORDINGS / "demo.mcap"


def rows(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
    return found


def test_a_row_has_the_figures_of_its_run(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path / "results")
    write_table(tmp_path / "a.parquet", finished_runs([DEMO], [], cache))
    (row,) = rows(tmp_path / "a.parquet")
    run = run_config(DEMO, None, RECORDED)
    found = figures(run)
    assert (row["recording"], row["config"], row["fault"]) == (str(DEMO), RECORDED, None)
    assert [row["key"]] == cache.keys(DEMO, [None])
    assert (row["length_s"], row["warning_s"], row["changes"]) == (run.end_s, found.level_s["warning"], found.changes)
    assert row["warnings"] == found.warnings > 0
    alarms = [(alarm["source"], alarm["level"], alarm["begin_s"], tuple(alarm["reasons"])) for alarm in row["alarms"]]
    assert alarms == [
        (source, span.level, span.begin_s, span.reasons)
        for source, spans in run.spans.items()
        for span in spans
        if span.level in ("warning", "slipping")
    ]
    assert {stream["stream"]: stream["samples"] for stream in row["streams"]} == {
        stream.stream: stream.samples for stream in run.streams
    }
    assert row["streams"][0]["samples"] > 0
    assert row["compute_s"] > 0.0
    write_table(tmp_path / "a.parquet", finished_runs([DEMO], [], cache))
    assert rows(tmp_path / "a.parquet") == [row], "the time of computing is that of the first evaluation"
