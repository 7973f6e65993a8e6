"""Layouts for Foxglove and Lichtblick (JSON) and for PlotJuggler (XML): which quantity is drawn where.

One description gives all of them, so that they show the same.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from slipd_client.errors import CallError

COLOURS = ("#1f77b4", "#d62728", "#17becf", "#ff7f0e", "#2ca02c", "#9467bd")
WINDOW_S = 20


class Levels(NamedTuple):
    """Thresholds of the utilisation.

    Attributes:
        caution: The least of "caution".
        warning: The least of "warning".
        origin: Where they come from.
    """

    caution: float = 0.7
    warning: float = 0.85
    origin: str = "slipd's defaults"


@dataclass(frozen=True)
class Plot:
    """One plot.

    Attributes:
        title: Its title.
        of_fingers: Topic and field of each curve that every finger has.
        of_both: Topic and field of each curve that there is once.
        low: Least value shown; None: as the data.
        high: Largest value shown; None: as the data.
        lines: Values at which a line is drawn.
    """

    title: str
    of_fingers: tuple[tuple[str, str], ...]
    of_both: tuple[tuple[str, str], ...] = ()
    low: float | None = None
    high: float | None = None
    lines: tuple[float, ...] = ()


OTHER_PLOTS = (
    Plot("Normal force, and the grip that is needed [N]", (("slip", "normal_n"), ("slip", "grip_needed_n")),
         (("gripper", "force_command_n"),)),
    Plot("Tangential force [N]", (("slip", "tangential_n[0]"), ("slip", "tangential_n[1]"))),
    Plot("Level: 3 warning, 4 slipping, 5 unknown", (("slip", "level_code"),), low=0.0, high=5.5),
)  # fmt: skip
"""The plots below that of the utilisation, from top to bottom."""

PLOTJUGGLER, FOXGLOVE = "plotjuggler.xml", "foxglove.json"


def plots(levels: Levels) -> tuple[Plot, ...]:
    """Return the plots, from top to bottom."""
    title = (
        f"Utilisation: slips at 1; lines at caution {levels.caution:g}, warning {levels.warning:g} ({levels.origin})"
    )
    curves = (("slip", "utilisation"), ("slip", "relative_utilisation"))
    return Plot(title, curves, low=0.0, high=1.2, lines=(levels.caution, levels.warning, 1.0)), *OTHER_PLOTS


def write(folder: Path, fingers: Sequence[str], levels: Levels) -> list[Path]:
    """Write all layouts into a folder, made where it is missing; return their paths.

    Raises:
        CallError: They cannot be written, or a file with other contents stands in the place of one.
    """
    texts = {
        FOXGLOVE: foxglove_layout(fingers, levels),
        PLOTJUGGLER: plotjuggler_layout(fingers, levels),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            if (path := folder / name).exists() and path.read_text(encoding="utf-8", errors="replace") != text:
                raise CallError(f"{path}: exists already with other contents, and is not replaced; give another folder")
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise CallError(f"{folder}: cannot be written: {error.strerror}") from error
    return [folder / name for name in texts]


def ros_topic(topic: str, finger: str) -> str:
    """Return a topic in ROS; ``finger`` is "" for a topic that both fingers share."""
    return f"/slipd/{finger}/{topic}" if finger else f"/slipd/{topic}"


def foxglove_layout(fingers: Sequence[str], levels: Levels) -> str:
    """Return the layout for Foxglove and Lichtblick: plots, levels, images of the pads, diagnostics."""
    panels: dict[str, Any] = {f"Plot!{index}": _plot(plot, fingers) for index, plot in enumerate(plots(levels)[:-1])}
    panels["StateTransitions!levels"] = {
        "paths": [
            {"value": f"{ros_topic('slip', finger)}.level", "label": finger, "timestampMethod": "headerStamp"}
            for finger in fingers
        ],
    }
    left = _stack([*panels], "column")
    images = {f"Image!{finger}": _image(finger) for finger in fingers}
    panels |= images
    panels["DiagnosticSummary!health"] = {"topicToRender": "/diagnostics"}
    right = _stack([*images, "DiagnosticSummary!health"], "column")
    layout = {"first": left, "second": right, "direction": "row", "splitPercentage": 68}
    whole = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": layout,
    }
    return json.dumps(whole, indent=2) + "\n"


def _stack(names: list[str], direction: str) -> Any:
    """Return panels of equal size beside each other, as a tree of pairs."""
    if len(names) == 1:
        return names[0]
    return {
        "first": names[0],
        "second": _stack(names[1:], direction),
        "direction": direction,
        "splitPercentage": 100 / len(names),
    }


def _plot(plot: Plot, fingers: Sequence[str]) -> dict[str, Any]:
    paths: list[dict[str, Any]] = [
        {
            "value": f"{ros_topic(topic, finger)}.{field}",
            "label": f"{finger} {field}".strip(),
            "color": colour,
            "enabled": True,
            "timestampMethod": "headerStamp",
        }
        for topic, finger, field, colour in _curves(plot, fingers)
    ]
    paths += [
        {"value": f"{line:g}", "color": "#888888", "enabled": True, "timestampMethod": "receiveTime"}
        for line in plot.lines
    ]
    limits = {"minYValue": plot.low, "maxYValue": plot.high}
    return {
        "title": plot.title,
        "foxglovePanelTitle": plot.title,
        "paths": paths,
        **{key: value for key, value in limits.items() if value is not None},
        "showPlotValuesInLegend": True,
        "followingViewWidth": WINDOW_S,
    }


def _curves(plot: Plot, fingers: Sequence[str]) -> Iterator[tuple[str, str, str, str]]:
    """Yield topic, finger, field and colour of each curve."""
    curves = [(topic, finger, field) for topic, field in plot.of_fingers for finger in fingers]
    curves += [(topic, "", field) for topic, field in plot.of_both]
    for index, (topic, finger, field) in enumerate(curves):
        yield topic, finger, field, COLOURS[index % len(COLOURS)]


def _image(finger: str) -> dict[str, Any]:
    mode = {"imageTopic": ros_topic("image", finger), "colorMode": "colormap", "colorMap": "turbo"}
    return {"imageMode": {**mode, "minValue": 0, "maxValue": 0.5}}


def plotjuggler_layout(fingers: Sequence[str], levels: Levels) -> str:
    """Return the layout for PlotJuggler's source "Foxglove Bridge"."""
    root = ET.Element("root")
    tabs = ET.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    tab = ET.SubElement(tabs, "Tab", tab_name="slipd", containers="1")
    drawn_plots = plots(levels)
    sizes = ";".join([f"{1 / len(drawn_plots):g}"] * len(drawn_plots))
    container = ET.SubElement(tab, "Container")
    splitter = ET.SubElement(container, "DockSplitter", orientation="-", count=str(len(drawn_plots)), sizes=sizes)
    for plot in drawn_plots:
        area = ET.SubElement(splitter, "DockArea", name=plot.title)
        drawn = ET.SubElement(
            area, "plot", mode="TimeSeries", style="Lines", line_width="1.5", flip_x="false", flip_y="false"
        )
        limits = {"min": plot.low, "max": plot.high}
        ET.SubElement(drawn, "limitY", {key: f"{value:g}" for key, value in limits.items() if value is not None})
        for topic, finger, field, colour in _curves(plot, fingers):
            ET.SubElement(drawn, "curve", name=f"{ros_topic(topic, finger)}/{field}", color=colour)
    ET.SubElement(tabs, "currentTabIndex", index="0")
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    ET.SubElement(root, "streaming_buffer_size", value=str(WINDOW_S))
    ET.indent(root)
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ET.tostring(root, encoding='unicode')}\n"
