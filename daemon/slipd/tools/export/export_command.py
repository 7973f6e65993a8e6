"""The command ``slipd export``: recordings, replayed, as files that other programs open."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from slipd.compile_kernels import compile_kernels
from slipd.config import Config
from slipd.errors import RecordingError, SlipdError, UsageError
from slipd.io.progress import Progress
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay_dated
from slipd.tools.cli_arguments import chosen
from slipd.tools.export.frames import FrameLayout, FrameSampler, frame_layout
from slipd.tools.export.lerobot_dataset import ROBOT, lerobot_dataset
from slipd.tools.export.message_tables import LOG_TIME, Write, csv_files, parquet_tables
from slipd.tools.export.ros2_bag import ros2_bag
from slipd.tools.outputs import (
    MARK,
    SLIPD,
    Kind,
    all_complete,
    draft,
    first_bytes,
    is_recording,
    storable,
    stored_schema,
)

FORMATS: dict[str, Callable[[Path, Config], AbstractContextManager[Write]]] = {
    "ros2": ros2_bag,
    "csv": csv_files,
    "parquet": parquet_tables,
}
"""What writes each format of one recording."""

TASK = "grip an object and hold it"

Show = Callable[[int, int], None]


def export_command(
    recordings: Sequence[Path],
    out: Path,
    *,
    to: str,
    rate_hz: int | None = None,
    task: str | None = None,
    overwrite: bool = False,
) -> bool:
    """Write recordings as files for other programs.

    Args:
        recordings: The recordings; only a data set for learning takes several.
        out: The folder to create.
        to: One of `FORMATS`, or "lerobot".
        rate_hz: Frames per second, of "lerobot" alone.
        task: What the robot does, of "lerobot" alone; None: `TASK`.
        overwrite: Replace an earlier export; nothing else is ever replaced.

    Returns:
        Whether every recording is complete; if not, the export of it ends where the recording does.

    Raises:
        ConfigError: A recorded config has faults (for this version of slipd).
        SlipdError: A recording cannot be read, holds no message or is of another rig, pyarrow is not installed, or
            ``out`` cannot be written.
    """
    _check(recordings, to, rate_hz, task)
    paths = chosen(recordings) if to == "lerobot" else recordings
    opened = [open_recording(path) for path in paths]
    layout = _common_layout(opened) if to == "lerobot" else None
    progress = Progress(lambda done, of: f"{100 * done // max(of, 1)} %")
    with draft(out, EXPORT, paths, overwrite=overwrite) as written, progress.shown() as show:
        compile_kernels()
        if layout is None:
            what = f"{_messages(opened[0], written, FORMATS[to], show)} messages of slipd"
        else:
            frames = _frames(opened, written, layout, rate_hz or 1, task or TASK, show)
            what = f"{frames} frames of {'1 episode' if len(opened) == 1 else f'{len(opened)} episodes'}"
    print(f"{out}: written, {what}")
    return all_complete(opened, "export")


def _check(recordings: Sequence[Path], to: str, rate_hz: int | None, task: str | None) -> None:
    """Refuse options that do not go together."""
    if to == "lerobot":
        if rate_hz is None:
            raise UsageError("--to lerobot needs --rate HZ, the frames per second")
        return
    for option, value in (("--rate", rate_hz), ("--task", task)):
        if value is not None:
            raise UsageError(f"{option} is for --to lerobot; {to} has every message at its own time")
    if len(recordings) > 1:
        raise UsageError(f"--to {to} takes one recording, got {len(recordings)}; --to lerobot takes several")


def _messages(
    recording: Recording, out: Path, create: Callable[[Path, Config], AbstractContextManager[Write]], show: Show
) -> int:
    """Write every message of a recording; return their number."""
    settings = recording.settings()
    count = 0
    with create(out, settings) as write:
        for t_ns, topic, body in replay_dated(recording, settings):
            write(t_ns + recording.wall_minus_monotonic_ns, topic, body)
            count += 1
            show(recording.read_bytes, recording.size_bytes)
        if not count:
            raise _silent(recording)
    return count


def _frames(
    recordings: Sequence[Recording], out: Path, layout: FrameLayout, rate_hz: int, task: str, show: Show
) -> int:
    """Write every recording as an episode; return the number of frames."""
    of = sum(recording.path.stat().st_size for recording in recordings)
    with lerobot_dataset(out, layout, rate_hz, task) as dataset:
        done = 0
        for recording in recordings:
            sampler = FrameSampler(layout, rate_hz, dataset.add, str(recording.path))
            for t_ns, topic, body in replay_dated(recording, on_event=sampler.event):
                sampler.message(t_ns, topic, body)
                show(done + recording.read_bytes, of)
            sampler.finish()
            if sampler.begin_ns is None:
                raise _silent(recording)
            begin_unix_ns = sampler.begin_ns + recording.wall_minus_monotonic_ns
            dataset.end_episode(storable(recording.path.name), begin_unix_ns, task)
            done += recording.size_bytes
    return dataset.frames


def _silent(recording: Recording) -> SlipdError:
    return RecordingError(recording.fault or f"{recording.path}: holds no event that causes a message")


def _common_layout(recordings: Sequence[Recording]) -> FrameLayout:
    """Return the layout of the first recording, after a look at every other."""
    first, *others = [(recording.path, frame_layout(recording.settings())) for recording in recordings]
    for path, layout in others:
        if layout != first[1]:
            raise UsageError(
                f"{path}: its rig must have the features of {first[0]}, because one data set has one rig; "
                f"it {_difference(first[1], layout)}"
            )
    return first[1]


def _difference(first: FrameLayout, other: FrameLayout) -> str:
    wanted, got = (
        {f"{each.name} {name}" for each in layout.features for name in each.names} for layout in (first, other)
    )
    parts = [f"{word} {min(found)}" for word, found in (("lacks", wanted - got), ("adds", got - wanted)) if found]
    return " and ".join(parts) or "has them in another order"


def is_exported(path: Path) -> bool:
    """Return whether a file is one of an export, by its first bytes; a bag's metadata by its name.

    A folder is one if it belongs to a data set for learning and holds nothing else.
    """
    if path.is_dir():
        return path.name in ("meta", "data") and _of_dataset(path)
    if path.name == "metadata.yaml":
        return True
    start = first_bytes(path, 64)
    if start.startswith(b"PAR1"):
        schema = stored_schema(path, "a Parquet file that is to be replaced")
        return schema is not None and MARK.encode() in (schema.metadata or {})
    return start.startswith(f"{LOG_TIME},".encode()) or (SLIPD in start and not is_recording(path))


def _of_dataset(folder: Path) -> bool:
    """Return whether a folder of a data set holds only what slipd wrote there."""
    info = folder.parent / "meta" / "info.json"
    try:
        ours = f'"robot_type": "{ROBOT}"' in info.read_text(encoding="utf-8")[:64]
    except (OSError, ValueError):
        return False
    known = {info, info.with_name("stats.json")}
    inside = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    return ours and all(path.is_file() and (path in known or is_exported(path)) for path in inside)


EXPORT = Kind("an export of slipd", is_exported, folders=True)
