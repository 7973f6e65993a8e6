"""Draw ``docs/demo.png``: run the demo, and plot what the daemon published beside the true events of the scene.

Run it on an idle machine: ``PYTHONPATH=tests/support:tests/lab python -m chart.demo_picture``.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import msgpack
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from project import DOCS

from slipd.recording.reader import open_recording

WIDTH_IN, HEIGHT_IN, DPI = 11.0, 6.2, 120
LEFT, NEED, COMMAND, SLIP, FAINT = "#0072B2", "#D55E00", "#222222", "#B2182B", "#777777"
LEVEL_COLOURS = {
    "no_contact": "#EEEEEE", "stable": "#BFE3C8", "caution": "#FBE3A0", "warning": "#F4A582", "slipping": "#D7301F",
    "unknown": "#C9C9C9",
}  # fmt: skip
PHASES = (("contact", "grip"), ("lift", "lift"), ("pour", "fill one side"), ("tug", "tug"), ("set_down", "set down"))
MOST_UTILISATION = 1.25

Series = dict[str, list[tuple[float, dict[str, Any]]]]
Truth = dict[str, float]


def main() -> int:
    """Run the demo and write the picture; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m chart.demo_picture", description=__doc__)
    parser.add_argument("--into", type=Path, default=DOCS / "demo.png", metavar="FILE", help="default docs/demo.png")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "demo.mcap"
        command = [sys.executable, "-m", "slipd", "demo", "--headless", "--record", str(recording)]
        summary = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        save(options.into, *read(recording, summary))
    return 0


def read(recording: Path, summary: str) -> tuple[Series, Truth]:
    """Return the messages by topic with their times in the scene, s, and the times of the true events, s.

    The map of times has two figures more: when the box would have begun to turn, and how many ms after its begin the
    slip was reported.
    """
    messages = [(topic, msgpack.unpackb(payload)) for topic, payload in open_recording(recording).messages()]
    truth = {name: float(time) for time, name in re.findall(r"([\d.]+) s +truth +(\w+)", summary)[::-1]}
    if forecast := re.search(r"rotation_would_begin_s ([\d.]+)", summary):
        truth["would_rotate"] = float(forecast[1])
    if late := re.search(r"slip: reported ([\d.]+) ms after it began", summary):
        truth["reported_after_ms"] = float(late[1])
    shown = re.search(r"([\d.]+) s +slipd +\w+: slipping", summary)
    slips = [body["t_ns"] for topic, body in messages if topic == "warning" and body["level"] == "slipping"]
    if shown is None or not slips:
        raise SystemExit("the demo saw no slip: is the machine busy?")
    begin_ns = slips[0] - int(float(shown[1]) * 1e9)
    series: Series = defaultdict(list)
    for topic, body in messages:
        series[topic].append(((body["t_ns"] - begin_ns) * 1e-9, body))
    return series, truth


def save(path: Path, series: Series, truth: Truth) -> None:
    """Draw both panels and write the PNG."""
    with mpl.rc_context({"font.size": 10.5, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 0.8))
        draw_utilisation(upper, series, truth)
        draw_forces(lower, series)
        lower.set(xlabel="time in the scene, s", xlim=(1.0, truth["on_table"] + 1.0))
        figure.savefig(path)


def draw_utilisation(axes: Axes, series: Series, truth: Truth) -> None:
    """Draw utilisation and level of the left finger, and the events of the scene."""
    axes.plot(*curve(series, "slip.left", "utilisation"), color=LEFT, lw=1.4)
    for value, name in ((0.70, "caution"), (0.85, "warning"), (1.0, "slip begins")):
        axes.axhline(value, color=FAINT, lw=0.8, ls=":")
        axes.text(1.05, value + 0.012, name, color=FAINT, fontsize=9.5)
    draw_levels(axes, series["slip.left"])
    for event, name in PHASES:
        axes.axvline(truth[event], color="#DDDDDD", lw=0.9, zorder=0)
        before = event == "tug"  # the curve rises behind it
        axes.text(truth[event] + (-0.06 if before else 0.06), 0.58, name, color=FAINT, fontsize=9.5,
                  ha="right" if before else "left")  # fmt: skip
    warned = next(t for t, body in series["warning"] if body["level"] == "warning")
    late = truth["would_rotate"]
    axes.axvline(late, color=NEED, lw=1.0, ls="--")
    axes.annotate("", (late, 1.07), (warned, 1.07), arrowprops={"arrowstyle": "<->", "color": NEED})
    lead = f"warning {late - warned:.2f} s before the box\nwould turn in the first grip"
    axes.text(late + 0.1, 1.05, lead, color=NEED, va="center", fontsize=9.5)
    slid = truth["slide_begins"]
    told = f"slip, reported\nafter {truth['reported_after_ms']:.0f} ms"
    axes.annotate(told, (slid, 1.0), (slid + 0.55, 1.05), color=SLIP, fontsize=9.5, va="center",
                  arrowprops={"arrowstyle": "->", "color": SLIP})  # fmt: skip
    axes.set(ylim=(0.0, MOST_UTILISATION), ylabel="utilisation λ, left finger")
    axes.set_title("What slipd publishes during the demo", loc="left", fontweight="bold")


def draw_levels(axes: Axes, verdicts: list[tuple[float, dict[str, Any]]]) -> None:
    """Draw the level as a strip along the upper edge, and its legend beside the title."""
    begun, level = verdicts[0][0], verdicts[0][1]["level"]
    for t, body in [*verdicts, (verdicts[-1][0], {"level": None})]:
        if body["level"] != level:
            axes.axvspan(begun, t, 0.945, 1.0, color=LEVEL_COLOURS[level], lw=0)
            begun, level = t, body["level"]
    shift = 1.0
    for name in reversed(LEVEL_COLOURS):
        axes.text(shift, 1.045, name.replace("_", " "), transform=axes.transAxes, ha="right", fontsize=9.5,
                  bbox={"facecolor": LEVEL_COLOURS[name], "lw": 0, "pad": 2.5})  # fmt: skip
        shift -= 0.02 + 0.0098 * len(name)


def draw_forces(axes: Axes, series: Series) -> None:
    """Draw the grip force on one pad beside the command and the need."""
    axes.plot(*curve(series, "slip.left", "normal_n"), color=LEFT, lw=1.4, label="grip force measured, left pad")
    axes.plot(*curve(series, "gripper", "force_command_n"), color=COMMAND, lw=1.2, drawstyle="steps-post",
              label="grip force commanded")  # fmt: skip
    axes.plot(
        *curve(series, "slip.left", "grip_needed_n"), color=NEED, lw=1.2, label="grip force needed (twice the load)"
    )
    axes.set(ylim=(0.0, 20.0), ylabel="force on one pad, N")
    axes.legend(loc="upper left", frameon=False)


def curve(series: Series, topic: str, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of one field; NaN, a gap in the line, where it is nil."""
    times = np.array([t for t, _ in series[topic]])
    return times, np.array([np.nan if body[key] is None else body[key] for _, body in series[topic]], dtype=float)


if __name__ == "__main__":
    sys.exit(main())
