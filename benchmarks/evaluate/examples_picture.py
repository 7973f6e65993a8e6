"""The picture of one grasp of each family: the true utilisation, the reported one, and the reported levels."""

from __future__ import annotations

import zlib
from pathlib import Path

import matplotlib as mpl
import numpy as np
from chart.panels import FAINT, INK
from evaluate.families import FAMILIES, draw
from evaluate.playing import play, truth_of
from evaluate.reports import CAUTION, SLIPPING, STABLE, UNKNOWN, WARNING
from evaluate.running import Variant, run
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

LEVELS = {STABLE: "#CFE8D5", CAUTION: "#FBE7A1", WARNING: "#F7B267", SLIPPING: "#E4572E", UNKNOWN: "#D9D9D9"}
COLUMNS, WIDTH_IN, ROW_IN, DPI = 5, 17.0, 2.3, 90
MOST = 1.25


def save(path: Path, seed: int) -> None:
    """Draw a grasp of every family, a development seed, and write the picture."""
    rows = -(-len(FAMILIES) // COLUMNS)
    with mpl.rc_context({"font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False, "text.color": INK}):
        figure = Figure(figsize=(WIDTH_IN, ROW_IN * rows), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, COLUMNS, sharey=True)
        for panel in axes.flat[len(FAMILIES) :]:
            panel.set_axis_off()
        _legend(axes.flat[len(FAMILIES)])
        for family, panel in zip(FAMILIES, axes.flat, strict=False):
            _draw(panel, family, seed)
        figure.savefig(path)


def _legend(panel: Axes) -> None:
    """Explain lines and colours in an empty panel; there are fewer families than panels."""
    panel.plot([], [], color=INK, lw=1.1, label="true λ")
    panel.plot([], [], color="#4C78A8", lw=1.1, label="reported λ")
    panel.plot([], [], color=FAINT, lw=0.8, ls=":", label="grip force over its largest")
    panel.plot([], [], color=INK, lw=4.0, label="gross slip")
    for level, name in zip(LEVELS, ("stable", "caution", "warning", "slipping", "unknown"), strict=True):
        panel.fill_between([], [], color=LEVELS[level], label=name)
    panel.legend(loc="center", ncols=2, frameon=False, fontsize=9.5)


def _draw(panel: Axes, family: str, seed: int) -> None:
    scene = draw(family, seed)
    trace = play(scene)
    truth = truth_of(scene, trace)
    reports = run(scene, trace, Variant(), zlib.crc32(f"{family} {seed}".encode()))
    end_s = float(truth.t_s[-1])
    for span in reports.spans(end_s):
        if span.level in LEVELS:
            panel.axvspan(span.begin_s, span.end_s, color=LEVELS[span.level], lw=0.0)
    for slip in truth.episodes():
        panel.plot([slip.begin_s, slip.end_s], [1.18, 1.18], color=INK, lw=4.0, solid_capstyle="butt")
    panel.plot(reports.acquired_s, np.minimum(reports.required / truth.mu, MOST), color="#4C78A8", lw=0.7)
    panel.plot(truth.t_s, np.minimum(truth.utilisation, MOST), color=INK, lw=1.1)
    panel.plot(truth.t_s, truth.normal_n / truth.normal_n.max(), color=FAINT, lw=0.8, ls=":")
    panel.set(xlim=(0.0, end_s), ylim=(0.0, MOST))
    panel.set_title(family, loc="left", fontsize=10, pad=3)
