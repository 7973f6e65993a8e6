"""The picture ``docs/simulator.png`` and the words beside it."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from chart.panels import FAINT, INK
from chart.stick_slip import DROPS, Study, winkler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from stick_slip_scenes import onset

WIDTH_IN, HEIGHT_IN, DPI = 16.0, 9.4, 100
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#AA4499")

TEXT = """![The simulated grasp against closed forms, and one slip over time](simulator.png)

[The physics](physics.md) describes the simulator. Here it is held against what is known without it.

- **Limit surface**: pull and twist that a sliding contact carries (dots), against the exact limit surface (lines).
- **Partial slip**: a round contact under a pull that rises and falls, against the closed form (thin lines). The load
  comes back on another path, and the object does not quite return: micro-slip.
- **Sliding share**: the share of the load on cells that slide, while the pull rises.
- **Friction over speed**: |f_t| / f_n of a sliding box, against the Stribeck curve of its cells, which it
  follows with the lag of the frictional memory.
- **A slip**: a pull grows until the box slides; then the grip force is raised and it sticks again.
- **Fineness**: error of the displacement of a slip against the finest step and cell."""


def save(path: Path, study: Study) -> None:
    """Draw all panels and write the PNG."""
    with mpl.rc_context({"font.size": 11.0, "axes.spines.top": False, "axes.spines.right": False, "text.color": INK}):
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, 3)
        _limits(axes[0, 0], study)
        _loops(axes[0, 1], study)
        _shares(axes[0, 2], study)
        _stribeck(axes[1, 0], study)
        _slip(axes[1, 1], study)
        _fineness(axes[1, 2], study)
        figure.savefig(path)


def _limits(axes: Axes, study: Study) -> None:
    for colour, (name, found) in zip(COLOURS, study.limits.items(), strict=False):
        axes.plot(*found.exact.T, color=colour, lw=1.4, label=name.replace("_", " "))
        axes.plot(*found.carried.T, ".", color=colour, ms=4)
    axes.set(title="Limit surface", xlabel="pull / μ f_n", ylabel="twist / μ f_n a", xlim=(0, 1.1), ylim=(0, None))
    axes.legend(frameon=False, loc="lower left")


def _loops(axes: Axes, study: Study) -> None:
    s = np.linspace(0.0, 1.0, 200)
    axes.plot(s, winkler(s), color=FAINT, lw=0.8)
    for colour, loop in zip(COLOURS, study.loops, strict=False):
        axes.plot(loop.displacement, loop.pull, color=colour, lw=2.2, alpha=0.7)
        top = float(loop.displacement.max())
        back = np.linspace(top, float(loop.displacement[-1]), 100)
        axes.plot(back, winkler(np.array(top)) - 2 * winkler((top - back) / 2), color=FAINT, lw=0.8)
    axes.set(title="Partial slip", xlabel="displacement / that of full sliding", ylabel="pull / limit", ylim=(0, 1.05))


def _shares(axes: Axes, study: Study) -> None:
    loop = study.loops[-1]
    up = slice(20, int(np.argmax(loop.pull)))
    s = np.linspace(0.0, 1.0, 200)
    axes.plot(winkler(s), s**3, color=FAINT, lw=0.8)
    axes.plot(loop.pull[up], loop.share[up], ".", color=COLOURS[0], ms=3)
    axes.set(title="Sliding share of Hertz's disc", xlabel="pull / limit", ylabel="share of the load", xlim=(0, 1))


def _stribeck(axes: Axes, study: Study) -> None:
    trace = study.slide
    pulled = (trace.t_s < 0.44) & (trace.velocity[:, 0] > 1e-4)
    v = np.geomspace(1e-4, 1.0, 200)
    law = DROPS.mu_d + (DROPS.mu_s - DROPS.mu_d) / (1 + (v / DROPS.stribeck_mps) ** 2)
    ratio = np.hypot(*trace.wrench_left[:, :2].T) / trace.normal_n
    axes.semilogx(v, law, color=FAINT, lw=0.8)
    axes.plot(trace.velocity[pulled, 0], ratio[pulled], ".", color=COLOURS[0], ms=4)
    axes.set(title="Friction over speed", xlabel="speed, m/s", ylabel="|f_t| / f_n", ylim=(0.4, 0.65))


def _slip(axes: Axes, study: Study) -> None:
    trace = study.slide
    t = 1e3 * (trace.t_s - trace.t_s[onset(trace)])
    shown = (t > -60) & (t < 100)
    ratio = np.hypot(*trace.wrench_left[:, :2].T) / trace.normal_n
    axes.plot(t[shown], ratio[shown], color=COLOURS[0], label="|f_t| / f_n")
    axes.plot(t[shown], trace.sliding_share[shown], color=COLOURS[1], lw=1.0, label="sliding share")
    axes.plot(t[shown], 100 * trace.displacement[shown, 0], color=COLOURS[2], label="displacement, cm")
    axes.plot(t[shown], trace.normal_n[shown] / 30.0, color=FAINT, ls="--", lw=1.0, label="grip / 30 N")
    axes.set(title="A slip, and the grip that ends it", xlabel="time from the onset, ms")
    axes.legend(frameon=False, loc="upper left")


def _fineness(axes: Axes, study: Study) -> None:
    for colour, found, name, scale in (
        (COLOURS[0], study.steps, "step, ms", 1e3),
        (COLOURS[1], study.cells, "cell, mm", 1e3),
    ):
        axes.loglog([scale * one.size for one in found], [100 * one.displacement_error for one in found], "o-",
                    color=colour, label=name)  # fmt: skip
    axes.set(title="Fineness", xlabel="step, ms; cell, mm", ylabel="error of the displacement, %")
    axes.legend(frameon=False)
