"""How a run compares with what truly happened."""

from __future__ import annotations

from dataclasses import replace

import pytest

from slipd.tools.evaluation.config_run import ConfigRun, Truth
from slipd.tools.evaluation.run_figures import RunFigures, figures
from slipd.tools.evaluation.truth_comparison import against_truth

QUIET = figures(ConfigRun({}))
SLIP = Truth([(2.0, 2.5)], 1.0)


def found(first_s: float | None, *slipping: tuple[float, float], warnings: int = 1) -> RunFigures:
    return replace(QUIET, first_warning_s=first_s, slipping=list(slipping), warnings=warnings)


@pytest.mark.parametrize(
    ("truth", "run", "told"),
    [
        (
            SLIP,
            found(1.5, (2.01, 2.4)),
            "warned 0.500 s before the slip; slipping reported 0.010 s after it began; "
            "0.390 s of 0.500 s of sliding reported as slipping",
        ),
        (
            SLIP,
            found(2.1, (2.1, 2.8)),
            "warned 0.100 s after the slip began; slipping reported 0.100 s after it began; "
            "0.400 s of 0.500 s of sliding reported as slipping; slipping for 0.300 s without motion",
        ),
        (
            SLIP,
            found(None),
            "the slip was not warned of; never reported as slipping; "
            "0.000 s of 0.500 s of sliding reported as slipping",
        ),
        (Truth([], 0.5), found(None, warnings=0), "no slip and no warning"),
        (
            Truth([], 0.5),
            found(1.0, (1.0, 1.5), warnings=2),
            "2 warnings without a slip; slipping for 0.500 s without motion",
        ),
    ],
)
def test_a_run_is_compared_with_the_truth(truth: Truth, run: RunFigures, told: str) -> None:
    assert against_truth(truth, run) == told
