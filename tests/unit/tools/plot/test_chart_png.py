from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from slipd.config import Levels
from slipd.tools.plot.chart import chart
from slipd.tools.plot.report_page import Report

pytest.importorskip("matplotlib")


def saved(tracks: Any, path: Path, *faults: str) -> tuple[int, int]:
    """Width and height of the picture, px."""
    from slipd.tools.plot import chart_png

    report = Report("a.mcap", ["Recorded."], faults, tracks.window, chart(tracks, Levels()), tracks.changes)
    chart_png.save(report, path)
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def test_a_real_run_is_drawn(demo: Any, tmp_path: Path) -> None:
    width, height = saved(demo[0], tmp_path / "a.png")
    assert width == 1200
    assert 1200 < height < 2400


def test_each_row_of_pads_and_each_fault_has_its_room(run: Any, tmp_path: Path) -> None:
    run.add_image(0.0, "left", 0.0, 1.0, 2.0, 4.0)
    heights = []
    for n in range(7):
        run.add_change(n + 1.0, "left", "stable", "warning", "slip_detected", "rotation", "translation", "tipping")
        heights.append(saved(run.tracks, tmp_path / "a.png")[1])
    assert heights[0] == heights[5] < heights[6]
    assert saved(run.tracks, tmp_path / "a.png", "cut off")[1] > heights[6]


def test_a_run_of_one_silent_finger_is_drawn(run: Any, tmp_path: Path) -> None:
    unknown = dict.fromkeys(("normal_n", "tangential_n", "spin_nm", "utilisation", "utilisation_lower", "mu", "mu_low"))
    run.add("slip.left", 1.0, level="unknown", reasons=["stale"], **unknown)
    saved(run.tracks, tmp_path / "a.png")
