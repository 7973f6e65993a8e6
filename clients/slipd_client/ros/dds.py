"""ROS 2 over Cyclone DDS: where nodes are looked for, names and types as ROS 2 has them in DDS, writers and readers.

ROS's own environment variables become the same configuration of Cyclone DDS that ``rmw_cyclonedds`` makes of them.

Every topic is reliable, as REP 2003 asks of publishers of sensor data: subscribers may be reliable or best effort. A
write never waits: a reliable subscriber that is too slow receives the last messages, and delays nobody.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from slipd_client.errors import CallError
from slipd_client.ros.conversion import TYPES, RosMessage, encode
from slipd_client.ros.ros_types import RosField, type_hash

LARGEST_DOMAIN = 232
"""The ports of a larger one would exceed 65535."""

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_NO_MULTICAST = "<General><AllowMulticast>false</AllowMulticast></General>"
_LOOPBACK = '<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>'


class RosEnvironment(NamedTuple):
    """Domain and configuration.

    Attributes:
        domain: Id of the domain.
        configuration: Fragments of XML, joined by commas, with those of ``CYCLONEDDS_URI`` last; "" for the defaults.
        warning: What will keep nodes from being found; "" where nothing is known.
    """

    domain: int
    configuration: str
    warning: str


def ros_environment(variables: Mapping[str, str], domain: str | None = None) -> RosEnvironment:
    """Return the domain and its configuration.

    Args:
        variables: Environment variables.
        domain: Id of the domain; None: that of ``ROS_DOMAIN_ID``, or 0.

    Raises:
        CallError: The id of the domain is wrong, or a variable has a value that ROS does not know.
    """
    parts = [*_fragments(variables), *filter(None, [variables.get("CYCLONEDDS_URI", "").strip()])]
    stated = variables.get("ROS_DOMAIN_ID", "").strip() or "0" if domain is None else domain
    if stated not in map(str, range(LARGEST_DOMAIN + 1)):
        where = "ROS_DOMAIN_ID" if domain is None else "--domain"
        raise CallError(f"{where} must be an integer from 0 to {LARGEST_DOMAIN}, got {stated!r:.40}")
    return RosEnvironment(int(stated), ",".join(parts), _warning(variables))


def _fragments(variables: Mapping[str, str]) -> Iterator[str]:
    reach = variables.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper() or "SUBNET"
    if reach not in RANGES:
        raise CallError(f"ROS_AUTOMATIC_DISCOVERY_RANGE must be one of {', '.join(RANGES)}, got {reach!r:.40}")
    peers = [peer.strip() for peer in variables.get("ROS_STATIC_PEERS", "").split(";") if peer.strip()]
    if variables.get("ROS_LOCALHOST_ONLY", "").strip() == "1":  # of Humble; it outranks the others in Jazzy
        yield _within_domain(_LOOPBACK)
        yield _within_domain(_NO_MULTICAST + _peers(["localhost"]))
    elif reach == "LOCALHOST":
        yield _within_domain(_NO_MULTICAST + _peers(["localhost", *peers]))
    elif reach == "OFF":
        yield _within_domain(_NO_MULTICAST + "<Discovery><ParticipantIndex>none</ParticipantIndex></Discovery>")
    elif reach == "SUBNET" and peers:
        yield _within_domain(_peers(peers))


def _peers(addresses: Iterable[str]) -> str:
    peers = "".join(f"<Peer address={quoteattr(address)}/>" for address in addresses)
    return (
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        f"<Peers>{peers}</Peers></Discovery>"
    )


def _within_domain(xml: str) -> str:
    return f"<CycloneDDS><Domain>{xml}</Domain></CycloneDDS>"


def _warning(variables: Mapping[str, str]) -> str:
    middleware = variables.get("RMW_IMPLEMENTATION", "")
    if "zenoh" in middleware:
        return f"RMW_IMPLEMENTATION is {middleware}: its nodes do not speak DDS, and will not see these topics"
    if variables.get("ROS_SECURITY_ENABLE", "").lower() == "true":
        return "ROS_SECURITY_ENABLE is true: slipctl has no keys for SROS 2, and nodes that enforce security ignore it"
    return ""


@contextlib.contextmanager
def joined(environment: RosEnvironment) -> Iterator[DomainParticipant]:
    """Join the domain while the block runs.

    Raises:
        CallError: DDS cannot start.
    """
    try:
        domain = Domain(environment.domain, environment.configuration) if environment.configuration else None
        participant = DomainParticipant(environment.domain)
    except DDSException as error:
        raise CallError(
            f"DDS cannot start in domain {environment.domain}: {error}; check CYCLONEDDS_URI and the network"
        ) from error
    yield participant
    del participant, domain  # the participant first: Cyclone DDS ends a domain with all that is in it


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


RECEIVED = 100
"""Longest queue of received messages."""


def ros_reader(
    participant: DomainParticipant, topic: str, kind: str, *, latched: bool = False, reliable: bool = False
) -> DataReader[Any]:
    """Return a reader of a topic.

    Args:
        participant: Of the domain.
        topic: The topic.
        kind: Its type, "package/Name".
        latched: Receive the messages from before too, from publishers that keep them.
        reliable: Lose none, from publishers that send again what was lost; so does ``latched``.
    """
    lossless = Policy.Reliability.Reliable(max_blocking_time=0)
    qos = Qos(
        lossless if reliable or latched else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(RECEIVED),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"typehash={type_hash(kind, TYPES)};".encode()),
    )
    return DataReader(participant, Topic(participant, dds_topic_name(topic), decoded_type(kind)), qos)


def taken(reader: DataReader[Any]) -> list[Any]:
    """Return the messages that have arrived, without the sample that reports the end of their last publisher."""
    return [sample for sample in reader.take(RECEIVED) if sample.sample_info.valid_data]
