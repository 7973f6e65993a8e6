"""Messages of the daemon as ROS 2 messages: which topics and types, and the value of every field.

| topic of slipd | topic of ROS | type |
| --- | --- | --- |
| slip.FINGER | /slipd/FINGER/slip, …/contact | slipd_msgs/Slip, geometry_msgs/PointStamped |
| wrench.FINGER | /slipd/FINGER/wrench, …/wrench_reading | geometry_msgs/WrenchStamped, slipd_msgs/WrenchReading |
| tactile.FINGER | /slipd/FINGER/tactile, …/image | slipd_msgs/Tactile, sensor_msgs/Image |
| warning, grasp, gripper | /slipd/warning, /slipd/grasp, /slipd/gripper | slipd_msgs/SlipWarning, …/Grasp, …/Gripper |
| grasp | /tf, where the places of the pads are known | tf2_msgs/TFMessage |
| status | /diagnostics | diagnostic_msgs/DiagnosticArray |
"""

from __future__ import annotations

import functools
import math
import struct
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from slipd_client.messages.schema.topics import TOPICS, Grasp, Slip, Status, Tactile, Wrench
from slipd_client.ros.cdr import CdrEncoder
from slipd_client.ros.diagnostics import diagnostics
from slipd_client.ros.pad_frames import PadFrames
from slipd_client.ros.ros_types import schema_text
from slipd_client.ros.slipd_types import CONVERTERS, NAMES, PACKAGE, SLIPD_TYPES, time_of
from slipd_client.ros.stock_types import STOCK_TYPES
from slipd_client.ros.topic_names import DIAGNOSTICS_TOPIC, NAMESPACE, TRANSFORMS_TOPIC

TYPES = STOCK_TYPES | SLIPD_TYPES
"""Every type in use by its name, "package/Name"."""

IMAGE_ENCODING = "32FC1"
"""One float for each taxel."""

Body = Mapping[str, Any]


class RosMessage(NamedTuple):
    """One message of ROS 2: its topic, the name of its type ("package/Name"), and a value for each field."""

    topic: str
    type: str
    value: dict[str, Any]


def ros_messages(topic: str, body: Body, pads: PadFrames | None = None) -> Iterator[RosMessage]:
    """Yield the ROS messages of one message of the daemon; none for a topic that this version does not know.

    Args:
        topic: Topic of the daemon, e.g. ``slip.left``.
        body: Map of the message, of this version of the API.
        pads: Places of the pads; None: they are not known.
    """
    head, _, finger = topic.partition(".")
    cls = TOPICS.get(head)
    if cls is None:
        return
    place = f"{NAMESPACE}/{finger}" if finger else NAMESPACE
    header = _header(body)
    if cls is Status:
        yield RosMessage(DIAGNOSTICS_TOPIC, "diagnostic_msgs/DiagnosticArray", diagnostics(header, body))
        return
    name = "wrench_reading" if cls is Wrench else head
    yield RosMessage(f"{place}/{name}", f"{PACKAGE}/{NAMES[cls]}", {"header": header, **CONVERTERS[cls](body)})
    if cls is Wrench:
        yield RosMessage(f"{place}/wrench", "geometry_msgs/WrenchStamped", _wrench(header, body))
    elif cls is Slip:
        yield RosMessage(f"{place}/contact", "geometry_msgs/PointStamped", _contact(header, body))
    elif cls is Tactile:
        yield RosMessage(f"{place}/image", "sensor_msgs/Image", _image(header, body))
    elif cls is Grasp and pads is not None:
        transforms = pads.transforms(header, body.get("width_m"))
        if transforms:
            yield RosMessage(TRANSFORMS_TOPIC, "tf2_msgs/TFMessage", {"transforms": transforms})


def encode(message: RosMessage) -> bytes:
    """Return the CDR bytes of a message."""
    return _encoder(message.type).encode(message.value)


@functools.cache
def schema(name: str) -> str:
    """Return the text of a type ("package/Name") with all types within it, in the encoding ``ros2msg``."""
    return schema_text(name, TYPES)


@functools.cache
def _encoder(name: str) -> CdrEncoder:
    return CdrEncoder(name, TYPES)


def stamp_ns(body: Body) -> int:
    """Return when the readings of a message were acquired, ns since 1970, within 0.5 µs (steps of a float).

    It is 0 where the message does not say so; in ROS that is no time.
    """
    return round((body.get("timestamp") or 0.0) * 1e9)


def _header(body: Body) -> dict[str, Any]:
    return {"stamp": time_of(stamp_ns(body)), "frame_id": body.get("frame") or ""}


def _vector(values: list[float] | None) -> dict[str, float]:
    x, y, z = values or (math.nan, math.nan, math.nan)
    return {"x": x, "y": y, "z": z}


def _wrench(header: dict[str, Any], body: Body) -> dict[str, Any]:
    return {
        "header": header,
        "wrench": {"force": _vector(body.get("force_n")), "torque": _vector(body.get("torque_nm"))},
    }


def _contact(header: dict[str, Any], body: Body) -> dict[str, Any]:
    """Return the contact centroid, in the plane of the pad."""
    centroid_m = body.get("centroid_m")
    return {"header": header, "point": _vector(None if centroid_m is None else [*centroid_m, 0.0])}


def _image(header: dict[str, Any], body: Body) -> dict[str, Any]:
    """Return the loads as an image, one pixel for each taxel; NaN where the image of the pad cannot be used."""
    rows, cols = body["rows"], body["cols"]
    loads = body.get("loads_n") or [math.nan] * (rows * cols)
    return {
        "header": header,
        "height": rows,
        "width": cols,
        "encoding": IMAGE_ENCODING,
        "is_bigendian": 0,
        "step": 4 * cols,
        "data": struct.pack(f"<{len(loads)}f", *loads),
    }
