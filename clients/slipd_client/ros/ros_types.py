"""ROS 2 message types: their text, their hash, and the types of ROS 2's own packages that slipd uses."""

from __future__ import annotations

import hashlib
import json
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

PRIMITIVES = {
    "bool": "?",
    "byte": "B",
    "int8": "b",
    "uint8": "B",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Format of ``struct`` of each primitive in use; ``string`` is the only other type that is no message."""

COMMENT_WIDTH = 100
_SEPARATOR = "=" * 80
_LINE = re.compile(r"([\w/]+)(\[\d*\])? (\w+)(?:=(-?\d+))?")


@dataclass(frozen=True)
class RosField:
    """One field of a message.

    Attributes:
        name: Its name.
        type: A primitive, "string", or a message as "package/Name".
        length: None for a single value, -1 for a sequence of any length, else the length of an array.
        comment: What it is, in ASCII; "" if the name explains itself.
    """

    name: str
    type: str
    length: int | None = None
    comment: str = ""

    @property
    def type_text(self) -> str:
        """Its type as in a ``.msg`` file, e.g. "float64[2]"."""
        if self.length is None:
            return self.type
        return f"{self.type}[]" if self.length < 0 else f"{self.type}[{self.length}]"


@dataclass(frozen=True)
class RosType:
    """A message type.

    Attributes:
        name: "package/Name".
        fields: Its fields, in order; at least one.
        constants: Type, name and value of each constant.
        comment: What it is, in ASCII.
    """

    name: str
    fields: tuple[RosField, ...]
    constants: tuple[tuple[str, str, int], ...] = ()
    comment: str = ""

    @property
    def full_name(self) -> str:
        """Name as MCAP files and viewers have it: "package/msg/Name"."""
        package, _, name = self.name.partition("/")
        return f"{package}/msg/{name}"

    def text(self) -> str:
        """Return the definition without comments, one line for each constant and field."""
        constants = [f"{kind} {name}={value}" for kind, name, value in self.constants]
        return "".join(f"{line}\n" for line in constants + [f"{each.type_text} {each.name}" for each in self.fields])

    def commented_text(self) -> str:
        """Return the definition with comments: the text of its ``.msg`` file."""
        parts = [_comment(self.comment)]
        if self.constants:
            parts.append("".join(f"{kind} {name}={value}\n" for kind, name, value in self.constants))
        parts += [f"{_comment(each.comment)}{each.type_text} {each.name}\n" for each in self.fields]
        return "\n".join(parts)


def type_from_text(name: str, text: str) -> RosType:
    """Return the type that a definition without comments declares.

    Raises:
        ValueError: A line is neither a field nor a constant.
    """
    fields, constants = [], []
    for line in text.strip().splitlines():
        match = _LINE.fullmatch(line.strip())
        if match is None:
            raise ValueError(f"{name}: a line must be 'type name' or 'type NAME=value', got {line!r}")
        kind, brackets, word, value = match.groups()
        if value is not None:
            constants.append((kind, word, int(value)))
        else:
            length = None if brackets is None else int(brackets[1:-1] or -1)
            fields.append(RosField(word, kind, length))
    return RosType(name, tuple(fields), tuple(constants))


def schema_text(name: str, types: Mapping[str, RosType]) -> str:
    """Return a type with every type within it, as encoding ``ros2msg`` has them: separated by lines of "=".

    Args:
        name: "package/Name".
        types: Every type by its name.
    """
    first, *others = with_parts(name, types)
    parts = [f"{_SEPARATOR}\nMSG: {each}\n{types[each].text()}" for each in others]
    return types[first].text() + "".join(parts)


def with_parts(name: str, types: Mapping[str, RosType]) -> list[str]:
    """Return a type and the types within it, each once, in the order of their first use."""
    return list(dict.fromkeys(_walk(name, types)))


def _walk(name: str, types: Mapping[str, RosType]) -> Iterator[str]:
    yield name
    for field in types[name].fields:
        if field.type in types:
            yield from _walk(field.type, types)


def _comment(text: str) -> str:
    return "".join(f"# {line}\n" for line in textwrap.wrap(text, COMMENT_WIDTH - 2))


_TEXTS = {
    "builtin_interfaces/Time": """
        int32 sec
        uint32 nanosec
    """,
    "builtin_interfaces/Duration": """
        int32 sec
        uint32 nanosec
    """,
    "std_msgs/Header": """
        builtin_interfaces/Time stamp
        string frame_id
    """,
    "geometry_msgs/Vector3": """
        float64 x
        float64 y
        float64 z
    """,
    "geometry_msgs/Point": """
        float64 x
        float64 y
        float64 z
    """,
    "geometry_msgs/Quaternion": """
        float64 x
        float64 y
        float64 z
        float64 w
    """,
    "geometry_msgs/Wrench": """
        geometry_msgs/Vector3 force
        geometry_msgs/Vector3 torque
    """,
    "geometry_msgs/WrenchStamped": """
        std_msgs/Header header
        geometry_msgs/Wrench wrench
    """,
    "geometry_msgs/PointStamped": """
        std_msgs/Header header
        geometry_msgs/Point point
    """,
    "geometry_msgs/Transform": """
        geometry_msgs/Vector3 translation
        geometry_msgs/Quaternion rotation
    """,
    "geometry_msgs/TransformStamped": """
        std_msgs/Header header
        string child_frame_id
        geometry_msgs/Transform transform
    """,
    "geometry_msgs/Twist": """
        geometry_msgs/Vector3 linear
        geometry_msgs/Vector3 angular
    """,
    "trajectory_msgs/MultiDOFJointTrajectoryPoint": """
        geometry_msgs/Transform[] transforms
        geometry_msgs/Twist[] velocities
        geometry_msgs/Twist[] accelerations
        builtin_interfaces/Duration time_from_start
    """,
    "trajectory_msgs/MultiDOFJointTrajectory": """
        std_msgs/Header header
        string[] joint_names
        trajectory_msgs/MultiDOFJointTrajectoryPoint[] points
    """,
    "tf2_msgs/TFMessage": """
        geometry_msgs/TransformStamped[] transforms
    """,
    "sensor_msgs/Image": """
        std_msgs/Header header
        uint32 height
        uint32 width
        string encoding
        uint8 is_bigendian
        uint32 step
        uint8[] data
    """,
    "sensor_msgs/Imu": """
        std_msgs/Header header
        geometry_msgs/Quaternion orientation
        float64[9] orientation_covariance
        geometry_msgs/Vector3 angular_velocity
        float64[9] angular_velocity_covariance
        geometry_msgs/Vector3 linear_acceleration
        float64[9] linear_acceleration_covariance
    """,
    "control_msgs/SpeedScalingFactor": """
        float64 factor
    """,
    "diagnostic_msgs/KeyValue": """
        string key
        string value
    """,
    "diagnostic_msgs/DiagnosticStatus": """
        byte OK=0
        byte WARN=1
        byte ERROR=2
        byte STALE=3
        byte level
        string name
        string message
        string hardware_id
        diagnostic_msgs/KeyValue[] values
    """,
    "diagnostic_msgs/DiagnosticArray": """
        std_msgs/Header header
        diagnostic_msgs/DiagnosticStatus[] status
    """,
}

STOCK_TYPES = {name: type_from_text(name, text) for name, text in _TEXTS.items()}
"""Every type by its name, "package/Name"."""


_IDS = {
    "message": 1,
    "int8": 2,
    "uint8": 3,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
"""Number of each type in ``type_description_interfaces/msg/FieldType``."""

_ARRAY, _SEQUENCE = 48, 144
"""Added to it for an array, and for a sequence of any length."""


def type_hash(name: str, types: Mapping[str, RosType]) -> str:
    """Return the hash of a type as text: "RIHS01_" and 64 hexadecimal digits.

    Args:
        name: "package/Name".
        types: Every type by its name.
    """
    first, *others = with_parts(name, types)
    description = {
        "type_description": _described(types[first], types),
        "referenced_type_descriptions": [
            _described(kind, types)
            for kind in sorted((types[each] for each in others), key=lambda kind: kind.full_name)
        ],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


def _described(kind: RosType, types: Mapping[str, RosType]) -> dict[str, Any]:
    fields = [{"name": field.name, "type": _field(field, types)} for field in kind.fields]
    return {"type_name": kind.full_name, "fields": fields}


def _field(field: RosField, types: Mapping[str, RosType]) -> dict[str, Any]:
    nested = types.get(field.type)
    number = _IDS["message" if nested else field.type]
    length = field.length or 0
    if length:
        number += _ARRAY if length > 0 else _SEQUENCE
    return {
        "type_id": number,
        "capacity": max(length, 0),
        "string_capacity": 0,
        "nested_type_name": nested.full_name if nested else "",
    }
