"""The ROS 2 types as types of Cyclone DDS, and the names that ROS 2 gives topics and types in DDS."""

from __future__ import annotations

import functools
from typing import Any

from cyclonedds.idl import make_idl_struct, types

from slipd_client.ros.conversion import TYPES
from slipd_client.ros.ros_types import RosField

_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "byte": types.byte,
    "int8": types.int8,
    "uint8": types.uint8,
    "int32": types.int32,
    "uint32": types.uint32,
    "int64": types.int64,
    "uint64": types.uint64,
    "float32": types.float32,
    "float64": types.float64,
    "string": str,
}


def dds_topic_name(topic: str) -> str:
    """Return the name in DDS of a ROS topic, e.g. ``rt/slipd/warning`` for ``/slipd/warning``."""
    return f"rt{topic}"


def dds_type_name(name: str) -> str:
    """Return the name in DDS of a ROS type, e.g. ``sensor_msgs::msg::dds_::Imu_`` for "sensor_msgs/Imu"."""
    package, _, word = name.partition("/")
    return f"{package}::msg::dds_::{word}_"


@functools.cache
def decoded_type(name: str) -> type[Any]:
    """Return a class for readers: its samples have the fields of the ROS type ("package/Name") as attributes."""
    fields = {field.name: _field(field) for field in TYPES[name].fields}
    return make_idl_struct(name.partition("/")[2], dds_type_name(name), fields)


@functools.cache
def encoded_type(name: str) -> type[Any]:
    """Return a class for writers and readers whose samples are bytes, in their attribute ``data``.

    It describes itself to DDS as the ROS type ("package/Name") does; only the bytes come from, and go to, the caller.
    """
    fields = {field.name: _field(field) for field in TYPES[name].fields}
    kind: Any = make_idl_struct(name.partition("/")[2], dds_type_name(name), fields, dataclassify=False)
    for method in ("__init__", "serialize", "deserialize", "deserialize_key"):
        setattr(kind, method, vars(_Encoded)[method])
    return kind  # type: ignore[no-any-return]


class _Encoded:
    """The methods of a sample that is bytes, in the place of those that encode and decode."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def serialize(self, *_: Any, **__: Any) -> bytes:
        return self.data

    @classmethod
    def deserialize(cls, data: bytes, *_: Any, **__: Any) -> _Encoded:
        return cls(bytes(data))

    @classmethod
    def deserialize_key(cls, *_: Any, **__: Any) -> None:
        """Return nothing: ROS types have no keys."""


def _field(field: RosField) -> Any:
    kind = _PRIMITIVES.get(field.type) or decoded_type(field.type)
    if field.length is None:
        return kind
    sequence: Any = types.sequence
    array: Any = types.array
    return sequence[kind] if field.length < 0 else array[kind, field.length]
