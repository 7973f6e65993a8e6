"""Draw a run as a PNG, with matplotlib."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from slipd.tools.plot.binned_track import Held, Range, Window
from slipd.tools.plot.change_log import Change
from slipd.tools.plot.chart import (
    COLOURS,
    DARK_SPANS,
    SPAN_COLOURS,
    Curve,
    Panel,
    Strip,
    StripGroup,
    stretches,
    title_of,
)
from slipd.tools.plot.report_page import GENERATOR, Report, change_lines, snapshot_note

WIDTH_IN, DPI = 12.0, 100
PANEL_IN, STRIP_IN, GAP_IN, HEAD_IN, PADS_IN = 1.25, 0.24, 0.42, 0.4, 1.6
"""Heights of the parts, inches; of the pads, of one row."""

PADS_IN_A_ROW = 6
MOST_ROWS = 2
LINE_IN = 0.2
LETTER_IN = 0.068
CAPTION_LETTERS, NOTE_LETTERS = 38, 130

STYLE: Any = {"font.size": 8.5, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 9.0}


def save(report: Report, path: Path) -> None:
    """Draw a report and write it.

    Raises:
        OSError: The file cannot be written.
    """
    shown = report.changes.snapshots[: PADS_IN_A_ROW * MOST_ROWS]
    rows = -(-len(shown) // PADS_IN_A_ROW)
    heights = [_height(part) for part in report.parts]
    course_in = sum(heights) + GAP_IN * (len(heights) + 1)
    pads_in = PADS_IN * rows + (GAP_IN if rows else 0.0)
    head_in = HEAD_IN + LINE_IN * (1 + len(report.faults))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, head_in + course_in + pads_in), dpi=DPI)
        FigureCanvasAgg(figure)
        total_in = figure.get_figheight()
        _head(figure, report, total_in)
        top_in = total_in - head_in
        for at, (part, height) in enumerate(zip(report.parts, heights, strict=True)):
            top_in -= GAP_IN + height
            axes = figure.add_axes((0.11, top_in / total_in, 0.87, height / total_in))
            axes.set_xlim(*report.window)
            axes.set_title(title_of(part), loc="left")
            _draw(axes, part, report.window)
            last = at == len(report.parts) - 1
            axes.tick_params(labelbottom=last)
            if last:
                axes.set_xlabel("time, s")
        if shown:
            note = snapshot_note(report.changes, len(shown))
            figure.text(0.02, (pads_in - 0.2) / total_in, f"Pads at each alarm: {note}", va="top", weight="bold")
            for at, change in enumerate(shown):
                row, column = divmod(at, PADS_IN_A_ROW)
                low_in = PADS_IN * (rows - 1 - row) + 0.55
                corner = (0.02 + column * 0.98 / PADS_IN_A_ROW, low_in / total_in)
                _snapshot(figure.add_axes((*corner, 0.9 / PADS_IN_A_ROW, (PADS_IN - 0.65) / total_in)), change)
        figure.savefig(path, format="png", metadata={"Software": GENERATOR})


def _height(part: Panel | StripGroup) -> float:
    return PANEL_IN if isinstance(part, Panel) else STRIP_IN * len(part.strips)


def _head(figure: Figure, report: Report, total_in: float) -> None:
    figure.text(0.02, 1.0 - 0.15 / total_in, report.title, va="top", fontsize=13, weight="bold")
    for at, (line, colour) in enumerate(
        [(" ".join(report.facts), "black"), *((fault, "#b2182b") for fault in report.faults)]
    ):
        figure.text(0.02, 1.0 - (HEAD_IN + LINE_IN * at) / total_in, line, va="top", color=colour)


def _draw(axes: Axes, part: Panel | StripGroup, window: Window) -> None:
    if isinstance(part, StripGroup):
        _strips(axes, part.strips, window)
        if part.note:
            note = textwrap.shorten(part.note, NOTE_LETTERS, placeholder=" …")
            axes.text(1.0, 1.0, note, transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5)
        return
    least, most = part.span
    axes.set_ylim(least, most)
    axes.grid(visible=True, color="#e5e5e5", linewidth=0.6)
    for limit, name in part.limits:
        axes.axhline(limit, color="#b2182b", linewidth=0.8, linestyle=":")
        axes.text(window.end_s, limit, f"{name} ", ha="right", va="bottom", color="#b2182b", fontsize=7.5)
    for curve in part.curves:
        _curve(axes, curve, most)
    if part.curves:
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=len(part.curves), frameon=False, fontsize=7.5)


def _curve(axes: Axes, curve: Curve, most: float) -> None:
    colour, label = COLOURS[curve.colour][0], curve.name
    for stretch in stretches(curve.points):
        times, low, high = _arrays(stretch)
        low, high = np.minimum(low, most), np.minimum(high, most)
        if curve.kind == "band":
            axes.fill_between(times, low, high, color=colour, alpha=0.2, linewidth=0.0, label=label)
        else:
            zigzag = np.column_stack((low, high)).ravel()
            style = "--" if curve.kind == "dashed" else "-"
            axes.plot(np.repeat(times, 2), zigzag, color=colour, linewidth=1.0, linestyle=style, label=label)
        label = "_"  # only the first stretch is in the legend


def _arrays(stretch: Sequence[Held[Range]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    times = np.array([point.begin_s for point in stretch] + [stretch[-1].end_s])
    values = np.array([point.value for point in stretch] + [stretch[-1].value])
    return times, values[:, 0], values[:, 1]


def _strips(axes: Axes, strips: Sequence[Strip], window: Window) -> None:
    axes.set_ylim(len(strips), 0)
    axes.set_yticks([at + 0.5 for at in range(len(strips))], [strip.name for strip in strips])
    axes.tick_params(axis="y", length=0)
    letter_s = LETTER_IN / (0.87 * WIDTH_IN) * (window.end_s - window.begin_s)
    for at, strip in enumerate(strips):
        bars = [(span.begin_s, span.end_s - span.begin_s) for span in strip.spans]
        colours = [SPAN_COLOURS[span.colour] for span in strip.spans]
        axes.broken_barh(bars, (at + 0.08, 0.84), facecolors=colours, linewidth=0.0)
        for span in strip.spans:
            if text := span.text_for((span.end_s - span.begin_s) / letter_s - 1.0):
                ink = "white" if span.colour in DARK_SPANS else "black"
                axes.text(span.begin_s + 0.5 * letter_s, at + 0.55, text, va="center", fontsize=7.5, color=ink)


def _snapshot(axes: Axes, change: Change) -> None:
    image = change.image
    if image is None:
        return
    rows, columns = len(image.rows), len(image.rows[0])
    axes.imshow(np.array(image.rows), extent=(0.0, columns, rows, 0.0), vmin=0.0, vmax=1.0)
    for point_m, mark in ((change.centroid_m, "+"), (change.pole_m, "o")):
        if (place := image.place(point_m)) is not None:
            axes.plot(*place, mark, color="white", markerfacecolor="none", markersize=7)
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    lines = [line for text in change_lines(change) for line in textwrap.wrap(text, CAPTION_LETTERS)]
    axes.set_xlabel("\n".join(lines), fontsize=7, loc="left")
