"""Write an MCAP file: chunks of messages with their indexes, and at the end a summary for readers that begin there.

The ``mcap`` library encodes every record but messages and their indexes: its own writer makes an object of each message
and encodes it field by field, which costs several times as much as all else that is done for an entry.
"""

from __future__ import annotations

import errno
import os
import struct
import zlib
from collections import defaultdict
from contextlib import suppress
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC

from slipd.recording.mcap_records import CHUNK_BYTES, HEAD

_MESSAGE = struct.Struct("<BQHIQQ")  # kind, length, channel, sequence, log time, publish time
_INDEX = struct.Struct("<BQHI")  # kind, length, channel, length of the places
_CRC_BYTES = 4
_SUMMARY = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
)
"""Kinds of records in the summary, in their order."""


def encoded(record: McapRecord) -> bytes:
    """Return the bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


class RecordStream:
    """A new file, written record by record.

    Nothing is buffered here, so no part of a failed record can reach the file later.

    Args:
        path: File to create; an existing one is never overwritten.

    Attributes:
        path: The file.

    Raises:
        OSError: The file exists or cannot be created. All methods except `cut_back`, `remove` and `close` raise it when
            the disk fails.
    """

    def __init__(self, path: Path) -> None:
        # A device file exists already, and holds nothing that could be lost.
        self._file = path.open("wb" if path.is_char_device() else "xb", buffering=0)
        self.path = path
        self._written = self._whole = 0

    def write(self, data: bytes | bytearray) -> None:
        """Write all of ``data``; a disk that is nearly full may take only a part at first."""
        rest = memoryview(data)
        while rest:
            count = self._file.write(rest) or 0
            self._written += count
            rest = rest[count:]

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._written

    def mark(self) -> None:
        """Mark everything written so far as complete records; the kernel has them already."""
        self._whole = self._written

    def sync(self) -> None:
        """Pass everything to the disk, so that it survives a power cut; a file that was deleted is a failed disk."""
        os.fdatasync(self._file.fileno())
        if not os.fstat(self._file.fileno()).st_nlink:
            raise OSError(errno.ENOENT, "the file was deleted while it was written")

    def cut_back(self) -> None:
        """Remove everything after the last `mark`; leave a device file unchanged."""
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._whole)
            self._file.seek(self._whole)
        self._written = self._whole

    def remove(self) -> None:
        """Close the file, and remove it from its folder."""
        with suppress(OSError):
            if not self.path.is_char_device():
                self.path.unlink()
        self.close()

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            self._file.close()


class McapWriter:
    """Write the records of a file, in its order: metadata and attachments, then messages, then metadata.

    Args:
        stream: The new file.
        profile: Profile of the file.
        library: What writes it.
    """

    def __init__(self, stream: RecordStream, profile: str, library: str) -> None:
        self._stream = stream
        self._chunk = bytearray()
        self._places: dict[int, list[int]] = defaultdict(list)  # time and place of each message of a channel
        self._channels: dict[str, int] = {}
        self._statistics = Statistics(0, 0, defaultdict(int), 0, 0, 0, 0, 0, 0)
        self._summary = {opcode: bytearray() for opcode in _SUMMARY}
        self._compressor = zstandard.ZstdCompressor(
            level=1
        )  # files of level 3 are no smaller, and cost half as much again
        self._index_compressor = zstandard.ZstdCompressor(level=1).compressobj()
        self._chunk_indexes = bytearray()  # compressed: fourteen chunks a second have 12 MB of them in an hour
        stream.write(MCAP0_MAGIC + encoded(Header(profile, library)))

    def add_metadata(self, name: str, metadata: dict[str, str]) -> None:
        """Write a metadata record."""
        record = encoded(Metadata(name, metadata))
        self._summary[Opcode.METADATA_INDEX] += encoded(MetadataIndex(self._stream.tell(), len(record), name))
        self._statistics.metadata_count += 1
        self._stream.write(record)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        record = encoded(Attachment(0, 0, name, media_type, data))
        index = AttachmentIndex(self._stream.tell(), len(record), 0, 0, len(data), name, media_type)
        self._summary[Opcode.ATTACHMENT_INDEX] += encoded(index)
        self._statistics.attachment_count += 1
        self._stream.write(record)

    def add_message(self, topic: str, sequence: int, t_ns: int, data: bytes) -> None:
        """Add a message in msgpack; a chunk that is large enough is written."""
        channel = self._channels.get(topic) or self._announce(topic)
        self._places[channel] += (t_ns, len(self._chunk))
        length = _MESSAGE.size - HEAD.size + len(data)
        self._chunk += _MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, t_ns, t_ns)
        self._chunk += data
        if len(self._chunk) > CHUNK_BYTES:
            self.end_chunk()

    def _announce(self, topic: str) -> int:
        number = self._channels[topic] = len(self._channels) + 1
        # msgpack needs no schema, but MCAP readers fail if a channel has none.
        schema = encoded(Schema(number, b"", SchemaEncoding.SelfDescribing, f"slipd.{topic}"))
        channel = encoded(Channel(number, topic, MessageEncoding.MessagePack, {}, number))
        self._summary[Opcode.SCHEMA] += schema
        self._summary[Opcode.CHANNEL] += channel
        self._chunk += schema + channel
        return number

    def end_chunk(self) -> None:
        """Write the messages that were added since the last chunk as a chunk."""
        if not self._places:
            return
        times_ns = [t_ns for places in self._places.values() for t_ns in places[::2]]
        begin_ns, end_ns = min(times_ns), max(times_ns)
        data = bytes(self._chunk)
        packed = self._compressor.compress(data)
        chunk = encoded(Chunk("zstd", packed, end_ns, begin_ns, zlib.crc32(data), len(data)))
        begin = self._stream.tell()
        indexes, index_places = bytearray(), dict[int, int]()
        for channel, places in self._places.items():
            index_places[channel] = begin + len(chunk) + len(indexes)
            size = 8 * len(places)
            indexes += _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX.size - HEAD.size + size, channel, size)
            indexes += struct.pack(f"<{len(places)}Q", *places)
            self._statistics.channel_message_counts[channel] += len(places) // 2
        self._stream.write(chunk + indexes)
        index = ChunkIndex(
            message_start_time=begin_ns,
            message_end_time=end_ns,
            chunk_start_offset=begin,
            chunk_length=len(chunk),
            message_index_offsets=index_places,
            message_index_length=len(indexes),
            compression="zstd",
            compressed_size=len(packed),
            uncompressed_size=len(data),
        )
        self._chunk_indexes += self._index_compressor.compress(encoded(index))
        first_ns = self._statistics.message_start_time if self._statistics.chunk_count else begin_ns
        self._statistics.message_start_time = min(first_ns, begin_ns)
        self._statistics.message_end_time = max(self._statistics.message_end_time, end_ns)
        self._statistics.chunk_count += 1
        self._chunk.clear()
        self._places.clear()

    def finish(self) -> None:
        """Write the summary and the end of the file."""
        self._stream.write(encoded(DataEnd(0)))
        statistics = self._statistics
        statistics.schema_count = statistics.channel_count = len(self._channels)
        statistics.message_count = sum(statistics.channel_message_counts.values())
        self._summary[Opcode.STATISTICS] += encoded(statistics)
        packed = self._chunk_indexes + self._index_compressor.flush()
        self._summary[Opcode.CHUNK_INDEX] += zstandard.ZstdDecompressor().decompressobj().decompress(packed)
        begin = self._stream.tell()
        summary, offsets = bytearray(), bytearray()
        for opcode, records in self._summary.items():
            offsets += encoded(SummaryOffset(opcode, begin + len(summary), len(records)))
            summary += records
        footer = Footer(begin, begin + len(summary), 0)
        summary += offsets
        footer.summary_crc = zlib.crc32(encoded(footer)[:-_CRC_BYTES], zlib.crc32(summary))
        self._stream.write(summary + encoded(footer) + MCAP0_MAGIC)
