"""The pictures of the report: figures by family and μ, and methods against each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from chart.panels import FAINT, INK, written
from evaluate.campaign import FORESEEN, HOLDING, MAIN, SLIPPING_FAMILIES, Campaign, factor_name
from evaluate.methods import METHODS, OPERATED_AT, Found
from evaluate.running import FACTORS, Variant
from evaluate.summary import Summary
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

DPI = 100
COLOURS = dict(zip(METHODS, ("#999999", "#777777", "#AA4499", "#009E73", "#56B4E9", "#0072B2", "#D55E00"), strict=True))
STYLE = {"font.size": 10.5, "axes.spines.top": False, "axes.spines.right": False, "text.color": INK}


def save_figures(path: Path, campaign: Campaign) -> None:
    """Draw shares by family and μ, leads and latencies."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(15.0, 11.5), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        upper, lower = figure.subfigures(2, 1, height_ratios=(6.2, 4.6))
        maps = upper.subplots(1, 4, gridspec_kw={"width_ratios": (1, 1, 1, 1)})
        _map(maps[0], campaign, SLIPPING_FAMILIES, "no `slipping` in 100 ms, %", lambda s: s.missed)
        _map(maps[1], campaign, SLIPPING_FAMILIES, "no alarm in 100 ms, %", lambda s: s.silent)
        _map(maps[2], campaign, SLIPPING_FAMILIES, "false `slipping` before, %", lambda s: s.early)
        _map(maps[3], campaign, HOLDING, "false `slipping`, % of grasps", lambda s: s.early)
        leads, latencies = lower.subplots(1, 2)
        _leads(leads, campaign)
        _latencies(latencies, campaign)
        figure.savefig(path)


def _map(
    axes: Axes, campaign: Campaign, families: tuple[str, ...], title: str, get: Callable[[Summary], float]
) -> None:
    """Draw a share for every family and μ."""
    shares = np.array([[100.0 * get(campaign.summary([name], variant)) for variant in MAIN] for name in families])
    axes.imshow(np.nan_to_num(shares), cmap="OrRd", vmin=0.0, vmax=100.0, aspect="auto")
    for (row, column), value in np.ndenumerate(shares):
        if not math.isnan(value):
            axes.text(
                column,
                row,
                f"{value:.0f}",
                ha="center",
                va="center",
                color="white" if value > 60.0 else INK,
                fontsize=9,
            )
    axes.set_xticks(range(len(MAIN)), [factor_name(variant) for variant in MAIN])
    axes.set_yticks(range(len(families)), families)
    axes.tick_params(length=0)
    axes.set_title(title, loc="left", fontsize=11)
    axes.set_xlabel("μ of the config over the true one")


def _leads(axes: Axes, campaign: Campaign) -> None:
    """Draw the distribution of the lead of warnings; a slip without one has none."""
    for factor, colour in zip(FACTORS, ("#08519C", "#4292C6", "#222222", "#F4A259", "#C0392B"), strict=True):
        slips = [s for run in campaign.scores(FORESEEN, Variant(factor)) for s in run.episodes if s.first]
        leads = np.sort([1e3 * s.lead_s if s.warned else 0.0 for s in slips])
        if leads.size:
            _steps(axes, leads, 0.0, colour, f"factor {factor}")
    axes.axvline(130.0, color=FAINT, lw=0.8, ls=(0, (4, 4)))
    axes.set(
        xlim=(0.0, 1000.0), ylim=(0.0, 100.0), xlabel="lead of the warning, ms (0: none)", ylabel="% of first slips"
    )
    axes.set_title("How early: slips that build up", loc="left", fontsize=11)
    axes.legend(frameon=False, loc="lower right")


def _latencies(axes: Axes, campaign: Campaign) -> None:
    """Draw the distribution of the latency of "slipping"; what is never reported is missing from it."""
    groups = {"sudden weight": ("sudden weight",), "creep": ("creep",), "slips that build up": FORESEEN}
    variants = tuple(Variant(factor) for factor in FACTORS)
    for (name, families), colour in zip(groups.items(), ("#D55E00", "#009E73", "#0072B2"), strict=True):
        slips = [s for run in campaign.scores(families, *variants) for s in run.episodes if s.long]
        latencies = np.sort([max(1e3 * s.latency_s, 0.3) for s in slips])
        if latencies.size:
            _steps(axes, latencies, 0.3, colour, name)
    axes.axvline(100.0, color=FAINT, lw=0.8, ls=(0, (4, 4)))
    axes.set(
        xscale="log",
        xlim=(0.3, 1000.0),
        ylim=(0.0, 100.0),
        xlabel="onset to `slipping`, ms",
        ylabel="% of slips of 100 ms or longer",
    )
    axes.set_title("How soon: all μ factors; what is never reported is missing", loc="left", fontsize=11)
    axes.legend(frameon=False, loc="upper left")


def _steps(axes: Axes, values: np.ndarray, first: float, colour: str, label: str) -> None:
    """Draw the shares of sorted values up to each; infinite ones are beyond every share."""
    finite = values[np.isfinite(values)]
    shares = 100.0 * np.arange(1, finite.size + 1) / values.size
    x, y = (
        np.concatenate(([first], finite, [1e4])),
        np.concatenate(([0.0], shares, shares[-1:] if finite.size else [0.0])),
    )
    axes.step(x, y, where="post", color=colour, label=label)


def save_methods(path: Path, found: dict[str, Found], costs: dict[str, float]) -> None:
    """Draw the two errors of every method over all thresholds, and the cost of a decision."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14.0, 6.2), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        curves, bars = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.55, 1.0)})
        thresholds = np.concatenate((np.linspace(0.0, 2.0, 801), [1e8]))
        for name in METHODS:
            false, hit = found[name].curve(thresholds)
            curves.plot(100.0 * false, 100.0 * hit, color=COLOURS[name], lw=2.0, label=name)
            at_false, at_hit = found[name].curve(np.array([OPERATED_AT[name]]))
            curves.plot(100.0 * at_false, 100.0 * at_hit, "o", color=COLOURS[name], ms=8, mec="white")
        curves.set(
            xscale="symlog", xlim=(0.0, 100.0), ylim=(0.0, 101.0), xlabel="safe half-seconds with an alarm, %",
            ylabel="slips with an alarm up to 100 ms after onset, %",
        )  # fmt: skip
        curves.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        curves.set_title("Every threshold; ● the one in use; μ known to ±20 %", loc="left", fontsize=11)
        curves.legend(frameon=False, loc="lower right")
        names = METHODS[::-1]
        bars.barh(
            range(len(names)), [costs[name] for name in names], color=[COLOURS[name] for name in names], height=0.7
        )
        for row, name in enumerate(names):
            bars.text(costs[name] * 1.15, row, written(float(f"{costs[name]:.2g}")), va="center")
        bars.set_yticks(range(len(names)), names)
        bars.set(xscale="log", xlim=(5e-7, 5e-3))
        bars.xaxis.set_major_formatter(FuncFormatter(written))
        bars.set_title(
            "Time of a decision; with evidence, of the whole engine from bytes to message", loc="right", fontsize=10
        )
        figure.savefig(path)
