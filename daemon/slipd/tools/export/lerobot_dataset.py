"""A data set for learning in the format LeRobotDataset v3.0: frames in Parquet, each recording an episode.

The format is that of `lerobot.datasets` (its ``CODEBASE_VERSION`` v3.0): ``meta/info.json`` describes the features,
``meta/episodes`` has a row for each episode with its statistics, ``data`` the frames of all episodes, one by one.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from slipd.tools.export.frames import Feature, Frame, FrameLayout
from slipd.tools.outputs import parquet_file, parquet_library, parquet_rows

ROBOT = "slipd"
"""``robot_type`` of a data set, and the first key of its ``meta/info.json``."""

VERSION = "v3.0"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FILE_MB = 100
"""Size of a file of frames after which the next episode begins another one, MB, as in LeRobot."""

FILES_OF_CHUNK = 1000
COUNTERS = tuple(Feature(name, (name,), "int64") for name in ("frame_index", "episode_index", "index", "task_index"))
TIMESTAMP = Feature("timestamp", ("timestamp",))
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Names and levels of the quantiles that LeRobot keeps."""

STATS = ("min", "max", "mean", "std", "count", *QUANTILES)


EPISODES = 50
"""Episodes whose rows are written at once: with the statistics of two large pads, each takes some 100 kB."""


@contextmanager
def lerobot_dataset(folder: Path, layout: FrameLayout, rate_hz: int, task: str) -> Iterator[LerobotDataset]:
    """Create a data set, and yield what writes its frames; it has at least one episode at the end.

    Args:
        folder: Folder to create.
        layout: Features of every frame.
        rate_hz: Frames per second.
        task: What the robot does, in a sentence.

    Raises:
        SlipdError: pyarrow is not installed.
    """
    features = (*layout.features, TIMESTAMP, *COUNTERS)
    episodes = folder / "meta" / "episodes" / "chunk-000"
    episodes.mkdir(parents=True)
    with (
        parquet_rows(episodes / "file-000.parquet", _episode_schema(features), EPISODES) as add_episode,
        ExitStack() as frames,
    ):
        dataset = LerobotDataset(folder, features, rate_hz, add_episode, frames)
        yield dataset
    with parquet_rows(folder / "meta" / "tasks.parquet", _task_schema(), 1) as add_task:
        add_task({"task_index": 0, "task": task})
    stats = {name: each.summary() for name, each in dataset.stats.items()}
    for name, content in (("stats", stats), ("info", _info(dataset, layout, rate_hz))):
        text = json.dumps(content, indent=4, allow_nan=False)
        (folder / "meta" / f"{name}.json").write_text(f"{text}\n", encoding="utf-8")


