"""A ROS 2 bag: a folder with one MCAP file of CDR messages, and ``metadata.yaml``.

``ros2 bag play`` and ``ros2 bag info`` want the folder; Foxglove and PlotJuggler open the MCAP file in it. The metadata
is of version 5, which every ``rosbag2`` from Humble on reads.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from mcap.reader import make_reader
from mcap.records import Statistics
from mcap.summary import Summary
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer

from slipd.config import Config
from slipd.errors import SlipdError
from slipd.tools.export.message_tables import Body, Write
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


@contextmanager
def ros2_bag(folder: Path, settings: Config) -> Iterator[Write]:
    """Create a bag, and yield what writes the ROS messages of one message of slipd.

    Raises:
        SlipdError: A time of a message does not fit ROS 2.
    """
    folder.mkdir()
    pads = None
    if settings.grasp is not None:
        pads = PadFrames({finger: pad.model_dump() for finger, pad in settings.grasp.pads.items()})
    name = f"{folder.name}_0.mcap"
    with (folder / name).open("xb") as file:
        bag = _Bag(Writer(file, compression=CompressionType.ZSTD))
        bag.writer.start(profile=Profile.ROS2, library="slipd")

        def write(log_ns: int, topic: str, body: Body) -> None:
            try:
                messages = list(ros_messages(topic, body, pads))
            except TimeRangeError as error:
                raise SlipdError(f"{topic}: {error}; --to parquet and csv have no such limit") from None
            for message in messages:
                bag.write(log_ns, message)

        yield write
        bag.writer.finish()  # type: ignore[no-untyped-call]
    (folder / "metadata.yaml").write_text(_metadata(folder / name), encoding="utf-8")


@dataclass
class _Bag:
    """The MCAP file of a bag, its channels by topic, and the number of messages of each."""

    writer: Writer
    channels: dict[str, int] = field(default_factory=dict)
    schemas: dict[str, int] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)

    def write(self, log_ns: int, message: RosMessage) -> None:
        channel = self.channels.get(message.topic) or self._register(message)
        self.writer.add_message(channel, log_ns, encode(message), log_ns, self.counts[channel] & 0xFFFF_FFFF)
        self.counts[channel] += 1

    def _register(self, message: RosMessage) -> int:
        name = TYPES[message.type].full_name
        if name not in self.schemas:
            self.schemas[name] = self.writer.register_schema(name, SchemaEncoding.ROS2, schema(message.type).encode())
        qos = {"offered_qos_profiles": QOS}
        channel = self.writer.register_channel(message.topic, MessageEncoding.CDR, self.schemas[name], qos)
        self.channels[message.topic] = channel
        return channel


def _metadata(file: Path) -> str:
    """Return ``metadata.yaml``, by the summary of the MCAP file; a string in JSON is one in YAML too."""
    with file.open("rb") as opened:
        summary = cast("Summary", make_reader(opened).get_summary())
    found = cast("Statistics", summary.statistics)
    first_ns, duration_ns = found.message_start_time, found.message_end_time - found.message_start_time
    listed = "".join(
        "    - topic_metadata:\n"
        f"        name: {channel.topic}\n"
        f"        type: {summary.schemas[channel.schema_id].name}\n"
        "        serialization_format: cdr\n"
        f"        offered_qos_profiles: {json.dumps(QOS)}\n"
        f"      message_count: {found.channel_message_counts[number]}\n"
        for number, channel in summary.channels.items()
    )
    return (
        "rosbag2_bagfile_information:\n"
        f"  version: {METADATA_VERSION}\n"
        "  storage_identifier: mcap\n"
        f"  duration:\n    nanoseconds: {duration_ns}\n"
        f"  starting_time:\n    nanoseconds_since_epoch: {first_ns}\n"
        f"  message_count: {found.message_count}\n"
        f"  topics_with_message_count:\n{listed}"
        '  compression_format: ""\n'
        '  compression_mode: ""\n'
        f"  relative_file_paths:\n    - {json.dumps(file.name)}\n"
        "  files:\n"
        f"    - path: {json.dumps(file.name)}\n"
        f"      starting_time:\n        nanoseconds_since_epoch: {first_ns}\n"
        f"      duration:\n        nanoseconds: {duration_ns}\n"
        f"      message_count: {found.message_count}\n"
    )
