"""The picture ``docs/time.png`` and the words beside it."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from chart import clocks, skew
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

WIDTH_IN, HEIGHT_IN, DPI = 16.0, 15.0, 110

TEXT = """![Error of the times of acquisition; error of the slip decision by the skew of a scan](time.png)

Two questions. How accurate is the acquisition time if a device has a clock of its own? What is gained by correcting
all taxels of a scan to one instant?

- **Top**: error of the estimated time over time, one stream each. The band is slipd's bound. Times of receipt are late
  by all delays between sensor and daemon: polls, a busy line, a stalled event loop. Resets and stalls are visible.
- **Bottom**: error of utilisation, torque limit and tipping margin against the true contact, over the relative change
  of the force while the pad is scanned."""


def save(path: Path, runs: dict[str, clocks.Run], skewed: skew.Skew) -> None:
    """Draws both parts and writes the PNG."""
    with mpl.rc_context({"font.size": 11.5, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI)
        FigureCanvasAgg(figure)
        upper, lower = figure.subfigures(2, 1, height_ratios=(10.0, 5.0))
        clocks.draw(runs, upper)
        skewed.draw(lower)
        figure.savefig(path)
