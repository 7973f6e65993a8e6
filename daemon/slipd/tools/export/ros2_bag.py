"""A ROS 2 bag: a folder with one MCAP file of CDR messages, and ``metadata.yaml``.

``ros2 bag play`` and ``ros2 bag info`` want the folder; Foxglove and PlotJuggler open the MCAP file in it. The metadata
is of version 5, which every ``rosbag2`` from Humble on reads.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer

from slipd.errors import SlipdError
from slipd.tools.export.message_files import Body
from slipd_client.ros.conversion import TYPES, PadFrames, RosMessage, encode, ros_messages, schema
from slipd_client.ros.slipd_types import TimeRangeError

METADATA_VERSION = 5
_FOREVER = "    sec: 9223372036\n    nsec: 854775807\n"
QOS = (
    "- history: 1\n  depth: 10\n  reliability: 1\n  durability: 2\n"
    f"  deadline:\n{_FOREVER}  lifespan:\n{_FOREVER}"
    f"  liveliness: 1\n  liveliness_lease_duration:\n{_FOREVER}  avoid_ros_namespace_conventions: false"
)
"""Offered quality of service of every topic, in the numbers of rmw: the last 10, reliable, volatile, automatic."""


@dataclass
class _Topic:
    type: str
    channel: int
    messages: int = 0


class Ros2Bag:
    """Writes a bag.

    Args:
        folder: Folder to create.
        pads: Places of the pads; None: they are not known.
    """

    def __init__(self, folder: Path, pads: PadFrames | None) -> None:
        folder.mkdir()
        self._folder = folder
        self._pads = pads
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns = self._last_ns = 0
        self._name = f"{folder.name}_0.mcap"
        self._file = (folder / self._name).open("xb")
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile=Profile.ROS2, library="slipd")

    def write(self, log_ns: int, topic: str, body: Body) -> None:
        """Write the ROS messages of one message of slipd that was published at ``log_ns``, ns since 1970.

        Raises:
            SlipdError: A time of the message does not fit ROS 2.
        """
        try:
            messages = list(ros_messages(topic, body, self._pads))
        except TimeRangeError as error:
            raise SlipdError(f"{topic}: {error}; --to parquet and csv have no such limit") from None
        for message in messages:
            self._write(log_ns, message)

    def finish(self) -> None:
        """Complete the bag and close its files."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        (self._folder / "metadata.yaml").write_text(self._metadata(), encoding="utf-8")

    def close(self) -> None:
        """Close the files as they are."""
        self._file.close()

    def _write(self, log_ns: int, message: RosMessage) -> None:
        topic = self._topics.get(message.topic) or self._register(message)
        if not self._first_ns:
            self._first_ns = log_ns
        self._last_ns = log_ns
        self._writer.add_message(topic.channel, log_ns, encode(message), log_ns, topic.messages & 0xFFFF_FFFF)
        topic.messages += 1

    def _register(self, message: RosMessage) -> _Topic:
        name = TYPES[message.type].full_name
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, SchemaEncoding.ROS2, schema(message.type).encode())
        channel = self._writer.register_channel(
            message.topic, MessageEncoding.CDR, self._schemas[name], {"offered_qos_profiles": QOS}
        )
        self._topics[message.topic] = _Topic(name, channel)
        return self._topics[message.topic]

    def _metadata(self) -> str:
        """Return ``metadata.yaml``; a string in JSON is one in YAML too."""
        duration_ns = self._last_ns - self._first_ns
        count = sum(topic.messages for topic in self._topics.values())
        topics = "".join(
            "    - topic_metadata:\n"
            f"        name: {name}\n"
            f"        type: {topic.type}\n"
            "        serialization_format: cdr\n"
            f"        offered_qos_profiles: {json.dumps(QOS)}\n"
            f"      message_count: {topic.messages}\n"
            for name, topic in self._topics.items()
        )
        return (
            "rosbag2_bagfile_information:\n"
            f"  version: {METADATA_VERSION}\n"
            "  storage_identifier: mcap\n"
            f"  duration:\n    nanoseconds: {duration_ns}\n"
            f"  starting_time:\n    nanoseconds_since_epoch: {self._first_ns}\n"
            f"  message_count: {count}\n"
            f"  topics_with_message_count:\n{topics}"
            '  compression_format: ""\n'
            '  compression_mode: ""\n'
            f"  relative_file_paths:\n    - {json.dumps(self._name)}\n"
            "  files:\n"
            f"    - path: {json.dumps(self._name)}\n"
            f"      starting_time:\n        nanoseconds_since_epoch: {self._first_ns}\n"
            f"      duration:\n        nanoseconds: {duration_ns}\n"
            f"      message_count: {count}\n"
        )
