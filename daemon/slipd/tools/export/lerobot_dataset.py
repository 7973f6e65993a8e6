"""A data set for learning in the format LeRobotDataset v3.0: frames in Parquet, each recording an episode.

The format is that of `lerobot.datasets` (its ``CODEBASE_VERSION`` v3.0): ``meta/info.json`` describes the features,
``meta/episodes`` has a row for each episode with its statistics, ``data`` the frames of all episodes, one by one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from slipd.tools.export.dataset_tables import EpisodeTable, frame_schema, frame_table, write_tasks
from slipd.tools.export.exported import ROBOT
from slipd.tools.export.feature_stats import FeatureStats
from slipd.tools.export.frame_layout import Feature, FrameLayout
from slipd.tools.export.frame_sampler import Frame
from slipd.tools.export.parquet_file import ParquetFile

VERSION = "v3.0"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FILE_MB = 100
"""Size of a file of frames after which the next episode begins another one, MB, as in LeRobot."""

FILES_OF_CHUNK = 1000
BLOCK = 4096
"""Frames that are written at once: some megabytes with the taxels of two pads."""

COUNTERS = tuple(Feature(name, (name,), whole=True) for name in ("frame_index", "episode_index", "index", "task_index"))
TIMESTAMP = Feature("timestamp", ("timestamp",))


class LerobotDataset:
    """Writes a data set.

    Args:
        folder: Folder to create.
        layout: Features of every frame.
        rate_hz: Frames per second.
        task: What the robot does, in a sentence.

    Raises:
        SlipdError: pyarrow is not installed.
    """

    def __init__(self, folder: Path, layout: FrameLayout, rate_hz: int, task: str) -> None:
        self._features = (*layout.features, TIMESTAMP, *COUNTERS)
        self._schema = frame_schema(self._features)
        self._layout = layout
        self._folder = folder
        self._rate_hz = rate_hz
        self._task = task
        (folder / "meta").mkdir(parents=True)
        self._file: ParquetFile | None = None
        self._files = -1
        self._block = {each.name: np.empty((BLOCK, len(each.names)), each.dtype) for each in self._features}
        self._used = 0
        self._frames = self._before = 0
        self._stats = _stats(self._features)
        self._of_episode = _stats(self._features)
        self._episodes = EpisodeTable(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet", self._features)

    def add(self, frame: Frame) -> None:
        """Write the next frame of the present episode."""
        if self._frames == self._before:
            self._begin_episode()
        at, in_episode = self._used, self._frames - self._before
        for name, numbers in frame.items():
            self._block[name][at] = numbers
        self._block["timestamp"][at] = in_episode / self._rate_hz
        for name, count in zip(
            ("frame_index", "episode_index", "index", "task_index"),
            (in_episode, self._episodes.count, self._frames, 0),
            strict=True,
        ):
            self._block[name][at] = count
        self._frames += 1
        self._used += 1
        if self._used == BLOCK:
            self._flush()

    def end_episode(self, recording: str, begin_unix_ns: int) -> int:
        """End the present episode; return the number of its frames.

        Args:
            recording: Name of the recording that it comes from.
            begin_unix_ns: Time of its first frame, ns since 1970.
        """
        frames = self._frames - self._before
        if not frames:
            return 0
        self._flush()
        chunk, file = divmod(self._files, FILES_OF_CHUNK)
        row = {
            "tasks": [self._task],
            "length": frames,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": self._before,
            "dataset_to_index": self._frames,
            "recording": recording,
            "begin_unix_ns": begin_unix_ns,
        }
        self._episodes.add(row, {name: stats.summary() for name, stats in self._of_episode.items()})
        self._before, self._of_episode = self._frames, _stats(self._features)
        return frames

    def finish(self) -> None:
        """Complete the data set and close its files; it has at least one episode."""
        if self._file is not None:
            self._file.finish()
        self._episodes.finish()
        meta = self._folder / "meta"
        write_tasks(meta / "tasks.parquet", [self._task])
        _write_json(meta / "stats.json", {name: stats.summary() for name, stats in self._stats.items()})
        _write_json(meta / "info.json", self._info())

    def close(self) -> None:
        """Close the files as they are; does nothing after `finish`."""
        if self._file is not None:
            self._file.close()
        self._episodes.close()

    def _begin_episode(self) -> None:
        """Open the next file of frames where the present one is full."""
        if self._file is not None:
            if self._file.path.stat().st_size < FILE_MB * 1_000_000:
                return
            self._file.finish()
        self._files += 1
        chunk, file = divmod(self._files, FILES_OF_CHUNK)
        path = self._folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = ParquetFile(path, self._schema)

    def _flush(self) -> None:
        if not self._used or self._file is None:
            return
        block: dict[str, npt.NDArray[Any]] = {name: rows[: self._used] for name, rows in self._block.items()}
        self._file.write(frame_table(self._schema, block))
        for name, rows in block.items():
            numbers = rows.astype(np.float64)
            self._stats[name].add(numbers)
            self._of_episode[name].add(numbers)
        self._used = 0

    def _info(self) -> dict[str, Any]:
        return {
            "robot_type": ROBOT,
            "codebase_version": VERSION,
            "fps": self._rate_hz,
            "total_episodes": self._episodes.count,
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": FILES_OF_CHUNK,
            "data_files_size_in_mb": FILE_MB,
            "video_files_size_in_mb": 200,
            "data_path": DATA_PATH,
            "video_path": None,
            "splits": {"train": f"0:{self._episodes.count}"},
            "features": {each.name: self._described(each) for each in self._features},
        }

    def _described(self, feature: Feature) -> dict[str, Any]:
        ours = feature in self._layout.features
        found: dict[str, Any] = {
            "dtype": feature.dtype,
            "shape": [len(feature.names)],
            "names": list(feature.names) if ours else None,
        }
        if feature.name in self._layout.pads:
            rows, cols = self._layout.pads[feature.name]
            found["info"] = {"rows": rows, "cols": cols}
        return found


def _stats(features: tuple[Feature, ...]) -> dict[str, FeatureStats]:
    return {each.name: FeatureStats(len(each.names)) for each in features}


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=4, allow_nan=False) + "\n", encoding="utf-8")
