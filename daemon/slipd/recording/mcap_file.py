"""The format of a recording: its records, their order, and their names.

An MCAP file (https://mcap.dev/spec) of profile ``slipd``:

- a metadata record ``slipd``: format, boot, wall offset, versions, index of the first entry unless it is 0, and a
  CRC-32 of these and the config (MCAP does not protect metadata, and its Python reader does not check attachments);
- an attachment ``config.toml``: the config of the run;
- chunks of messages, in the order in which things happened. Channel ``slipd/event`` carries the events that entered the
  engine (event_codec.py); every other channel carries the bytes published under its topic. The MCAP
  ``sequence`` of a message is its running index over *all* channels, modulo 2³², so that a loss is a gap;
- a metadata record ``slipd/end``: the number of entries, lost ones included, and a CRC-32 of them. If the disk failed
  before the run ended, this record follows the last entry that reached the file, and ``stopped`` holds the reason.
"""

from __future__ import annotations

import errno
import os
import platform
import zlib
from importlib.metadata import version
from pathlib import Path
from typing import IO, NamedTuple, cast

import msgpack
from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer, Metadata
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from slipd.errors import RecordingError
from slipd.events import Event
from slipd.recording.event_codec import encode_event
from slipd.recording.mcap_records import ENTRY_LIMIT_BYTES, RecordStream, keep_index_packed

PROFILE = "slipd"
FORMAT = "1"
START = "slipd"
END = "slipd/end"
FIRST, ENTRIES, STOPPED, CRC32 = "first", "entries", "stopped", "crc32"
CONFIG = "config.toml"
EVENTS = "slipd/event"
SEQUENCE_MASK = 0xFFFF_FFFF
"""The sequence number of MCAP has 32 bits."""

CHUNK_BYTES = 256 * 1024
"""Size of a chunk: closing one of 256 KiB occupies the writer for 6 ms, a larger one for much longer."""

_VERSIONED = ("slipd", "numpy", "numba", "msgpack", "mcap")


class RunHead(NamedTuple):
    """What the head of a recording states of its run.

    Attributes:
        config_text: The config of the run, TOML.
        boot: Id of the run.
        wall_minus_monotonic_ns: Wall-clock time minus CLOCK_MONOTONIC, ns.
        versions: Versions of Python, slipd and its libraries in the run; None: those of this process.
    """

    config_text: str
    boot: str
    wall_minus_monotonic_ns: int
    versions: dict[str, str] | None = None


def checksum(metadata: dict[str, str], config_text: str) -> str:
    """Return the CRC-32 of the start metadata (without its own entry) and the config, in hexadecimal."""
    items = sorted((key, value) for key, value in metadata.items() if key != CRC32)
    return f"{zlib.crc32(msgpack.packb([items, config_text])):08x}"


def start_metadata(head: RunHead, first: int) -> dict[str, str]:
    """Return the metadata of the start; arguments as for `RecordingFile`."""
    metadata = {
        "format": FORMAT,
        "boot": head.boot,
        "wall_minus_monotonic_ns": str(head.wall_minus_monotonic_ns),
        **(own_versions() if head.versions is None else head.versions),
    }
    if first:
        metadata[FIRST] = str(first)
    return metadata | {CRC32: checksum(metadata, head.config_text)}


def own_versions() -> dict[str, str]:
    """Return the versions of Python, slipd and its libraries."""
    return {"python": platform.python_version(), **{name: version(name) for name in _VERSIONED}}


def end_metadata(entries: int, stopped: str = "") -> dict[str, str]:
    """Return the metadata of the end.

    Args:
        entries: Number of entries, lost ones included.
        stopped: Why the recording ended before the run did; "" where it did not.
    """
    metadata = {ENTRIES: str(entries)}
    if stopped:
        # An error text of the system may contain undecodable bytes of a file name.
        metadata[STOPPED] = stopped.encode(errors="replace").decode()
    return metadata | {CRC32: checksum(metadata, "")}


