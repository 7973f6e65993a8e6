"""What truly happened in the recording of a simulated grasp, and how a run compares with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.errors import RecordingError
from slipd.evaluation.config_run import ConfigRun
from slipd.evaluation.recorded_truth import Truth, against_truth, read_truth
from slipd.evaluation.run_figures import RunFigures, figures
from slipd.events import Tick
from slipd.recording.mcap_file import RecordingFile
from slipd.sim.truth_log import TRUTH
from slipd_client.messages import encode

QUIET = figures(ConfigRun({}))
SLIP = Truth([(2.0, 2.5)], 1.0)


def recording(path: Path, *truth: tuple[float, bytes]) -> Path:
    """A recording of ticks for 3 s, with entries of the truth."""
    file = RecordingFile(path, config_text="", boot="b", wall_minus_monotonic_ns=0)
    entries = [(t_s, None) for t_s in range(7, 11)] + [(7.0 + t_s, payload) for t_s, payload in truth]
    for n, (t_s, payload) in enumerate(sorted(entries, key=lambda entry: entry[0])):
        if payload is None:
            file.event(n, round(t_s * 1e9), Tick(n))
        else:
            file.published(n, round(t_s * 1e9), TRUTH, payload)
    file.finish(len(entries))
    return path


def entry(*, sliding: bool, utilisation: float | None = 0.5) -> bytes:
    return encode({"t_ns": 0, "sliding": sliding, "utilisation": utilisation})


def test_the_truth_counts_from_the_first_event(tmp_path: Path) -> None:
    path = recording(
        tmp_path / "a.mcap",
        (0.5, entry(sliding=False, utilisation=None)),
        (1.0, entry(sliding=True, utilisation=0.9)),
        (1.25, entry(sliding=True)),
        (1.5, entry(sliding=False)),
        (2.5, entry(sliding=True)),
    )
    assert read_truth(path) == Truth([(1.0, 1.5), (2.5, 3.0)], 0.9)


def test_a_live_run_has_none() -> None:
    assert read_truth(RECORDINGS / "demo.mcap") is None


@pytest.mark.parametrize("payload", [b"\xc1", encode({"t_ns": 0}), encode({"sliding": True, "utilisation": "high"})])
def test_what_is_no_truth_is_refused(tmp_path: Path, payload: bytes) -> None:
    with pytest.raises(RecordingError, match="entry 2 is no truth of a simulated grasp"):
        read_truth(recording(tmp_path / "a.mcap", (1.5, payload)))


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
