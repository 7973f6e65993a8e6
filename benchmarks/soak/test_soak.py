"""A few quick cycles of ``python -m soak --only unplug`` measure every figure."""

from __future__ import annotations

from pathlib import Path

import pytest
from soak import unplug


def test_a_few_cycles_are_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setattr(unplug, "QUICK_CYCLES", 3)
    times, holdings = unplug.run(tmp_path, quick=True)
    assert [(row[0], row[1]) for row in times.rows] == [
        *((f"noticed, {state}", 1) for state in unplug.STATES),
        ("reopened, short away", 3),
    ]
    assert [row[0] for row in holdings.rows] == ["memory, kB", "open files", "tasks"]
    assert holdings.rows[2][3] == 0
