"""The panels beside the first: outcomes and verdicts as bars, cost against taxels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from chart.methods import find
from chart.scaling import Scaling
from chart.scores import WRONG_TOLD, Score
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

COLOURS = {"ours": "#0072B2", "solver": "#D55E00", "paper": "#AA4499", "model": "#009E73"}
"""Of the groups of methods; told apart with every kind of colour vision."""

RIGHT, WRONG_ONE, MISSING = "#A9CCE3", "#C0392B", "#C9C9C9"
INK, FAINT = "#222222", "#777777"
NEXT_LINE = 1.75
"""Two names at the end of curves are apart by this factor of time."""

LABELLED = 4.0
"""Shares above this, in %, have room for their number."""


def written(seconds: float, _: object = None) -> str:
    """A time with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.999 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def outcomes(axes: Axes, scores: Sequence[Score]) -> None:
    """Shares of right, wrong and missing limits."""
    _names(axes, scores)
    for row, score in enumerate(scores):
        left = 0.0
        good = ~(score.wrong | score.no_answer)
        for part, colour, ink in (
            (good, RIGHT, INK),
            (score.wrong, WRONG_ONE, "white"),
            (score.no_answer, MISSING, INK),
        ):
            share = 100.0 * float(np.mean(part))
            axes.barh(row, share, left=left, color=colour, height=0.74)
            if share > LABELLED:
                axes.text(left + share / 2.0, row, f"{share:.0f}", ha="center", va="center", color=ink, fontsize=10.5)
            left += share
        if 0.0 < (bad := 100.0 * float(np.mean(~good))) <= LABELLED:
            axes.text(99.0 - bad, row, _percent(bad), va="center", ha="right", color=WRONG_ONE, fontsize=10.5)
    axes.set(xlim=(0.0, 100.0), xlabel="% of the contacts")
    _heading(axes, "The limit", (("right", RIGHT), (f"wrong by > {WRONG_TOLD}", WRONG_ONE), ("no answer", MISSING)))


def verdicts(axes: Axes, scores: Sequence[Score]) -> None:
    """Wrong verdicts by side."""
    _names(axes, scores)
    most = max(100.0 * float(np.mean(side)) for score in scores for side in (score.unsafe, score.alarm))
    for row, score in enumerate(scores):
        for sign, side, colour in ((1.0, score.unsafe, WRONG_ONE), (-1.0, score.alarm, "#E69F00")):
            share = 100.0 * float(np.mean(side))
            axes.barh(row, sign * share, color=colour, height=0.74)
            if share > 0.0:
                at, side_of = sign * (share + 0.015 * most), "left" if sign > 0 else "right"
                axes.text(at, row, _percent(share), va="center", ha=side_of, fontsize=10.5)
        if (silent := 100.0 * float(np.mean(score.silent))) > 0.0:
            axes.text(1.30 * most, row, f"{_percent(silent)} none", va="center", ha="right", color=FAINT, fontsize=10.5)
    axes.axvline(0.0, color=INK, lw=0.8)
    axes.set(xlim=(-0.62 * most, 1.30 * most), xlabel="% of the contacts")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{abs(value):.0f}"))
    _heading(axes, "Wrong verdicts", (("← false alarm", "#B87A00"), ("called safe, but slides →", WRONG_ONE)))


def scaling_cost(axes: Axes, scaling: Scaling) -> None:
    """Time against taxels, with lines of slope 1."""
    taxels = scaling.taxels.astype(float)
    ends = {}
    for short, seconds in scaling.seconds.items():
        if not np.isfinite(seconds).any():
            continue
        method, last = find(short), int(np.flatnonzero(np.isfinite(seconds))[-1])
        axes.plot(taxels, seconds, "-o", color=COLOURS[method.group], ms=5.5, lw=1.8, mec="white")
        ends[method] = float(seconds[last])
        if method.group == "ours":
            axes.plot(taxels, seconds[last] * taxels / taxels[last], ":", color=FAINT, lw=1.2, zorder=1)
    height = 0.0
    for method, end in sorted(ends.items(), key=lambda item: item[1]):
        height = max(end, height * NEXT_LINE)
        axes.annotate(method.name, (taxels[-1], height), (9, 0), textcoords="offset points", va="center",
                      color=COLOURS[method.group], fontsize=12, annotation_clip=False)  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="taxels in contact")
    axes.set_xticks(taxels[::2], [f"{count:.0f}" for count in taxels[::2]])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(FuncFormatter(written))
    axes.grid(axis="y", color="#E6E6E6", lw=0.8)
    axes.set_axisbelow(True)
    axes.set_title("Cost against taxels", loc="left", fontweight="bold", pad=10)
    axes.text(1.0, 1.02, "dotted: proportional to taxels", transform=axes.transAxes, ha="right", color=FAINT)


def _percent(share: float) -> str:
    return f"{share:.0f}" if share >= 10.0 else f"{share:.2g}"


def _names(axes: Axes, scores: Sequence[Score]) -> None:
    axes.set_yticks(range(len(scores)), [score.method.name for score in scores])
    for label, score in zip(axes.get_yticklabels(), scores, strict=True):
        label.set_color(COLOURS[score.method.group])
    axes.tick_params(axis="y", length=0.0)
    axes.invert_yaxis()
    axes.spines["left"].set_visible(False)
    axes.margins(y=0.01)


def _heading(axes: Axes, title: str, parts: Sequence[tuple[str, str]]) -> None:
    """Title, and the meaning of the colours above the bars."""
    axes.set_title(title, loc="left", fontweight="bold", pad=26)
    place = 0.0
    for name, colour in parts:
        axes.text(place, 1.012, "■", transform=axes.transAxes, color=colour, fontsize=11, va="bottom")
        axes.text(place + 0.035, 1.012, name, transform=axes.transAxes, color=INK, fontsize=11, va="bottom")
        place += 0.018 * len(name) + 0.1
