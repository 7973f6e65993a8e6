"""ROS 2 topics over Cyclone DDS: names and types as ROS 2 has them in DDS, and a writer for each topic.

Every topic is reliable, as REP 2003 asks of publishers of sensor data: subscribers may be reliable or best effort. A
write never waits: a reliable subscriber that is too slow receives the last messages, and delays nobody.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

from slipd_client.ros.conversion import TYPES, RosMessage, encode
from slipd_client.ros.ros_types import RosField, type_hash

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


DEPTH = 10
"""Messages that are kept for subscribers that are behind."""


class RosPublisher:
    """Publishes messages on ROS topics.

    Args:
        participant: Of a domain.
        latched: Number of past messages that a new subscriber receives, by topic; none of the other topics.
    """

    def __init__(self, participant: DomainParticipant, latched: Mapping[str, int]) -> None:
        self._participant = participant
        self._latched = latched
        self._writers: dict[str, DataWriter[Any]] = {}

    def publish(self, message: RosMessage) -> None:
        """Send a message to the subscribers of its topic; it is not even encoded where there are none."""
        writer = self._writers.get(message.topic) or self._open(message)
        if message.topic not in self._latched and not writer.get_matched_subscriptions():
            return
        try:
            writer.write(encoded_type(message.type)(encode(message)))
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_TIMEOUT:  # slow subscribers have more than 500 kB to take
                raise

    def _open(self, message: RosMessage) -> DataWriter[Any]:
        topic: Topic[Any] = Topic(self._participant, dds_topic_name(message.topic), encoded_type(message.type))
        history = Policy.History.KeepLast(self._latched.get(message.topic, DEPTH))
        latching = (Policy.Durability.TransientLocal, Policy.DurabilityService(0, history, -1, -1, -1))
        qos = Qos(
            Policy.Reliability.Reliable(max_blocking_time=0),
            history,
            *(latching if message.topic in self._latched else (Policy.Durability.Volatile,)),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            Policy.WriterDataLifecycle(autodispose=False),
            Policy.Userdata(f"typehash={type_hash(message.type, TYPES)};".encode()),
        )
        self._writers[message.topic] = DataWriter(self._participant, topic, qos)
        return self._writers[message.topic]
