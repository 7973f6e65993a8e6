"""An MCAP file with one JSON channel for each topic, and its schema: Foxglove and Lichtblick open it."""

from __future__ import annotations

import json
from pathlib import Path

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from slipd.tools.export.json_schema import for_json, json_schema
from slipd.tools.export.message_files import Body
from slipd_client.messages.schema.topics import TOPICS, Message


class JsonMcap:
    """Writes the file.

    Args:
        path: File to create.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb")
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="slipd")
        self._schemas: dict[type[Message], int] = {}
        self._channels: dict[str, tuple[int, type[Message]]] = {}

    def write(self, log_ns: int, topic: str, body: Body) -> None:
        """Write a message that was published at ``log_ns``, ns since 1970."""
        channel, cls = self._channels.get(topic) or self._register(topic)
        text = json.dumps(for_json(cls, body), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        self._writer.add_message(channel, log_ns, text.encode(), log_ns, body["seq"] & 0xFFFF_FFFF)

    def finish(self) -> None:
        """Complete the file and close it."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()

    def close(self) -> None:
        """Close the file as it is."""
        self._file.close()

    def _register(self, topic: str) -> tuple[int, type[Message]]:
        cls = TOPICS[topic.partition(".")[0]]
        if cls not in self._schemas:
            text = json.dumps(json_schema(cls), ensure_ascii=False)
            self._schemas[cls] = self._writer.register_schema(
                f"slipd.{cls.__name__}", SchemaEncoding.JSONSchema, text.encode()
            )
        channel = self._writer.register_channel(topic, MessageEncoding.JSON, self._schemas[cls])
        self._channels[topic] = channel, cls
        return self._channels[topic]
