"""ROS 2 topics of one process, over Cyclone DDS: a writer for each topic, with the quality of service ROS expects.

Every topic is reliable, as REP 2003 asks of publishers of sensor data: subscribers may be reliable or best effort. A
write never waits: a reliable subscriber that is too slow receives the last messages, and delays nobody.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

from slipd_client.ros.conversion import TYPES, RosMessage, encode
from slipd_client.ros.type_hash import type_hash
from slipd_client.ros2.dds_types import dds_topic_name, encoded_type

DEPTH = 10
"""Messages that are kept for subscribers that are behind."""


def writer_qos(name: str, depth: int, *, latched: bool) -> Qos:
    """Return the quality of service of a writer.

    Args:
        name: Its type, "package/Name".
        depth: Messages that are kept for subscribers that are behind.
        latched: A new subscriber receives the last ``depth`` messages ("transient local").
    """
    history = Policy.History.KeepLast(depth)
    latching = (Policy.Durability.TransientLocal, Policy.DurabilityService(0, history, -1, -1, -1))
    return Qos(
        Policy.Reliability.Reliable(max_blocking_time=0),
        history,
        *(latching if latched else (Policy.Durability.Volatile,)),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.WriterDataLifecycle(autodispose=False),
        Policy.Userdata(f"typehash={type_hash(name, TYPES)};".encode()),
    )


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
        latched = message.topic in self._latched
        qos = writer_qos(message.type, self._latched.get(message.topic, DEPTH), latched=latched)
        self._writers[message.topic] = DataWriter(self._participant, topic, qos)
        return self._writers[message.topic]
