"""The command ``slipd export``: a recording, replayed, as files that other programs open."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from slipd import config
from slipd.compile_kernels import compile_kernels
from slipd.config import Config
from slipd.errors import SlipdError, UsageError
from slipd.io.progress import Progress
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay_dated
from slipd.tools.cli_arguments import chosen
from slipd.tools.draft import draft
from slipd.tools.export.csv_files import CsvFiles
from slipd.tools.export.exported import EXPORT
from slipd.tools.export.lerobot_command import TASK, export_lerobot
from slipd.tools.export.message_files import MessageFiles
from slipd.tools.export.parquet_tables import ParquetTables
from slipd.tools.export.ros2_bag import Ros2Bag
from slipd.types.device_text import printable
from slipd_client.ros.conversion import PadFrames

Create = Callable[[Path, Config], MessageFiles]

FORMATS: dict[str, Create] = {
    "ros2": lambda path, settings: Ros2Bag(path, _pads(settings)),
    "csv": lambda path, _: CsvFiles(path),
    "parquet": lambda path, _: ParquetTables(path),
}
"""What writes each format of one recording."""


class ExportOptions(NamedTuple):
    """What to write.

    Attributes:
        to: One of `FORMATS`, or "lerobot".
        rate_hz: Frames per second, of "lerobot" alone.
        task: What the robot does, of "lerobot" alone; None: `TASK`.
        overwrite: Replace an earlier export; nothing else is ever replaced.
    """

    to: str
    rate_hz: int | None = None
    task: str | None = None
    overwrite: bool = False


def export_command(recordings: Sequence[Path], out: Path, options: ExportOptions) -> bool:
    """Write recordings as files for other programs; errors are those of `export` and `export_lerobot`.

    Returns:
        Whether every recording is complete.
    """
    to, overwrite = options.to, options.overwrite
    if to == "lerobot":
        if options.rate_hz is None:
            raise UsageError("--to lerobot needs --rate HZ, the frames per second")
        return export_lerobot(chosen(recordings), out, options.rate_hz, options.task or TASK, overwrite=overwrite)
    for option, value in (("--rate", options.rate_hz), ("--task", options.task)):
        if value is not None:
            raise UsageError(f"{option} is for --to lerobot; {to} has every message at its own time")
    if len(recordings) > 1:
        raise UsageError(f"--to {to} takes one recording, got {len(recordings)}; --to lerobot takes several")
    return export(recordings[0], out, to, overwrite=overwrite)


def export(path: Path, out: Path, to: str, *, overwrite: bool) -> bool:
    """Write the messages that a recording gives with today's slipd.

    Args:
        path: The recording.
        out: The file or folder to create.
        to: One of `FORMATS`.
        overwrite: Replace an earlier export; nothing else is ever replaced.

    Returns:
        Whether the recording is complete; if not, the export ends where the recording does.

    Raises:
        ConfigError: The recorded config has faults (for this version of slipd).
        SlipdError: The recording cannot be read or holds no message, or ``out`` cannot be written.
    """
    recording = open_recording(path)
    settings = config.parse(recording.config_text, f"{path}: config")
    create = FORMATS[to]
    compile_kernels()
    progress = Progress(lambda done, of: f"{100 * done // max(of, 1)} %")
    try:
        with (
            draft(out, EXPORT, [path], overwrite=overwrite) as written,
            contextlib.closing(create(written, settings)) as files,
        ):
            count = _write(recording, settings, files, progress.show)
            if not count:
                raise SlipdError(recording.fault or f"{path}: holds no event that causes a message")
            files.finish()
    finally:
        progress.erase()
    print(f"{out}: written, {count} messages of slipd")
    if not recording.complete:
        print(f"slipd: the export is incomplete: {printable(recording.gap)}", file=sys.stderr)
    return recording.complete


def _write(recording: Recording, settings: Config, files: MessageFiles, progress: Callable[[int, int], None]) -> int:
    """Write every message; return their number."""
    count = 0
    for t_ns, topic, body in replay_dated(recording, settings):
        files.write(t_ns + recording.wall_minus_monotonic_ns, topic, body)
        count += 1
        progress(recording.read_bytes, recording.size_bytes)
    return count


def _pads(settings: Config) -> PadFrames | None:
    if settings.grasp is None:
        return None
    return PadFrames({finger: pad.model_dump() for finger, pad in settings.grasp.pads.items()})
