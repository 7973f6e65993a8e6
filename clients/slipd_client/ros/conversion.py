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
import importlib
import json
import math
import struct
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from slipd_client.errors import CallError
from slipd_client.messages.names import Health
from slipd_client.messages.topics import TOPICS, Grasp, Slip, Status, Tactile, Wrench
from slipd_client.repairs import repairs
from slipd_client.ros.cdr import CdrEncoder
from slipd_client.ros.ros_types import STOCK_TYPES, schema_text
from slipd_client.ros.slipd_types import CONVERTERS, NAMES, PACKAGE, SLIPD_TYPES, time_of

NAMESPACE = "/slipd"
"""Beginning of the topics that only slipd has."""

DIAGNOSTICS_TOPIC, TRANSFORMS_TOPIC = "/diagnostics", "/tf"


PARENT = "gripper"


class PadFrames:
    """Frame of each pad at each width.

    Args:
        pads: The tables ``[grasp.pads.FINGER]`` of a config: ``positions``, rows of (width, x, y, z) in m with rising
            width, and ``quat_xyzw``.

    Raises:
        KeyError, TypeError, ValueError: The tables have another form.
    """

    def __init__(self, pads: Mapping[str, Mapping[str, Any]]) -> None:
        self._pads = {
            finger: ([tuple(map(float, row)) for row in pad["positions"]], _unit(tuple(map(float, pad["quat_xyzw"]))))
            for finger, pad in pads.items()
        }

    @property
    def orientations(self) -> dict[str, tuple[float, ...]]:
        """Orientation of each pad in the gripper's frame, unit quaternion x, y, z, w."""
        return {finger: quaternion for finger, (_, quaternion) in self._pads.items()}

    def transforms(self, header: Mapping[str, Any], width_m: float | None) -> list[dict[str, Any]]:
        """Return a ``geometry_msgs/TransformStamped`` for each pad whose position at this width is known."""
        found = []
        for finger, (rows, quaternion) in self._pads.items():
            position = None if width_m is None else _at(rows, width_m)
            if position is not None:
                found.append(
                    {
                        "header": {**header, "frame_id": PARENT},
                        "child_frame_id": f"{finger}_pad",
                        "transform": {
                            "translation": dict(zip("xyz", position, strict=True)),
                            "rotation": dict(zip("xyzw", quaternion, strict=True)),
                        },
                    }
                )
        return found


def _at(rows: list[tuple[float, ...]], width_m: float) -> list[float] | None:
    """Return the position at a width, linear between rows; None outside of them."""
    for (low, *below), (high, *above) in pairwise(rows):
        if low <= width_m <= high:
            share = (width_m - low) / (high - low)
            return [one + share * (other - one) for one, other in zip(below, above, strict=True)]
    return None


def _unit(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*quaternion)
    return tuple(each / norm for each in quaternion)


def pads_of(path: Path) -> PadFrames:
    """Return the places of the pads in a config of the daemon.

    Raises:
        CallError: The file cannot be read, or has no ``[grasp.pads]``.
    """
    config = read_config(path)
    try:
        return PadFrames(config["grasp"]["pads"])
    except (KeyError, TypeError, ValueError) as error:
        raise CallError(
            f"{path}: must have [grasp.pads] with positions and quat_xyzw; check it: slipd check"
        ) from error


def read_config(path: Path) -> dict[str, Any]:
    """Return the tables of a config of the daemon.

    Raises:
        CallError: The file cannot be read.
    """
    try:
        config: dict[str, Any] = importlib.import_module("tomllib").loads(path.read_text(encoding="utf-8"))
    except ModuleNotFoundError as error:  # of Python 3.11
        raise CallError("--config needs Python 3.11 or newer") from error
    except OSError as error:
        raise CallError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise CallError(f"{path}: not a TOML file: {error}") from error
    return config


_IN_STATUS = ("health", "message", "hardware_id")
"""Fields of a stream that a ``DiagnosticStatus`` has a place for."""

Entry = dict[str, Any]


def stale_diagnostics(last: Mapping[str, Any], header: Mapping[str, Any], why: str) -> dict[str, Any]:
    """Return a ``DiagnosticArray`` in which every entry of an earlier one is stale, because of ``why``."""
    entries = [{**each, "level": int(Health.STALE), "message": why} for each in last["status"]]
    return {"header": header, "status": entries}


def _entries(body: Mapping[str, Any]) -> Iterator[Entry]:
    yield _daemon(body)
    for finger, state in body.get("fingers", {}).items():
        yield _finger(finger, state)
    if body.get("gripper") is not None:
        yield _gripper(body["gripper"])
    for stream, state in body.get("streams", {}).items():
        values = {key: value for key, value in state.items() if key not in _IN_STATUS}
        yield entry(stream, state["health"], state.get("message") or "", state.get("hardware_id") or "", values)


def _daemon(body: Mapping[str, Any]) -> Entry:
    faults = [repair.problem for repair in repairs(body) if repair.id.startswith(("daemon", "recording", "incident"))]
    values = {key: body.get(key) for key in ("version", "uptime_s", "late_s", "object_name", "lease", "publisher")}
    return entry("daemon", Health.WARN if faults else Health.OK, "; ".join(faults), "", values)


def _finger(finger: str, state: Mapping[str, Any]) -> Entry:
    """Return a finger: a verdict that is unknown is a warning, every other is in order; it is no fault to slip."""
    level = Health.WARN if state["level"] == "unknown" else Health.OK
    message = " ".join(filter(None, (state["level"], ", ".join(state.get("reasons") or ()))))
    return entry(f"finger {finger}", level, message, "", state)


def _gripper(state: Mapping[str, Any]) -> Entry:
    if state.get("fault") is None:
        level, message = Health.STALE, "the gripper does not answer"
    elif fault := state["fault"] or state.get("latched_fault"):
        level, message = Health.ERROR, fault
    else:
        level, message = Health.OK, ""
    return entry("grip", level, message, "", state)  # "gripper" is its stream


def entry(name: str, level: Health, message: str, hardware_id: str, values: Mapping[str, Any]) -> Entry:
    """Return a ``DiagnosticStatus``; without a message it is the name of the level."""
    return {
        "level": int(level),
        "name": f"slipd: {name}",
        "message": message or Health(level).name,
        "hardware_id": hardware_id,
        "values": [{"key": key, "value": _text(value)} for key, value in values.items()],
    }


def _text(value: Any) -> str:
    """Return a value for people; "unknown" for nil."""
    if value is None:
        return "unknown"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


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
        yield RosMessage(
            DIAGNOSTICS_TOPIC, "diagnostic_msgs/DiagnosticArray", {"header": header, "status": list(_entries(body))}
        )
        return
    name = "wrench_reading" if cls is Wrench else head
    yield RosMessage(f"{place}/{name}", f"{PACKAGE}/{NAMES[cls]}", {"header": header, **CONVERTERS[cls](body)})
    if cls is Wrench:
        wrench = {"force": _vector(body.get("force_n")), "torque": _vector(body.get("torque_nm"))}
        yield RosMessage(f"{place}/wrench", "geometry_msgs/WrenchStamped", {"header": header, "wrench": wrench})
    elif cls is Slip:
        centroid_m = body.get("centroid_m")  # in the plane of the pad
        point = _vector(None if centroid_m is None else [*centroid_m, 0.0])
        yield RosMessage(f"{place}/contact", "geometry_msgs/PointStamped", {"header": header, "point": point})
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
