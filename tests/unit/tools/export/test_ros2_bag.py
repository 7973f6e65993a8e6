"""Bags as two other libraries read them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from ros_peers import plain
from rosbags.interfaces import QosDurability, QosHistory, QosLiveliness, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slipd_client.ros.conversion import TYPES, PadFrames, ros_messages
from slipd_client.ros.ros_types import RosType

if TYPE_CHECKING:
    from conftest import Dated

NAMES = {kind.full_name: kind for kind in TYPES.values()}
PADS = PadFrames(
    {
        "left": {"positions": [[0.0, 0, 0, 0], [0.085, 0, 0.0425, 0]], "quat_xyzw": [0.5, -0.5, 0.5, 0.5]},
        "right": {"positions": [[0.0, 0, 0, 0], [0.085, 0, -0.0425, 0]], "quat_xyzw": [-0.5, -0.5, -0.5, 0.5]},
    }
)
"""As the config of the recorded run has them."""


def wanted(dated: Dated) -> list[tuple[int, str, str, str]]:
    """Log time, topic, type and value of every ROS message of the run; a text, because NaN equals nothing."""
    return [
        (log_ns, each.topic, each.type, str(each.value))
        for log_ns, topic, body in dated
        for each in ros_messages(topic, body, PADS)
    ]


def found(log_ns: int, topic: str, kind: RosType, message: Any) -> tuple[int, str, str, str]:
    return log_ns, topic, kind.name, str(plain(message, kind.name))


def test_rosbags_reads_every_message_with_only_the_types_in_the_bag(exported: dict[str, Path], dated: Dated) -> None:
    store = get_typestore(Stores.EMPTY)
    with Reader(exported["ros2"]) as bag:
        for connection in bag.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        read = [
            found(t_ns, each.topic, NAMES[each.msgtype], store.deserialize_cdr(data, each.msgtype))
            for each, t_ns, data in bag.messages()
        ]
    assert read == wanted(dated)


def test_mcap_ros2_support_reads_every_message(exported: dict[str, Path], dated: Dated) -> None:
    (path,) = exported["ros2"].glob("*.mcap")
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        read = [
            found(raw.log_time, channel.topic, NAMES[schema.name], message)
            for schema, channel, raw, message in reader.iter_decoded_messages(log_time_order=False)
            if schema is not None
        ]
    assert read == wanted(dated)


def test_the_metadata_have_the_counts_the_times_and_the_quality_of_service(
    exported: dict[str, Path], dated: Dated
) -> None:
    messages = wanted(dated)
    with Reader(exported["ros2"]) as bag:
        counted = (bag.start_time, bag.end_time - 1, bag.message_count)
        assert counted == (messages[0][0], messages[-1][0], len(messages))
        assert {each.topic: each.msgcount for each in bag.connections} == Counter(each[1] for each in messages)
        for connection in bag.connections:
            (quality,) = connection.ext.offered_qos_profiles
            assert (quality.history, quality.depth) == (QosHistory.KEEP_LAST, 10)
            assert (quality.reliability, quality.durability) == (QosReliability.RELIABLE, QosDurability.VOLATILE)
            assert (quality.liveliness, quality.deadline.sec) == (QosLiveliness.AUTOMATIC, 9223372036)
