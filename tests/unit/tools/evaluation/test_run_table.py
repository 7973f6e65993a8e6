"""The Parquet file of many runs."""

from __future__ import annotations

import textwrap
from dataclasses import asdict
from pathlib import Path

import pytest
from project import ROOT
from replays import RECORDINGS

from slipd import __version__
from slipd.tools.evaluation.config_run import RECORDED, run_config
from slipd.tools.evaluation.evaluate import ResultCache, finished_runs
from slipd.tools.evaluation.run_figures import figures, write_table

parquet = pytest.importorskip("pyarrow.parquet")

XELA = RECORDINGS / "xela.mcap"


def test_a_row_has_the_figures_of_its_run(tmp_path: Path) -> None:
    cache, path = ResultCache(tmp_path / "results"), tmp_path / "a.parquet"
    write_table(path, finished_runs([XELA], [], cache))
    (row,) = parquet.read_table(path).to_pylist()
    run = run_config(XELA, None, RECORDED)
    found = figures(run)
    alarms = [
        {"source": source} | span._asdict() | {"reasons": list(span.reasons), "evidence": list(span.evidence)}
        for source, spans in run.spans.items()
        for span in spans
        if span.level in ("warning", "slipping")
    ]
    assert row.pop("compute_s") > 0.0
    assert row == {
        "recording": str(XELA),
        "config": RECORDED,
        "key": cache.keys(XELA, [None])[0],
        "version": __version__,
        "fault": None,
        "length_s": run.end_s,
        **{f"{level}_s": seconds for level, seconds in found.level_s.items()},
        "unknown_because": list(found.unknown_s.items()),
        "changes": found.changes,
        "warnings": found.warnings,
        "first_warning_s": found.first_warning_s,
        "alarms": alarms,
        "largest": asdict(run.largest) if run.largest else None,
        "streams": [stream._asdict() for stream in run.streams],
        "gaps": run.gaps,
    }
    assert found.warnings > 0
    again = parquet.read_table(path).to_pylist()
    write_table(path, finished_runs([XELA], [], cache))
    assert parquet.read_table(path).to_pylist() == again, "the time of computing is that of the first evaluation"


def test_the_snippet_of_the_page_reads_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs" / "batches.md").read_text(encoding="utf-8")
    write_table(tmp_path / "runs.parquet", finished_runs([XELA], [], ResultCache(tmp_path / "results")))
    monkeypatch.chdir(tmp_path)
    exec(textwrap.dedent(page[page.index("    import pyarrow") :].partition("\n\n")[0]))
    assert "'config': 'recorded', 'warnings_mean': " in capsys.readouterr().out


def test_a_row_says_why_a_run_is_incomplete(tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(XELA.read_bytes()[: XELA.stat().st_size * 3 // 4])
    write_table(tmp_path / "a.parquet", finished_runs([XELA, cut], [], ResultCache(tmp_path / "results")))
    faults = {row["recording"]: row["fault"] for row in parquet.read_table(tmp_path / "a.parquet").to_pylist()}
    assert faults[str(XELA)] is None
    assert faults[str(cut)].startswith(f"{cut}: was cut off in the record at byte ")
