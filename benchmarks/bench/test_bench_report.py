"""A part of the report is measured again alone, and the others stay as they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from bench.latency import PARTS
from bench.report import Report
from bench.tables import Table


def test_a_part_replaces_its_older_measurement_alone(tmp_path: Path) -> None:
    path = tmp_path / "report.md"
    Report(path, PARTS).put("replay", "Commit b, 2 cores", [Table("Replay", ("repeat", "times"), [("1", 9.0)])])
    Report(path, PARTS).put("chain", "Commit a, 2 cores", [Table("Chain", ("round", "p50"), [("1", 250)])])
    before = path.read_text(encoding="utf-8")
    assert before.index("## Chain") < before.index("Commit b") < before.index("## Replay"), "in the order of the parts"
    Report(path, PARTS).put("replay", "Commit c, 2 cores", [Table("Replay", ("repeat", "times"), [("1", 10.0)])])
    expected = before.replace("Commit b", "Commit c").replace("9.00", "10.0")
    assert path.read_text(encoding="utf-8") == expected


def test_a_report_with_an_unknown_part_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "report.md"
    path.write_text("# Measurements\n\n<!-- part: moon -->\n\nfar\n", encoding="utf-8")
    with pytest.raises(ValueError, match="the parts moon, which this program does not measure"):
        Report(path, PARTS)
