"""Read a recording: complete, cut off by a kill, or damaged, and report which.

The readers of MCAP look first at the end of the file, which a killed writer never wrote, and trust the lengths that
they find. This one starts at the beginning, reads only records of kinds and lengths that slipd writes, and stops at the
first byte that cannot be right. So its work is bounded by the size of the file: a chunk that unpacks to far more than
it holds ends the reading. The ``mcap`` library decodes the records themselves.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Metadata
from mcap.well_known import MessageEncoding

from slipd.errors import RecordingError
from slipd.events import Event
from slipd.recording import mcap_file
from slipd.recording.event_codec import decode_event
from slipd.recording.mcap_records import (
    BAD_RECORD,
    DamageError,
    data_records,
    ends_closed,
    inner_records,
    open_mcap,
    unpack_chunk,
)

_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHANNELS_MAX = 1024  # enough topics for a hundred fingers
_CHANNEL_LIMIT_BYTES = 4096
_REASON_LIMIT = 500

_UNPACKED_BYTES, _UNPACKED_RATIO = 64 * 1024 * 1024, 4000
"""Most bytes that all chunks together may unpack to: this many in total, or this many per byte of the file. The ticks
of an idle daemon compress to a tenth, datagrams of 64 kB of zeros to a 630th, messages of 1 MiB to a 3300th."""


@dataclass(frozen=True, slots=True)
class Entered:
    """An event that entered the engine at ``t_ns`` (CLOCK_MONOTONIC of the recorded run)."""

    n: int
    t_ns: int
    event: Event


@dataclass(frozen=True, slots=True)
class Published:
    """The bytes that were published under ``topic`` because of the event before."""

    n: int
    t_ns: int
    topic: str
    payload: bytes


@dataclass
class Recording:
    """A recording on disk; every pass reads the file again.

    Attributes:
        path: The file.
        config_text: The config of the recorded run, TOML.
        boot: Id of the recorded run.
        wall_minus_monotonic_ns: Wall-clock time minus CLOCK_MONOTONIC in the recorded run, ns.
        versions: Versions of Python, slipd and its libraries in the recorded run.
        closed: Whether the file was closed in good order, by its last bytes.
        fault: Why a pass ended early; None if no pass did.
        lost: Number of entries that a pass found missing, as far as it can tell.
        size_bytes: Size of the file when the present pass began; 0 before the first.
        read_bytes: How much of it that pass has read.
    """

    path: Path
    config_text: str
    boot: str
    wall_minus_monotonic_ns: int
    versions: dict[str, str]
    closed: bool
    fault: str | None = None
    lost: int = 0
    size_bytes: int = 0
    read_bytes: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing is missing; faults within the file are known only after a pass."""
        return self.closed and self.fault is None and self.lost == 0

    @property
    def gap(self) -> str:
        """What is missing, for people, after a pass; "" where nothing is."""
        if self.complete:
            return ""
        lost = f"{self.lost} entries were lost while recording" if self.lost else "the end is missing"
        return self.fault or f"{self.path}: {lost}"

    def events(self) -> Iterator[tuple[int, Event]]:
        """Yield ``(t_ns, event)`` of every event, in the order in which they entered the engine."""
        return ((entry.t_ns, entry.event) for entry in self.entries() if isinstance(entry, Entered))

    def messages(self) -> Iterator[tuple[str, bytes]]:
        """Yield ``(topic, payload)`` of every published message, in the order in which they were published."""
        return ((entry.topic, entry.payload) for entry in self.entries() if isinstance(entry, Published))

    def entries(self) -> Iterator[Entered | Published]:
        """Yield events and messages in their total order, up to the first that cannot be read.

        Raises:
            RecordingError: The file cannot be opened.
        """
        walk = _Walk(self.wall_minus_monotonic_ns)
        try:
            with open_mcap(self.path) as file:
                self.size_bytes = walk.file_bytes = os.fstat(file.fileno()).st_size
                for record in data_records(file):
                    self.read_bytes = file.tell()
                    yield from walk.entries(record)
            if walk.entry_count is None:
                walk.fault = "ends without an end record"
        except (DamageError, OSError) as error:
            walk.fault = str(error)
        finally:  # also of a pass that its caller ends early
            self.lost = max(self.lost, walk.lost)
        self.fault = self.fault or (walk.fault and f"{self.path}: {walk.fault}")


