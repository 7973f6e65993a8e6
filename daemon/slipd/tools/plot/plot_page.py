"""The page of one run, or of two side by side: self-contained, without scripts, readable dark and light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from slipd.config import Levels
from slipd.tools.plot.binned_track import Window
from slipd.tools.plot.chart import COLOURS, SPAN_COLOURS, chart
from slipd.tools.plot.chart_svg import chart_svg, snapshot_svg
from slipd.tools.plot.run_tracks import MOST_CHANGES, Change, ChangeLog, RunTracks
from slipd_client.live_view import change_reasons
from slipd_client.terminal import UNKNOWN

GENERATOR = "slipd plot"
"""What a page names as its program."""


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
        yield f"<figure>{snapshot_svg(image, change.verdict)}<figcaption>{_caption(change)}</figcaption></figure>"
    yield "</div>"


def _caption(change: Change) -> str:
    """Return a change of level in two lines: what changed, and why."""
    body = change.warning
    used = "" if body["utilisation"] is None else f", λ {body['utilisation']:.2f}"
    what = f"{change.t_s:.3f} s {body['finger']}: {body['level']}{used}"
    return f"{escape(what)}<br>{escape(change_reasons(dict(body)) or 'no reasons')}"


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
