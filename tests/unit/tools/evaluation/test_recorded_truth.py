"""What truly happened in the recording of a simulated grasp."""

from __future__ import annotations

from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.errors import RecordingError
from slipd.events import Tick
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.tools.evaluation.config_run import Truth
from slipd.tools.evaluation.recorded_truth import outline
from slipd.tools.sim.truth_log import TRUTH
from slipd_client.messages import encode


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
    assert outline(open_recording(path)).truth == Truth([(1.0, 1.5), (2.5, 3.0)], 0.9)


def test_a_live_run_has_none() -> None:
    assert outline(open_recording(RECORDINGS / "demo.mcap")).truth is None


@pytest.mark.parametrize("payload", [b"\xc1", encode({"t_ns": 0}), encode({"sliding": True, "utilisation": "high"})])
def test_what_is_no_truth_is_refused(tmp_path: Path, payload: bytes) -> None:
    with pytest.raises(RecordingError, match="entry 2 is no truth of a simulated grasp"):
        outline(open_recording(recording(tmp_path / "a.mcap", (1.5, payload))))


def test_a_recording_lasts_from_its_first_event_to_its_last(tmp_path: Path) -> None:
    assert outline(open_recording(recording(tmp_path / "a.mcap"))) == (7.0, 10.0, None)


def test_a_recording_without_events_has_no_length(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", config_text="", boot="b", wall_minus_monotonic_ns=0)
    file.finish(0)
    assert outline(open_recording(tmp_path / "a.mcap")) == (0.0, 0.0, None)
