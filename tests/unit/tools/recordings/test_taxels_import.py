"""Labelled trials of one pad, on made-up files in the documented formats."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slipd.cli import main
from slipd.errors import RecordingError, UsageError
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.recordings.taxels_import import read_arq, read_papillarray

EXPERIMENT = "GGCNN2/SpoolSolder/Pose1/Exp1"
SAMPLES = 180
PRESSED = np.arange(SAMPLES) >= 90


def experiment(**parts: Any) -> dict[str, Any]:
    """One second at 180 Hz: open, then pressed with 2000 counts on each taxel and a little shear."""
    values = np.tile([16000.0, 16500.0, 37000.0], (18, 1))[:, :, None] + np.zeros(SAMPLES)
    values += np.random.default_rng(1).normal(0.0, 2.0, values.shape)
    values[:, 2] += 2000.0 * PRESSED
    values[:, 1] += 200.0 * PRESSED
    labels = np.where(np.arange(SAMPLES) < 150, 0, 1)
    labels[-5:] = 5
    made = {"tactile_timestamps": 5e6 + np.arange(SAMPLES) / 0.18, "tactile_data_raw": values}
    return made | {"tactile_slips_label": labels} | parts


@pytest.fixture
def hdf5(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The content of every HDF5 file, in place of the package that reads them."""
    content: dict[str, Any] = {EXPERIMENT: experiment()}

    class File:
        def __init__(self, path: Path, mode: str) -> None:
            assert mode == "r"
            if not path.exists():
                raise FileNotFoundError(path)

        def __enter__(self) -> dict[str, Any]:
            return content

        def __exit__(self, *_: object) -> None:
            pass

    monkeypatch.setitem(sys.modules, "h5py", SimpleNamespace(File=File))
    return content


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "object.h5"
    path.touch()
    return path


def assert_pressed_at_last(path: Path) -> None:
    levels = [body["level"] for topic, body in replay(open_recording(path)) if topic == "slip.pad"]
    assert "no_contact" in levels
    assert levels[-10] == "stable"


def test_an_experiment_is_read_and_replayed(hdf5: dict[str, Any], source: Path, tmp_path: Path) -> None:
    trial = read_arq(source, EXPERIMENT)
    assert (trial.values.shape, trial.time_s[0], trial.time_s[-1]) == ((SAMPLES, 18, 3), 0.0, pytest.approx(179 / 180))
    assert np.flatnonzero(trial.slips).tolist() == list(range(150, SAMPLES))
    assert main(["import", "arq", str(source), EXPERIMENT, str(tmp_path / "out.mcap")]) == 0
    assert_pressed_at_last(tmp_path / "out.mcap")


@pytest.mark.parametrize(
    ("parts", "error"),
    [
        ({"tactile_data_raw": np.zeros((24, 3, SAMPLES))}, r"must have the shape \(18, 3, samples\)"),
        ({"tactile_slips_label": np.zeros(3)}, r"must have the shape"),
        ({"tactile_timestamps": np.arange(SAMPLES)[::-1]}, "must not decrease"),
        ({"tactile_timestamps": np.full(SAMPLES, np.nan)}, "finite numbers"),
    ],
)
def test_a_faulty_experiment_is_refused(hdf5: dict[str, Any], source: Path, parts: dict[str, Any], error: str) -> None:
    hdf5[EXPERIMENT] = experiment(**parts)
    with pytest.raises(RecordingError, match=error):
        read_arq(source, EXPERIMENT)


@pytest.mark.usefixtures("hdf5")
def test_a_missing_experiment_or_file_is_refused(source: Path, tmp_path: Path) -> None:
    for path, name in ((source, "GGCNN2/none"), (tmp_path / "none.h5", EXPERIMENT)):
        with pytest.raises(RecordingError, match="no experiment"):
            read_arq(path, name)


def test_an_hdf5_file_needs_h5py(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(UsageError, match="pip install h5py"):
        read_arq(source, EXPERIMENT)


def write_pillars(path: Path, columns: int = 73) -> None:
    """A second at 1000 Hz: pressed with 0.5 N from 0.5 s on; the pillars slip one after another from 0.8 s on."""
    rows = np.zeros((1000, columns))
    pillars = rows[:, 1:73].reshape(1000, -1, 8)
    pillars[500:, :, 0] = 1.0
    pillars[500:, :, 7] = 0.5
    pillars[500:, :, 5] = 0.05
    pillars[:, :, 5:] += np.random.default_rng(1).normal(0.0, 0.002, pillars[:, :, 5:].shape)
    for pillar in range(pillars.shape[1]):
        pillars[800 + 10 * pillar : 850 + 10 * pillar, pillar, 1] = 1.0
    rows[:, 1:73] = pillars.reshape(1000, -1)
    np.savetxt(path, rows, delimiter=",", fmt="%.6g")


def test_a_trial_of_pillars_is_read_and_replayed(tmp_path: Path) -> None:
    write_pillars(tmp_path / "trial.csv")
    trial = read_papillarray(tmp_path / "trial.csv")
    assert trial.values.shape == (1000, 9, 3)
    assert np.flatnonzero(trial.slips).tolist() == list(range(880, 1000)), "once the last pillar slipped"
    assert main(["import", "papillarray", str(tmp_path / "trial.csv"), str(tmp_path / "out.mcap")]) == 0
    assert_pressed_at_last(tmp_path / "out.mcap")


@pytest.mark.parametrize("text", ["", "1,2,3\n", "time,x\n"])
def test_a_file_without_pillars_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "trial.csv").write_text(text)
    with (
        pytest.raises(RecordingError, match=r"trial\.csv"),
        pytest.warns() if not text else pytest.MonkeyPatch.context(),
    ):
        read_papillarray(tmp_path / "trial.csv")
