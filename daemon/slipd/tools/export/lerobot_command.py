"""``slipd export --to lerobot``: recordings of one rig, replayed, as one data set for learning."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path

from slipd import config
from slipd.compile_kernels import compile_kernels
from slipd.config import Config
from slipd.errors import SlipdError
from slipd.io.progress import Progress
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay_dated
from slipd.tools.draft import draft
from slipd.tools.export.exported import EXPORT
from slipd.tools.export.frame_layout import FrameLayout, frame_layout
from slipd.tools.export.frame_sampler import FrameSampler
from slipd.tools.export.lerobot_dataset import LerobotDataset
from slipd.tools.parquet_library import storable
from slipd.types.device_text import printable

TASK = "grip an object and hold it"


def export_lerobot(paths: Sequence[Path], out: Path, rate_hz: int, task: str = TASK, *, overwrite: bool) -> bool:
    """Write a data set in which each recording is an episode.

    Args:
        paths: The recordings.
        out: The folder to create.
        rate_hz: Frames per second.
        task: What the robot does, in a sentence.
        overwrite: Replace an earlier export; nothing else is ever replaced.

    Returns:
        Whether every recording is complete; if not, its episode ends where the recording does.

    Raises:
        ConfigError: A recorded config has faults (for this version of slipd).
        SlipdError: A recording cannot be read, holds no message or is of another rig, pyarrow is not installed, or
            ``out`` cannot be written.
    """
    layout = _common_layout(paths)
    compile_kernels()
    faults = []
    progress = _BytesRead(paths)
    try:
        with (
            draft(out, EXPORT, paths, overwrite=overwrite) as written,
            contextlib.closing(LerobotDataset(written, layout, rate_hz, task)) as dataset,
        ):
            frames = 0
            for path in paths:
                recording = open_recording(path)
                frames += _add_episode(dataset, recording, FrameSampler(layout, rate_hz, dataset.add), progress)
                if not recording.complete:
                    faults.append(recording.gap)
            dataset.finish()
    finally:
        progress.erase()
    count = "1 episode" if len(paths) == 1 else f"{len(paths)} episodes"
    print(f"{out}: written, {frames} frames of {count}")
    for fault in faults:
        print(f"slipd: the export is incomplete: {printable(fault)}", file=sys.stderr)
    return not faults


class _BytesRead:
    """Progress over several recordings."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._of = sum(path.stat().st_size for path in paths)
        self._done = 0
        self._progress = Progress(lambda done, of: f"{100 * done // max(of, 1)} %")

    def show(self, of_recording: int) -> None:
        self._progress.show(self._done + of_recording, self._of)

    def next(self, size: int) -> None:
        self._done += size

    def erase(self) -> None:
        self._progress.erase()


def _add_episode(dataset: LerobotDataset, recording: Recording, sampler: FrameSampler, progress: _BytesRead) -> int:
    """Write the frames of a recording; return their number."""

    def note(t_ns: int) -> None:
        try:
            sampler.event(t_ns)
        except SlipdError as error:
            raise SlipdError(f"{recording.path}: {error}") from None

    for t_ns, topic, body in replay_dated(recording, on_event=note):
        sampler.message(t_ns, topic, body)
        progress.show(recording.read_bytes)
    sampler.finish()
    progress.next(recording.size_bytes)
    if sampler.begin_ns is None:
        raise SlipdError(recording.fault or f"{recording.path}: holds no event that causes a message")
    name = storable(recording.path.name)
    return dataset.end_episode(name, sampler.begin_ns + recording.wall_minus_monotonic_ns)


def _common_layout(paths: Sequence[Path]) -> FrameLayout:
    """Return the layout of the first recording, after a look at the start of every other."""
    first = frame_layout(_settings(paths[0]))
    for path in paths[1:]:
        other = frame_layout(_settings(path))
        if other != first:
            raise SlipdError(
                f"{path}: its rig must have the features of {paths[0]}, because one data set has one rig; "
                f"it {_difference(first, other)}"
            )
    return first


def _difference(first: FrameLayout, other: FrameLayout) -> str:
    wanted = {f"{each.name} {name}" for each in first.features for name in each.names}
    got = {f"{each.name} {name}" for each in other.features for name in each.names}
    lacks, adds = sorted(wanted - got), sorted(got - wanted)
    parts = [f"{word} {found[0]}" for word, found in (("lacks", lacks), ("adds", adds)) if found]
    return " and ".join(parts) or "has them in another order"


def _settings(path: Path) -> Config:
    return config.parse(open_recording(path).config_text, f"{path}: config")
