"""The measurements of the simulated grasp."""

from __future__ import annotations

import pytest
from chart import stick_slip


def test_a_quick_run_gives_every_table() -> None:
    study = stick_slip.run(quick=True)
    expected, found = study.turned_nm["uniform disc"]
    assert found == pytest.approx(expected, rel=0.01)
    assert study.limits["disc"].utilisation.max() == pytest.approx(1.0, abs=0.01)
    assert [len(table.rows) for table in stick_slip.tables(study)] == [1, 1, 1, 1, 2]
    assert study.steps[0].displacement_error < 0.05
