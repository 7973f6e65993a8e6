"""The command ``slipd plot``: one recording as a page or a picture."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from slipd import config
from slipd.compile_kernels import compile_kernels
from slipd.draft import Kind, draft
from slipd.errors import RecordingError, SlipdError
from slipd.evaluation.config_replay import with_recorded_tares
from slipd.plot.binned_track import Window
from slipd.plot.chart import chart
from slipd.plot.report_page import GENERATOR, Report, page
from slipd.plot.run_tracks import RunTracks
from slipd.progress import Progress
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay

WHOLE = Window(0.0, math.inf)
"""All of a run."""


def is_plot(path: Path) -> bool:
    """Return whether a file was written by this command, by its first bytes."""
    try:
        with path.open("rb") as file:
            start = file.read(256)
    except OSError:
        return False
    return start.startswith((b"<!doctype html>", b"\x89PNG")) and GENERATOR.encode() in start


PLOT = Kind("a plot of slipd", is_plot)


def plot_command(path: Path, out: Path | None, config_file: Path | None, window: Window = WHOLE) -> bool:
    """Replay a recording and write the picture.

    Args:
        path: The recording.
        out: The picture; it replaces an earlier one once it is complete, and nothing else. None: a page in this
            folder.
        config_file: A config to replay with; None: the recorded one.
        window: The part of the run to draw.

    Returns:
        Whether the recording is complete; if not, it is drawn as far as it goes.

    Raises:
        ConfigError: The config cannot be read or has faults.
        RecordingError: The recording cannot be read, or does not fit the config.
        SlipdError: The picture cannot be written, or matplotlib is missing for a PNG.
    """
    if not window.begin_s < window.end_s:
        raise SlipdError(f"--from {window.begin_s:g} must be before --to {window.end_s:g}")
    out = out or Path(f"{path.stem}.html")
    write = _writer(out)
    recording = open_recording(path)
    progress = Progress(lambda done, of: f"{100 * done // max(of, 1)} % replayed")
    with draft(out, PLOT, overwrite=True) as written:
        compile_kernels()
        try:
            report = make_report(recording, config_file, window, progress.show)
        finally:
            progress.erase()
        write(report, written)
    if recording.gap:
        print(f"slipd: the recording is incomplete: {recording.gap}", file=sys.stderr)
    print(f"{out}: written")
    return recording.complete


def make_report(
    recording: Recording, config_file: Path | None, window: Window, progress: Callable[[int, int], None]
) -> Report:
    """Replay a recording and return what is drawn of it.

    Args:
        recording: The recording.
        config_file: A config to replay with; None: the recorded one.
        window: The part of the run to draw.
        progress: Called with how much of the file is replayed, and its size.

    Raises:
        ConfigError: The config cannot be read or has faults.
        RecordingError: The recording has no messages in this window, or does not fit the config.
    """
    if config_file is None:
        settings = config.parse(recording.config_text, f"{recording.path}: config")
    else:
        settings = with_recorded_tares(config.load(config_file), recording)
    first = next(recording.events(), None)
    if first is None:
        raise RecordingError(recording.fault or f"{recording.path}: no events in it, so there is nothing to draw")
    tracks = RunTracks(first[0], window.begin_s)
    last_s = 0.0
    for topic, body in replay(recording, settings=settings, on_event=tracks.add_event):
        last_s = max(last_s, tracks.time_s(body))
        if last_s > window.end_s:
            break
        tracks.add(topic, body)
        progress(recording.read_bytes, recording.size_bytes)
    if tracks.window.end_s <= window.begin_s:
        raise RecordingError(f"{recording.path}: {_nothing_in(window, last_s)}")
    return Report(
        recording.path.name,
        _facts(recording, tracks, first[0], config_file, settings.config_id),
        [recording.gap] if recording.gap else [],
        tracks.window,
        chart(tracks, settings.levels),
        tracks.changes,
    )


def _nothing_in(window: Window, last_s: float) -> str:
    if last_s > window.end_s:
        return f"no two messages from {window.begin_s:g} to {window.end_s:g} s, so there is nothing to draw"
    return f"no message after {window.begin_s:g} s, the last is at {last_s:.3f} s"


def _facts(
    recording: Recording, tracks: RunTracks, begin_ns: int, config_file: Path | None, config_id: str
) -> list[str]:
    begun = datetime.fromtimestamp((begin_ns + recording.wall_minus_monotonic_ns) * 1e-9, UTC)
    recorded = f"Recorded by slipd {recording.versions.get('slipd', 'of an unknown version')}"
    begin_s, end_s = tracks.window
    shown = f"drawn from {begin_s:g} to {end_s:.1f} s" if begin_s else f"{end_s:.1f} s"
    facts = [f"{recorded} from {begun:%Y-%m-%d %H:%M:%S} UTC on; {shown}."]
    if config_file is None:
        return [*facts, f"Replayed with its own config ({config_id})."]
    other = f"Replayed with {config_file.name} ({config_id}): what slipd would have reported with that config."
    return [*facts, other, "The recorded motion stays as it was, and so does the zero of the pads."]


def _writer(out: Path) -> Callable[[Report, Path], None]:
    """Return what writes files of this kind.

    Raises:
        SlipdError: Matplotlib is missing.
    """
    if out.suffix == ".html":
        return _write_page
    try:
        from slipd.plot import chart_png  # matplotlib is in the extra "chart" only
    except ImportError as error:
        raise SlipdError(
            f"{out}: a PNG needs matplotlib: pip install 'slipd[chart]'; a file .html needs nothing"
        ) from error
    return chart_png.save


def _write_page(report: Report, path: Path) -> None:
    path.write_text(page(report), encoding="utf-8")
