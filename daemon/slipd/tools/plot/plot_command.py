"""The command ``slipd plot``: one recording, or two side by side, as a self-contained page, dark and light.

A recording of a run holds what the run published, and that is drawn: a replay takes twenty times as long. The recording
is replayed where it holds no verdicts that this version can draw, and for another config.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgpack

from slipd import config
from slipd.errors import RecordingError, UsageError
from slipd.io.progress import Progress
from slipd.recording.reader import Recording, open_recording
from slipd.tools.evaluation.config_run import with_recorded_tares
from slipd.tools.outputs import Kind, all_complete, draft, first_bytes
from slipd.tools.plot.binned_track import Window
from slipd.tools.plot.plot_page import GENERATOR, DrawnRun, page
from slipd.tools.plot.run_tracks import FingerTracks, RunTracks

NOT_DRAWABLE = (KeyError, TypeError, ValueError)
"""Errors of a message without the fields, or not of the kinds, that are drawn."""


def is_plot(path: Path) -> bool:
    """Return whether a file was written by this command, by its first bytes."""
    start = first_bytes(path, 256)
    return start.startswith(b"<!doctype html>") and GENERATOR.encode() in start


PLOT = Kind("a plot of slipd", is_plot)


def plot_command(
    path: Path, beside: Path | None, out: Path | None, config_file: Path | None, begin_s: float, end_s: float
) -> bool:
    """Read or replay a recording, and write the page.

    Args:
        path: The recording.
        beside: Another one, drawn beside it as its run reported it; None: there is none.
        out: The page; it replaces an earlier one once it is complete, and nothing else. None: in this folder.
        config_file: A config to replay with; None: what the run itself published is drawn.
        begin_s: Draw from this time of the run on, s.
        end_s: Draw up to this time, s.

    Returns:
        Whether the recordings are complete; if not, they are drawn as far as they go.

    Raises:
        ConfigError: The config cannot be read or has faults.
        RecordingError: The recording cannot be read, or does not fit the config.
        SlipdError: The page cannot be written.
    """
    if not begin_s < end_s:
        raise UsageError(f"--from {begin_s:g} must be before --to {end_s:g}")
    out = out or Path(f"{path.stem}.html")
    recordings = [open_recording(each) for each in (path, beside) if each is not None]
    progress = Progress(lambda done, of: f"{100 * done // max(of, 1)} % of the recording")
    inputs = [each for each in (path, beside, config_file) if each is not None]
    with draft(out, PLOT, inputs, overwrite=True) as written:
        with progress.shown() as show:
            configs = (config_file, None)
            runs = [read_run(*each, Window(begin_s, end_s), show) for each in zip(recordings, configs, strict=False)]
        written.write_text(page(runs), encoding="utf-8", errors="backslashreplace")  # a file name may be no UTF-8
    print(f"{out}: written")
    return all_complete(recordings)


def read_run(
    recording: Recording, config_file: Path | None, window: Window, progress: Callable[[int, int], None]
) -> DrawnRun:
    """Return what a recording shows.

    Args:
        recording: The recording.
        config_file: A config to replay with; None: what the run itself published is drawn.
        window: The part of the run to draw.
        progress: Called with how much of the file is read, and its size.

    Raises:
        ConfigError: The config cannot be read or has faults.
        RecordingError: The recording has no messages in this window, or does not fit the config.
    """
    settings = recording.settings()
    if config_file is not None:
        settings = with_recorded_tares(config.load(config_file), settings)
    first = next(recording.events(), None)
    if first is None:
        raise RecordingError(recording.fault or f"{recording.path}: no events in it, so there is nothing to draw")
    tracks = RunTracks(first[0], window.begin_s)
    last_s = 0.0
    replayed = config_file is not None or not _holds_verdicts(recording)
    if replayed:
        from slipd.compile_kernels import compile_kernels
        from slipd.recording.replay import replay

        compile_kernels()
        messages = replay(recording, settings=settings, on_event=tracks.add_event)
    else:
        messages = _published(recording, tracks.add_event)
    try:
        for topic, body in messages:
            last_s = max(last_s, tracks.gaps.time_s(body["t_ns"]))
            if last_s > window.end_s:
                break
            tracks.add(topic, body)
            progress(recording.read_bytes, recording.size_bytes)
    except NOT_DRAWABLE as error:
        if replayed:
            raise
        raise RecordingError(
            f"{recording.path}: holds a message that slipd cannot have published: {error!r}"
        ) from error
    if tracks.window.end_s <= window.begin_s:
        none = f"no two messages from {window.begin_s:g} to {window.end_s:g} s, so there is nothing to draw"
        early = f"no message after {window.begin_s:g} s, the last is at {last_s:.3f} s"
        raise RecordingError(f"{recording.path}: {none if last_s > window.end_s else early}")
    if config_file is not None:
        source = (
            f"Replayed with {config_file.name} ({settings.config_id}): what slipd would have reported with that "
            "config. The recorded motion stays as it was, and so does the zero of the pads."
        )
    else:
        shown = "Replayed with its own config" if replayed else "As the run itself reported it, with its own config"
        source = f"{shown} ({settings.config_id})."
    facts = [_recorded(recording, tracks, first[0]), source]
    return DrawnRun(recording.path.name, facts, recording.missing, tracks, settings.levels)


def _holds_verdicts(recording: Recording) -> bool:
    """Return whether a recording holds verdicts that can be drawn: an import has none, an old one may lack fields."""
    for topic, payload in recording.messages():
        if topic.startswith("slip."):
            try:
                FingerTracks().add(0.0, msgpack.unpackb(payload))
            except NOT_DRAWABLE:
                return False
            return True
    return False


def _published(recording: Recording, on_event: Callable[[int], object]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the messages that a run published, but not those of topics that are not drawn.

    Their fields are not checked one by one, which would take longer than the rest of the plot.
    """
    for topic, payload in recording.messages(on_event):
        if not topic.startswith("wrench."):
            yield topic, msgpack.unpackb(payload)


def _recorded(recording: Recording, tracks: RunTracks, begin_ns: int) -> str:
    begun = datetime.fromtimestamp((begin_ns + recording.wall_minus_monotonic_ns) * 1e-9, UTC)
    version = recording.versions.get("slipd", "of an unknown version")
    begin_s, end_s = tracks.window
    shown = f"drawn from {begin_s:g} to {end_s:.1f} s" if begin_s else f"{end_s:.1f} s"
    return f"Recorded by slipd {version} from {begun:%Y-%m-%d %H:%M:%S} UTC on; {shown}."
