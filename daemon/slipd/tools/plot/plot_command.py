"""The command ``slipd plot``: one recording, or two side by side, as a self-contained page, dark and light.

A recording of a run holds what the run published, and that is drawn: a replay takes twenty times as long. The recording
is replayed where it holds no verdicts that this version can draw, and for another config.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import msgpack

from slipd import config
from slipd.config import Levels
from slipd.errors import RecordingError, UsageError
from slipd.io.progress import Progress
from slipd.recording.reader import Recording, open_recording
from slipd.tools.evaluation.config_run import with_recorded_tares
from slipd.tools.outputs import Kind, draft, first_bytes
from slipd.tools.plot.binned_track import Window
from slipd.tools.plot.chart import COLOURS, SPAN_COLOURS, chart
from slipd.tools.plot.chart_svg import chart_svg, snapshot_svg
from slipd.tools.plot.pad_picture import CENTROID, POLE
from slipd.tools.plot.run_tracks import MOST_CHANGES, Change, ChangeLog, FingerTracks, RunTracks
from slipd.types.device_text import printable
from slipd_client.live_view_parts import UNKNOWN

GENERATOR = "slipd plot"
"""What a page names as its program."""

NOT_DRAWABLE = (KeyError, TypeError, ValueError)
"""Errors of a message without the fields, or not of the kinds, that are drawn."""


def is_plot(path: Path) -> bool:
    """Return whether a file was written by this command, by its first bytes."""
    start = first_bytes(path, 256)
    return start.startswith(b"<!doctype html>") and GENERATOR.encode() in start


PLOT = Kind("a plot of slipd", is_plot)


class DrawnRun(NamedTuple):
    """What a page shows of a run.

    Attributes:
        name: Name of the recording.
        facts: What it is, in sentences.
        fault: Why it is not complete; "" for a complete one.
        tracks: What the run reported.
        levels: The thresholds in force.
    """

    name: str
    facts: Sequence[str]
    fault: str
    tracks: RunTracks
    levels: Levels


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
        written.write_text(page(runs), encoding="utf-8")
    for recording in recordings:
        if recording.gap:
            print(f"slipd: the recording is incomplete: {printable(recording.gap)}", file=sys.stderr)
    print(f"{out}: written")
    return all(recording.complete for recording in recordings)


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
    return DrawnRun(recording.path.name, facts, recording.gap, tracks, settings.levels)


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


def page(runs: Sequence[DrawnRun]) -> str:
    """Return the page of one run, or of two side by side on one time axis, as HTML."""
    title = escape(" · ".join(run.name for run in runs))
    ends_s = max(run.tracks.window.end_s for run in runs)
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta name="generator" content="{GENERATOR}">',
            f"<title>{title} · slipd</title>",
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            # a page from a file may ask nobody for anything
            """<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">""",
            f"<style>{_STYLE}{_curve_styles()}</style></head>",
            f'<body class="runs{len(runs)}">',
            *(line for run in runs for line in _section(run, run.tracks.window._replace(end_s=ends_s))),
            "</body></html>\n",
        ]
    )


def _section(run: DrawnRun, window: Window) -> Iterator[str]:
    yield f"<section><h1>{escape(run.name)}</h1>"
    if run.fault:
        yield f'<p class="fault">{escape(run.fault)}</p>'
    yield from (f"<p>{escape(fact)}</p>" for fact in run.facts)
    yield chart_svg(chart(run.tracks, run.levels), window)
    yield from _snapshots(run.tracks.changes)
    yield from _changes(run.tracks.changes)
    yield "</section>"


def _snapshots(log: ChangeLog) -> Iterator[str]:
    if not log.alarms:
        yield "<h2>Alarms</h2><p>No finger rose to “warning” or “slipping”.</p>"
        return
    yield "<h2>Pads at each alarm</h2>"
    count, shown = "1 alarm" if log.alarms == 1 else f"{log.alarms} alarms", len(log.snapshots)
    if not shown:
        yield f"<p>{count}, of which none has an image of its pad.</p>"
        return
    note = f"{count}." if shown == log.alarms else f"{count}; the first {shown} with an image are shown."
    yield f"<p>{note} X points right, Y up; + is the contact centroid, ○ the pole.</p>"
    yield '<div class="pads">'
    for change, image in log.snapshots:
        marks = ((CENTROID, change.verdict.get("centroid_m")), (POLE, change.verdict.get("pole_m")))
        yield f"<figure>{snapshot_svg(image, marks)}<figcaption>{_caption(change)}</figcaption></figure>"
    yield "</div>"


