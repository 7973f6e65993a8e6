"""Layouts name only topics and fields that exist."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

from slipd_client.messages.schema.topics import TOPICS
from slipd_client.ros.conversion import TYPES, ros_messages
from slipd_client.viewers.layouts import Levels, foxglove_layout, plotjuggler_layout, plots

FINGERS = ("thumb", "index")


def topics() -> dict[str, str]:
    """Type of each ROS topic of a rig with these fingers."""
    head = {"timestamp": 1.0, "t_ns": 1, "frame": "", "rows": 1, "cols": 1}
    names = [name if name in ("warning", "grasp", "gripper", "status") else f"{name}.{finger}"
             for name in TOPICS for finger in FINGERS]  # fmt: skip
    return {each.topic: each.type for name in names for each in ros_messages(name, head)}


KNOWN = topics()


def exists(topic: str, field: str) -> bool:
    name = field.partition("[")[0]
    return any(each.name == name for each in TYPES[KNOWN[topic]].fields)


def leaves(layout: Any) -> Iterator[str]:
    if isinstance(layout, str):
        yield layout
    else:
        yield from leaves(layout["first"])
        yield from leaves(layout["second"])


def test_the_foxglove_layout_shows_panels_of_topics_and_fields_that_exist() -> None:
    layout = json.loads(foxglove_layout(FINGERS, Levels()))
    panels = layout["configById"]
    assert sorted(leaves(layout["layout"])) == sorted(panels)
    values = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    assert len(values) > 10
    for value in values:
        topic, _, field = value.partition(".")
        assert value.replace(".", "").isdigit() or exists(topic, field), value
    images = [panel["imageMode"]["imageTopic"] for panel in panels.values() if "imageMode" in panel]
    assert images == [f"/slipd/{finger}/image" for finger in FINGERS]
    assert {KNOWN[topic] for topic in images} == {"sensor_msgs/Image"}
    assert KNOWN[panels["DiagnosticSummary!health"]["topicToRender"]] == "diagnostic_msgs/DiagnosticArray"


def test_the_plotjuggler_layout_names_series_that_exist() -> None:
    root = ET.fromstring(plotjuggler_layout(FINGERS, Levels()))
    assert (
        len(list(root.iter("plot"))) == len(plots(Levels())) == int(next(root.iter("DockSplitter")).get("count", "0"))
    )
    curves = [curve.get("name", "") for curve in root.iter("curve")]
    assert len(curves) > 10
    assert all(exists(*name.rsplit("/", 1)) for name in curves)
