"""Import, replay and compare the trials of a folder."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from functools import partial
from pathlib import Path

from realgrasps.labels import Label, read_labels
from realgrasps.score import Trial, score

from slipd.recording.reader import EventGaps, open_recording
from slipd.recording.replay import replay
from slipd.tools.evaluation.config_run import level_spans
from slipd.tools.recordings.grips_import import import_trial


def measure(folder: Path, config_text: str, tare_rows: int) -> list[Trial]:
    """Import, replay and compare every trial of a folder, one process per core.

    Args:
        folder: As described in `realgrasps.__main__`.
        config_text: Config of the rig, TOML.
        tare_rows: Number of first rows with open fingers.

    Raises:
        LabelError: The labels are not as described.
        SlipdError: A trial cannot be imported or replayed.
    """
    labels = read_labels(folder)
    play = partial(_play, folder, config_text, tare_rows)
    cores = min(len(os.sched_getaffinity(0)), len(labels) // 4)
    if cores < 2:
        return [play(label) for label in labels]
    longest_first = sorted(labels, key=lambda label: -label.end_s)
    with multiprocessing.get_context("spawn").Pool(cores) as pool:
        trials = {trial.label.name: trial for trial in pool.imap_unordered(play, longest_first)}
    return [trials[label.name] for label in labels]


def _play(folder: Path, config_text: str, tare_rows: int, label: Label) -> Trial:
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / f"{label.name}.mcap"
        import_trial(folder / label.name, path, config_text, tare_rows)
        return score(label, level_spans(replay(open_recording(path)), EventGaps()))