class _Walk:
    """State of one pass over the records: the topic of each channel, and the next index."""

    def __init__(self, wall_minus_monotonic_ns: int) -> None:
        self.lost = 0
        self.fault: str | None = None
        self.entry_count: int | None = None
        self.file_bytes = 0
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._topics: dict[int, str] = {}
        self._schemas = 0
        self._unpacked_bytes = 0
        self._next_n = 0

    def entries(self, record: McapRecord) -> Iterator[Entered | Published]:
        if isinstance(record, Chunk):
            yield from self._chunk(record)
        elif isinstance(record, Metadata) and record.name == mcap_file.END:
            self._end(record)

    def _chunk(self, chunk: Chunk) -> Iterator[Entered | Published]:
        self._unpacked_bytes += chunk.uncompressed_size
        if self._unpacked_bytes > max(_UNPACKED_BYTES, _UNPACKED_RATIO * self.file_bytes):
            raise DamageError(
                f"unpacks to over {self._unpacked_bytes} bytes, which slipd cannot have written into {self.file_bytes}"
            )
        for opcode, body in inner_records(unpack_chunk(chunk)):
            if opcode == Opcode.MESSAGE:
                yield self._entry(body)
            elif len(body) > _CHANNEL_LIMIT_BYTES:
                raise DamageError(f"has a channel or schema of {len(body)} bytes, which slipd cannot have written")
            elif opcode == Opcode.CHANNEL:
                self._channel(body)
            else:
                self._schemas += 1
                if self._schemas > _CHANNELS_MAX:
                    raise DamageError(f"has more than {_CHANNELS_MAX} schemas, which slipd cannot have written")

    def _channel(self, body: memoryview) -> None:
        try:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
        except BAD_RECORD as error:
            raise DamageError(f"has a damaged channel: {error}") from error
        if channel.message_encoding != MessageEncoding.MessagePack:
            raise DamageError(f"channel {channel.topic!r:.80} is not msgpack")
        if channel.id in self._topics or len(self._topics) >= _CHANNELS_MAX:
            raise DamageError(f"channel {channel.topic!r:.80} is announced twice, or is one too many")
        self._topics[channel.id] = channel.topic

    def _entry(self, body: memoryview) -> Entered | Published:
        if len(body) < _MESSAGE_HEAD.size:
            raise DamageError(f"entry {self._next_n} is cut off")
        channel_id, sequence, log_time_ns, _ = _MESSAGE_HEAD.unpack_from(body)
        topic = self._topics.get(channel_id)
        if topic is None:
            raise DamageError(f"entry {self._next_n} is on a channel that was never announced")
        n = self._next_n + ((sequence - self._next_n) & mcap_file.SEQUENCE_MASK)
        t_ns = log_time_ns - self._wall_minus_monotonic_ns
        payload = bytes(body[_MESSAGE_HEAD.size :])
        entry = _event(payload, n, t_ns) if topic == mcap_file.EVENTS else Published(n, t_ns, topic, payload)
        self._skip_to(n)
        self._next_n = n + 1
        return entry

    def _end(self, end: Metadata) -> None:
        try:
            self.entry_count = int(end.metadata[mcap_file.ENTRIES])
        except (KeyError, ValueError) as error:
            raise DamageError(f"its end is damaged: {error}") from error
        self._skip_to(self.entry_count)
        if mcap_file.STOPPED in end.metadata:
            reason = end.metadata[mcap_file.STOPPED][:_REASON_LIMIT]
            self.fault = f"the recording stopped before the run did ({reason}); {self.lost} entries are missing"

    def _skip_to(self, n: int) -> None:
        if not 0 <= n - self._next_n <= mcap_file.SEQUENCE_MASK // 2:
            raise DamageError(f"entry {n} is where entry {self._next_n} should be")
        self.lost += n - self._next_n


def open_recording(path: Path) -> Recording:
    """Open a recording and read its first records.

    Raises:
        RecordingError: The file does not exist, is empty, is not an MCAP file, was not written by slipd, or its start
            is damaged.
    """
    try:
        with open_mcap(path) as file:
            closed = ends_closed(file)
            records = data_records(file)
            header = next(records, None)
            if not isinstance(header, Header) or header.profile != mcap_file.PROFILE:
                raise RecordingError(f"{path}: an MCAP file, but not a recording of slipd")
            return _start(path, records, closed=closed)
    except (DamageError, OSError) as error:
        raise RecordingError(f"{path}: {error}") from error


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording of slipd, by its header; complete and intact or not."""
    try:
        with open_mcap(path) as file:
            header = next(data_records(file), None)
    except (RecordingError, DamageError, OSError):
        return False
    return isinstance(header, Header) and header.profile == mcap_file.PROFILE


def _start(path: Path, records: Iterator[McapRecord], *, closed: bool) -> Recording:
    start, config = next(records, None), next(records, None)
    if not isinstance(start, Metadata) or start.name != mcap_file.START or not isinstance(config, Attachment):
        raise DamageError("is cut off or damaged before its config, so nothing can be read")
    metadata = start.metadata
    if metadata.get("format") != mcap_file.FORMAT:
        raise DamageError(f"must have format {mcap_file.FORMAT!r}, got {metadata.get('format')!r}")
    try:
        config_text = config.data.decode()
        if metadata.pop("crc32", "") != mcap_file.checksum(metadata, config_text):
            raise DamageError("its start is damaged: config and boot do not match their checksum")
        wall_minus_monotonic_ns = int(metadata.pop("wall_minus_monotonic_ns"))
        boot = metadata.pop("boot")
    except (ValueError, KeyError) as error:
        raise DamageError(f"its start is damaged: {error}") from error
    return Recording(path, config_text, boot, wall_minus_monotonic_ns, metadata, closed)


def _event(payload: bytes, n: int, t_ns: int) -> Entered:
    try:
        stated_n, stated_t_ns, event = decode_event(payload)
    except RecordingError as error:
        raise DamageError(f"entry {n}: {error}") from error
    if (stated_n, stated_t_ns) != (n, t_ns):
        raise DamageError(f"entry {n} has another index ({stated_n}) or time in its payload")
    return Entered(n, t_ns, event)