def check_new(path: Path) -> None:
    """Refuse a path where no recording can be created.

    Raises:
        RecordingError: The file exists already, or its folder is missing or not writable.
    """
    if path.is_char_device():
        return
    if os.path.lexists(path):
        raise RecordingError(f"{path}: exists already; give the name of a new file") from FileExistsError()
    if not path.parent.is_dir():
        raise RecordingError(f"{path}: cannot be created: there is no folder {path.parent}") from FileNotFoundError()
    if os.statvfs(path.parent).f_flag & os.ST_RDONLY:
        raise RecordingError(f"{path}: cannot be created: {os.strerror(errno.EROFS)}")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise RecordingError(f"{path}: cannot be created: this user may not write to {path.parent}")


class RecordingFile(RecordStream):
    """Write a recording, entry by entry, on the thread of the caller.

    Args:
        path: File to write; an existing one is never overwritten.
        head: What the head states of the run.
        first: Index of the first entry.

    Raises:
        RecordingError: The file cannot be created. Every other method raises OSError when the disk fails.
    """

    def __init__(self, path: Path, head: RunHead, *, first: int = 0) -> None:
        self._wall_minus_monotonic_ns = head.wall_minus_monotonic_ns
        self._channels: dict[str, int] = {}
        try:
            check_new(path)
            super().__init__(path)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be created: {error.strerror}") from error
        output = cast("IO[bytes]", self)  # the writer uses only write, tell and flush
        self._writer = Writer(output, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        keep_index_packed(self._writer)
        try:
            self._writer.start(profile=PROFILE, library=f"slipd {version('slipd')}")
            self._writer.add_metadata(START, start_metadata(head, first))
            self._writer.add_attachment(0, 0, CONFIG, "application/toml", head.config_text.encode())
            self.end_chunk()
        except OSError as error:
            self.remove()
            raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error

    def add(self, n: int, t_ns: int, topic: str, content: Event | bytes) -> None:
        """Write an entry.

        Args:
            n: Its running index.
            t_ns: CLOCK_MONOTONIC with which the event entered the engine that it is, or that caused it.
            topic: Topic of a message, or `EVENTS`.
            content: The bytes that were published, or the event.
        """
        payload = content if isinstance(content, bytes) else encode_event(n, t_ns, content)
        if len(payload) > ENTRY_LIMIT_BYTES:
            raise ValueError(f"an entry must have at most {ENTRY_LIMIT_BYTES} bytes, got {len(payload)} on {topic}")
        wall_ns = t_ns + self._wall_minus_monotonic_ns
        channel = self._channels.get(topic) or self._register(topic)
        self._writer.add_message(channel, wall_ns, payload, wall_ns, n & SEQUENCE_MASK)

    def end_chunk(self) -> None:
        """Pass all entries to the kernel, so that they survive the end of the process."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self, entries: int, stopped: str = "") -> None:
        """Close the file in good order; arguments as for `end_metadata`."""
        self.end_chunk()  # metadata would precede a chunk that is still open
        self._writer.add_metadata(END, end_metadata(entries, stopped))
        self._writer.finish()  # type: ignore[no-untyped-call]
        self.sync()
        self.close()

    def stop(self, entries: int, reason: str) -> None:
        """Write an end record after the last entry that reached the file, if the disk still takes these few bytes.

        May be called again with a newer number of entries; call `close` afterwards.

        Args:
            entries: Number of entries, lost ones included.
            reason: Why the others are missing.
        """
        builder = RecordBuilder()
        Metadata(name=END, metadata=end_metadata(entries, reason)).write(builder)
        DataEnd(data_section_crc=0).write(builder)
        Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
        self.cut_back()
        try:
            self.write(bytes(builder.end()) + MCAP0_MAGIC)  # type: ignore[no-untyped-call]
            self.sync()
        except OSError:
            self.cut_back()

    def _register(self, topic: str) -> int:
        # msgpack needs no schema, but MCAP readers fail if a channel has none.
        schema = self._writer.register_schema(f"slipd.{topic}", SchemaEncoding.SelfDescribing, b"")
        self._channels[topic] = self._writer.register_channel(topic, MessageEncoding.MessagePack, schema)
        return self._channels[topic]
