"""The picture ``docs/measured/speed_accuracy.png``: what a method costs, how wrong it is, and where it fails."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from chart.model_error import ModelError
from chart.panels import COLOURS, FAINT, INK, outcomes, scaling_cost, verdicts, written
from chart.scaling import Scaling
from chart.scores import WRONG, Score
from chart.speed_accuracy import FLOOR
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter
from matplotlib.transforms import Bbox

GROUPS = {"ours": "slipd", "solver": "general solvers", "paper": "the paper's procedure", "model": "simpler models"}
WIDTH_IN, HEIGHT_IN, DPI = 16.0, 23.0, 110

TOP = 30.0
"""Errors are drawn up to here; what is beyond, or has no answer, ends in the strip above."""

NOWHERE, STRIP = 6.0 * TOP, 200.0 * TOP
"""Where in the strip, and its upper edge."""


def save(path: Path, scores: Sequence[Score], solver_s: float, scaling: Scaling, model: ModelError) -> None:
    """Draws all panels and writes the PNG."""
    with mpl.rc_context({"font.size": 11.5, "axes.spines.top": False, "axes.spines.right": False, "text.color": INK}):
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        upper, lower = figure.subfigures(2, 1, height_ratios=(14.0, 9.0))
        grid = upper.add_gridspec(
            2, 2, height_ratios=(7.6, 5.4), width_ratios=(1.62, 1.0),
            left=0.062, right=0.96, top=0.955, bottom=0.055, hspace=0.27, wspace=0.36,
        )  # fmt: skip
        _speed_accuracy(upper.add_subplot(grid[0, 0]), scores, solver_s, canvas.get_renderer())
        outcomes(upper.add_subplot(grid[0, 1]), scores)
        lines = grid[1, :].subgridspec(1, 4, width_ratios=(0.13, 1.0, 0.94, 0.10), wspace=0.27)
        verdicts(upper.add_subplot(lines[0, 1]), scores)
        scaling_cost(upper.add_subplot(lines[0, 2]), scaling)
        model.draw(lower)
        figure.savefig(path)


def _speed_accuracy(axes: Axes, scores: Sequence[Score], solver_s: float, renderer: RendererBase) -> None:
    axes.set(xscale="log", yscale="log", xlim=(1e-7, 3e-2), ylim=(FLOOR / 1e4, STRIP))
    axes.axhspan(TOP, STRIP, color="#F0F0F0", lw=0.0)
    axes.text(1.15e-7, STRIP / 2.0, "no limit, or no answer", color=FAINT, va="top")
    axes.axhline(FLOOR, color="#E6E6E6", lw=0.8, zorder=0)
    axes.axhline(WRONG, color=FAINT, lw=0.8, ls=(0, (4, 4)))
    axes.text(1.15e-7, WRONG * 1.5, "wrong above", color=FAINT)
    marks, unnamed = [], []
    for score in sorted(scores, key=lambda s: float(np.median(s.seconds))):
        if score.no_answer.all():
            continue
        name, colour, x = score.method.name, COLOURS[score.method.group], float(np.median(score.seconds))
        middle, high = _drawn(score.quantile(0.5)), _drawn(score.quantile(0.99, failures=True))
        axes.plot([x, x], [middle, high], color=colour, lw=1.6, alpha=0.75, solid_capstyle="butt")
        axes.plot(x, high, "_", color=colour, ms=8, mew=1.6)
        axes.plot(x, middle, "o", color=colour, ms=10 if score.method.group == "ours" else 7.5, mec="white", zorder=4)
        if score.method.short == "Clarabel" and math.isfinite(solver_s):
            axes.plot([solver_s, x], [middle, middle], color=colour, lw=0.8, ls=":")
            axes.plot(solver_s, middle, "o", color="white", ms=6.5, mec=colour, zorder=4)
            unnamed.append((solver_s, middle))
            name += " (○ without set-up)"
        marks.append((name, x, middle, high, colour))
    axes.set_xlabel("time of one decision", labelpad=6)
    axes.xaxis.set_major_formatter(FuncFormatter(written))
    axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2, 1.0])
    axes.set_ylabel("error of the limit, relative to the contact's own torque")
    count = scores[0].seconds.size
    axes.set_title(f"Speed against accuracy: median and p99 of {count} contacts", loc="left", fontweight="bold", pad=10)
    for k, (group, name) in enumerate(GROUPS.items()):
        axes.text(0.015, 0.42 - 0.042 * k, f"● {name}", color=COLOURS[group], transform=axes.transAxes, fontsize=12)
    _label(axes, marks, unnamed, renderer)


def _label(
    axes: Axes,
    marks: list[tuple[str, float, float, float, str]],
    unnamed: list[tuple[float, float]],
    renderer: RendererBase,
) -> None:
    """Names beside the marks, each at the first of many places where it hides nothing."""
    frame, taken = axes.get_window_extent(renderer), []
    for x, middle, high in [*((x, y, y) for x, y in unnamed), *((x, y, top) for _, x, y, top, _ in marks)]:
        (px, low), (_, up) = axes.transData.transform([(x, middle), (x, high)])
        taken += [Bbox.from_extents(px - 9, low - 9, px + 9, low + 9), Bbox.from_extents(px - 3, low, px + 3, up)]
    for name, x, middle, _, colour in marks:
        for dx, dy in _PLACES:
            far = math.hypot(dx, dy) > 15.0
            text = axes.annotate(
                name, (x, middle), (dx, dy), textcoords="offset points", color=colour, fontsize=12, va="center",
                ha="left" if dx > 1.0 else "right" if dx < -1.0 else "center",
                arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.7, "shrinkB": 5.0} if far else None,
            )  # fmt: skip
            text.update_positions(renderer)
            box = Text.get_window_extent(text, renderer).padded(6.0, 1.5)
            inside = frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1
            if inside and not any(box.overlaps(other) for other in taken):
                taken.append(box)
                break
            text.remove()


_PLACES = [
    (radius * math.cos(math.radians(way)), radius * math.sin(math.radians(way)))
    for radius in (12, 22, 34, 48, 64, 82, 102, 124)
    for way in (0, 180, -35, 35, -145, 145, -65, 65, -115, 115, -90, 90)
]
"""Offsets from the mark in points, the nearest first."""


def _drawn(error: float) -> float:
    """Where an error is drawn: within the axes, what has no size in the strip above."""
    return min(max(error, FLOOR), NOWHERE) if not math.isnan(error) else NOWHERE