class LerobotDataset:
    """Writes the frames and episodes of a data set; the frames of one episode are kept in memory.

    Args:
        folder: Its folder.
        features: Features of every frame, with time and counters.
        rate_hz: Frames per second.
        add_episode: Writes the row of an episode.
        files: Closes the last file of frames.

    Attributes:
        episodes: Number of episodes so far.
        frames: Number of frames so far, in all episodes.
        stats: Statistics of all frames, by feature.
    """

    def __init__(
        self,
        folder: Path,
        features: tuple[Feature, ...],
        rate_hz: int,
        add_episode: Callable[[dict[str, Any]], None],
        files: ExitStack,
    ) -> None:
        self.episodes = self.frames = 0
        self.stats: dict[str, FeatureStats] = {}
        self._folder, self._features, self._rate_hz = folder, features, rate_hz
        self._add_episode, self._files = add_episode, files
        self._put: Callable[[Any], None] = lambda _: None
        self._file: Path | None = None
        self._number = -1
        self._rows: dict[str, list[npt.NDArray[np.generic]]] = defaultdict(list)

    def add(self, frame: Frame) -> None:
        """Add the next frame of the present episode."""
        for name, numbers in frame.items():
            self._rows[name].append(numbers.copy())
        self.frames += 1

    def end_episode(self, recording: str, begin_unix_ns: int, task: str) -> None:
        """Write the present episode, which has a frame at least.

        Args:
            recording: Name of the recording that it comes from.
            begin_unix_ns: Time of its first frame, ns since 1970.
            task: What the robot does, in a sentence.
        """
        rows = {name: np.array(numbers) for name, numbers in self._rows.items()}
        self._rows.clear()
        number = np.arange(len(next(iter(rows.values()))))[:, None]
        first = self.frames - len(number)
        rows |= {
            "timestamp": number / self._rate_hz,
            "frame_index": number,
            "episode_index": np.full_like(number, self.episodes),
            "index": number + first,
            "task_index": np.zeros_like(number),
        }
        self._write(rows)
        stats = {name: FeatureStats.of(numbers) for name, numbers in rows.items()}
        self.stats = {name: each.with_others(self.stats.get(name)) for name, each in stats.items()}
        chunk, file = divmod(self._number, FILES_OF_CHUNK)
        self._add_episode(
            {
                "episode_index": self.episodes,
                "tasks": [task],
                "length": len(number),
                "data/chunk_index": chunk,
                "data/file_index": file,
                "dataset_from_index": first,
                "dataset_to_index": self.frames,
                "recording": recording,
                "begin_unix_ns": begin_unix_ns,
                **{f"stats/{name}/{key}": value for name, one in stats.items() for key, value in one.summary().items()},
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
        self.episodes += 1

    def _write(self, rows: dict[str, npt.NDArray[Any]]) -> None:
        """Write the frames of an episode, in the next file where the present one is full."""
        import pyarrow as arrow

        schema = _frame_schema(self._features)
        if self._file is None or self._file.stat().st_size >= FILE_MB * 1_000_000:
            self._files.close()
            self._number += 1
            chunk, file = divmod(self._number, FILES_OF_CHUNK)
            self._file = self._folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._put = self._files.enter_context(parquet_file(self._file, schema))
        arrays = []
        for each in self._features:
            numbers = arrow.array(rows[each.name].astype(each.dtype).ravel())
            arrays.append(
                numbers if len(each.names) == 1 else arrow.FixedSizeListArray.from_arrays(numbers, len(each.names))
            )
        self._put(arrow.Table.from_arrays(arrays, schema=schema))


Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FeatureStats:
    """Statistics of each number of a feature over frames; values that are not known (NaN) do not count.

    Attributes:
        frames: Number of frames.
        known: In how many each number is known, shape (numbers,).
        values: Minimum, maximum, mean, variance and `QUANTILES` of each number, shape (4 + quantiles, numbers); 0 for
            one that was never known.
    """

    frames: int
    known: Floats
    values: Floats

    @classmethod
    def of(cls, rows: npt.NDArray[Any]) -> FeatureStats:
        """Return the statistics of frames, shape (frames, numbers)."""
        numbers = rows.astype(np.float64)
        known = np.isfinite(numbers).sum(axis=0)
        numbers[:, known == 0] = 0.0
        parts = [each(numbers, axis=0) for each in (np.nanmin, np.nanmax, np.nanmean, np.nanvar)]
        return cls(len(rows), known, np.vstack((*parts, np.nanquantile(numbers, [*QUANTILES.values()], axis=0))))

    def with_others(self, others: FeatureStats | None) -> FeatureStats:
        """Return the statistics of these and other frames; the quantiles are means of theirs, as in LeRobot."""
        if others is None:
            return self
        known = self.known + others.known
        share = np.divide(self.known, known, out=np.zeros_like(self.values[0]), where=known > 0)
        values = share * self.values + (1.0 - share) * others.values
        values[3] += share * (1.0 - share) * (self.values[2] - others.values[2]) ** 2
        for row, larger in ((0, np.minimum), (1, np.maximum)):
            both = larger(self.values[row], others.values[row])
            values[row] = np.where(share == 0.0, others.values[row], np.where(share == 1.0, self.values[row], both))
        return FeatureStats(self.frames + others.frames, known, values)

    def summary(self) -> dict[str, list[float] | list[int]]:
        """Return LeRobot's statistics by name."""
        least, largest, mean, variance, *quantiles = self.values.tolist()
        found = {"min": least, "max": largest, "mean": mean, "std": np.sqrt(variance).tolist(), "count": [self.frames]}
        return found | dict(zip(QUANTILES, quantiles, strict=True))


def _frame_schema(features: tuple[Feature, ...]) -> Any:
    """Return the Arrow schema of the frames: a list of fixed length for each feature, a scalar for a single number."""
    import pyarrow as arrow

    types = {"float32": arrow.float32(), "int64": arrow.int64()}
    sized = [(each.name, types[each.dtype], len(each.names)) for each in features]
    return arrow.schema([(name, kind if size == 1 else arrow.list_(kind, size)) for name, kind, size in sized])


def _episode_schema(features: tuple[Feature, ...]) -> Any:
    arrow, _ = parquet_library("--to lerobot")
    numbers, count = arrow.list_(arrow.float64()), arrow.int64()
    places = ("length", "data/chunk_index", "data/file_index", "dataset_from_index", "dataset_to_index")
    return arrow.schema(
        {
            "episode_index": count,
            "tasks": arrow.list_(arrow.string()),
            **dict.fromkeys(places, count),
            "recording": arrow.string(),
            "begin_unix_ns": count,
            **{
                f"stats/{each.name}/{stat}": arrow.list_(count) if stat == "count" else numbers
                for each in features
                for stat in STATS
            },
            "meta/episodes/chunk_index": count,
            "meta/episodes/file_index": count,
        }
    )


def _task_schema() -> Any:
    """Return the schema of the tasks: pandas, with which LeRobot reads them, gets the tasks as the index."""
    import pyarrow as arrow

    columns = [("task_index", "int64", "int64"), ("task", "unicode", "object")]
    described = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in columns
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": described, "pandas_version": "2.0.0"}
    return arrow.schema({"task_index": arrow.int64(), "task": arrow.string()}, metadata={"pandas": json.dumps(pandas)})


def _info(dataset: LerobotDataset, layout: FrameLayout, rate_hz: int) -> dict[str, Any]:
    return {
        "robot_type": ROBOT,
        "codebase_version": VERSION,
        "fps": rate_hz,
        "total_episodes": dataset.episodes,
        "total_frames": dataset.frames,
        "total_tasks": 1,
        "chunks_size": FILES_OF_CHUNK,
        "data_files_size_in_mb": FILE_MB,
        "video_files_size_in_mb": 200,
        "data_path": DATA_PATH,
        "video_path": None,
        "splits": {"train": f"0:{dataset.episodes}"},
        "features": {each.name: _described(each, layout) for each in (*layout.features, TIMESTAMP, *COUNTERS)},
    }


def _described(feature: Feature, layout: FrameLayout) -> dict[str, Any]:
    names = list(feature.names) if feature in layout.features else None
    found: dict[str, Any] = {"dtype": feature.dtype, "shape": [len(feature.names)], "names": names}
    if feature.name in layout.pads:
        rows, cols = layout.pads[feature.name]
        found["info"] = {"rows": rows, "cols": cols}
    return found