def _caption(change: Change) -> str:
    """Return a change of level in two lines: what changed, and why."""
    body = change.warning
    used = "" if body["utilisation"] is None else f", λ {body['utilisation']:.2f}"
    moves = f"; moves by {', '.join(body['evidence'])}" if body["evidence"] else ""
    why = (", ".join(body["reasons"]) or "no reasons") + moves
    what = f"{change.t_s:.3f} s {body['finger']}: {body['level']}{used}"
    return f"{escape(what)}<br>{escape(why)}"


def _changes(log: ChangeLog) -> Iterator[str]:
    yield "<h2>Changes of level</h2>"
    if not log.count:
        yield "<p>None.</p>"
        return
    if log.count > len(log.changes):
        yield f"<p>{log.count} changes, of which the first {MOST_CHANGES} are listed.</p>"
    heads = ("time, s", "finger", "from", "to", "λ", "reasons", "evidence")
    yield f"<table><tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"
    for each in log.changes:
        body = each.warning
        used = UNKNOWN if body["utilisation"] is None else f"{body['utilisation']:.3f}"
        words = ", ".join(body["reasons"]), ", ".join(body["evidence"])
        cells = map(escape, (body["finger"], body["previous"], body["level"], used, *words))
        level = f'<td class="level" style="border-left-color:{SPAN_COLOURS[body["level"]]}">'
        row = "".join(f"{level if at == 2 else '<td>'}{cell}</td>" for at, cell in enumerate(cells))
        yield f'<tr><td class="number">{each.t_s:.3f}</td>{row}</tr>'
    yield "</table>"


def _curve_styles() -> str:
    light = "".join(f"--{name}:{on_white};" for name, (on_white, _) in COLOURS.items())
    dark = "".join(f"--{name}:{on_black};" for name, (_, on_black) in COLOURS.items())
    classes = "".join(
        f".line.{name},.dashed.{name}{{stroke:var(--{name})}}.band.{name}{{fill:var(--{name})}}" for name in COLOURS
    )
    return f":root{{{light}}}@media(prefers-color-scheme:dark){{:root{{{dark}}}}}{classes}"


_STYLE = """
:root{--paper:#fff;--ink:#1b1b1b;--faint:#666;--rule:#ddd;--ground:#f6f6f6;--fault:#b2182b}
@media(prefers-color-scheme:dark){
:root{--paper:#16181b;--ink:#e8e8e8;--faint:#a5a5a5;--rule:#3a3d42;--ground:#1e2125;--fault:#ff7b7b}
}
body{margin:1.5rem auto;max-width:1200px;padding:0 1rem;background:var(--paper);color:var(--ink)}
body{font:15px/1.45 sans-serif}
@media(min-width:1400px){.runs2{max-width:2400px;display:grid;grid-template-columns:1fr 1fr;gap:2rem}}
section{min-width:0}
h1{font-size:1.4rem;overflow-wrap:anywhere}
h2{font-size:1.1rem;margin-top:2rem}
p{margin:.3rem 0}
.fault{color:var(--fault);font-weight:bold}
svg text{font:12px sans-serif;fill:var(--ink)}
svg .title{font-weight:bold}
svg .small{font-size:11px;fill:var(--faint)}
svg .small.dark{fill:#111}
svg .small.light{fill:#fff}
svg .end{text-anchor:end}
svg .middle{text-anchor:middle}
.chart{width:100%;height:auto;margin-top:1rem}
.ground{fill:var(--ground)}
.grid,.tick{stroke:var(--rule);fill:none}
.limit{stroke:var(--fault);stroke-dasharray:2 3;fill:none}
.line,.dashed{fill:none;stroke-width:1.3}
.dashed{stroke-dasharray:5 3}
.band{stroke:none;opacity:.22}
.mark{fill:none;stroke:#fff;stroke-width:2;filter:drop-shadow(0 0 1px #000)}
.rest{fill:#3b2a55}
.load{fill:#fde725}
.pads{display:flex;flex-wrap:wrap;gap:1rem}
figure{margin:0;max-width:260px}
figure svg{max-width:100%;height:auto}
figcaption{font-size:12px;color:var(--faint)}
table{border-collapse:collapse;font-size:13px}
td,th{padding:.15rem .7rem;text-align:left;border-bottom:1px solid var(--rule)}
.number{text-align:right;font-variant-numeric:tabular-nums}
.level{border-left:6px solid}
"""
