"""Reads a recording back: whole, cut off by a kill, or damaged, and says which.

MCAP's own readers look at the end of the file first, which a killed writer never wrote, and believe the
lengths that they find. This one goes from the start, takes no record longer than the writer makes them, and
stops at the first byte that cannot be right. The ``mcap`` library takes the records themselves apart.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.well_known import MessageEncoding
from mcap.writer import MCAP0_MAGIC

from slipd.errors import RecordingError
from slipd.pipeline.events import Event
from slipd.recording import mcap_file
from slipd.recording.event_codec import decode_event

_HEAD = struct.Struct("<BQ")  # opcode and length of an MCAP record
_READ: dict[int, type[Header] | type[Metadata] | type[Attachment] | type[Chunk]] = {
    Opcode.HEADER: Header,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
    Opcode.CHUNK: Chunk,
}
_BAD_RECORD = (McapError, ValueError, struct.error, OverflowError, zstandard.ZstdError)


@dataclass(frozen=True, slots=True)
class Entered:
    """An event that entered the engine at ``t_ns`` (CLOCK_MONOTONIC of the recorded run)."""

    n: int
    t_ns: int
    event: Event


@dataclass(frozen=True, slots=True)
class Published:
    """The very bytes that were published under ``topic`` because of the event before it."""

    n: int
    t_ns: int
    topic: str
    payload: bytes


@dataclass
class Recording:
    """A recording on disk; every pass reads the file anew.

    Attributes:
        path: The file.
        config_text: The config of the recorded run, TOML.
        boot: Id of the recorded run.
        wall_minus_monotonic_ns: Its wall-clock time minus CLOCK_MONOTONIC, ns.
        versions: Versions of what computed and wrote it.
        closed: The file ends as a recording that was closed in good order does.
        fault: Why a pass could not read on, None as long as none was in trouble.
        lost: Entries that a pass found missing, as far as can be known.
    """

    path: Path
    config_text: str
    boot: str
    wall_minus_monotonic_ns: int
    versions: dict[str, str]
    closed: bool
    fault: str | None = None
    lost: int = 0

    @property
    def complete(self) -> bool:
        """Nothing is missing; what lies in the middle of the file is known only after a pass."""
        return self.closed and self.fault is None and self.lost == 0

    def events(self) -> Iterator[tuple[int, Event]]:
        """Yield ``(t_ns, event)`` of every event, in the order in which they entered."""
        return ((entry.t_ns, entry.event) for entry in self.entries() if isinstance(entry, Entered))

    def messages(self) -> Iterator[tuple[str, bytes]]:
        """Yield ``(topic, payload)`` of every published message, in the order in which they went out."""
        return ((entry.topic, entry.payload) for entry in self.entries() if isinstance(entry, Published))

    def entries(self) -> Iterator[Entered | Published]:
        """Yield events and messages in their one total order, up to the first that cannot be read.

        Raises:
            RecordingError: The file cannot be opened.
        """
        walk = _Walk(self.wall_minus_monotonic_ns)
        try:
            with _open(self.path) as file:
                for record in _records(file):
                    yield from walk.take(record)
            if walk.entries_told is None:
                walk.fault = "ends without having been closed"
        except (_DamageError, OSError) as error:
            walk.fault = str(error)
        self.lost = max(self.lost, walk.lost)
        self.fault = self.fault or (walk.fault and f"{self.path}: {walk.fault}")


class _DamageError(Exception):
    """Where a recording stops making sense."""


class _Walk:
    """One pass over the records: which channel is what, and which index comes next."""

    def __init__(self, wall_minus_monotonic_ns: int) -> None:
        self.lost = 0
        self.fault: str | None = None
        self.entries_told: int | None = None
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._topics: dict[int, str] = {}
        self._next_n = 0

    def take(self, record: McapRecord) -> Iterator[Entered | Published]:
        if isinstance(record, Chunk):
            for inner in _chunk_records(record):
                yield from self.take(inner)
        elif isinstance(record, Channel):
            self._channel(record)
        elif isinstance(record, Message):
            yield self._entry(record)
        elif isinstance(record, Metadata) and record.name == mcap_file.END:
            self._end(record)

    def _channel(self, channel: Channel) -> None:
        if channel.message_encoding != MessageEncoding.MessagePack:
            raise _DamageError(f"channel {channel.topic!r} is not msgpack")
        self._topics[channel.id] = channel.topic

    def _entry(self, message: Message) -> Entered | Published:
        topic = self._topics.get(message.channel_id)
        if topic is None:
            raise _DamageError(f"entry {self._next_n} is on a channel that was never announced")
        n = self._next_n + ((message.sequence - self._next_n) & mcap_file.SEQUENCE_MASK)
        t_ns = message.log_time - self._wall_minus_monotonic_ns
        payload = message.data
        entry = _event(payload, n, t_ns) if topic == mcap_file.EVENTS else Published(n, t_ns, topic, payload)
        self._skip_to(n)
        self._next_n = n + 1
        return entry

    def _end(self, end: Metadata) -> None:
        try:
            self.entries_told = int(end.metadata["entries"])
        except (KeyError, ValueError) as error:
            raise _DamageError(f"its end is damaged: {error}") from error
        self._skip_to(self.entries_told)

    def _skip_to(self, n: int) -> None:
        if not 0 <= n - self._next_n <= mcap_file.SEQUENCE_MASK // 2:
            raise _DamageError(f"entry {n} stands where entry {self._next_n} belongs")
        self.lost += n - self._next_n


def open_recording(path: Path) -> Recording:
    """Open a recording and read what stands at its start.

    Raises:
        RecordingError: There is no such file, it is empty, it is no MCAP file, slipd did not write it, or its
            start is damaged.
    """
    try:
        with _open(path) as file:
            closed = _ends_closed(file)
            records = _records(file)
            header = next(records, None)
            if not isinstance(header, Header) or header.profile != mcap_file.PROFILE:
                raise RecordingError(f"{path}: an MCAP file, but not a recording of slipd")
            return _start(path, records, closed=closed)
    except (_DamageError, OSError) as error:
        raise RecordingError(f"{path}: {error}") from error


def _start(path: Path, records: Iterator[McapRecord], *, closed: bool) -> Recording:
    start, config = next(records, None), next(records, None)
    if not isinstance(start, Metadata) or start.name != mcap_file.START or not isinstance(config, Attachment):
        raise _DamageError("was cut off or damaged before its config: nothing of it can be read")
    metadata = start.metadata
    if metadata.get("format") != mcap_file.FORMAT:
        told = metadata.get("format")
        raise _DamageError(f"has format {told!r}; this version of slipd reads {mcap_file.FORMAT!r}")
    try:
        config_text = config.data.decode()
        if metadata.pop("crc32", "") != mcap_file.checksum(metadata, config_text):
            raise _DamageError("its start is damaged: config and boot do not match their checksum")
        wall_minus_monotonic_ns = int(metadata.pop("wall_minus_monotonic_ns"))
        boot = metadata.pop("boot")
    except (ValueError, KeyError) as error:
        raise _DamageError(f"its start is damaged: {error}") from error
    return Recording(path, config_text, boot, wall_minus_monotonic_ns, metadata, closed)


def _open(path: Path) -> BinaryIO:
    try:
        file = path.open("rb")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be opened: {error.strerror}") from error
    magic = file.read(len(MCAP0_MAGIC))
    if magic == MCAP0_MAGIC:
        return file
    file.close()
    if not magic:
        raise RecordingError(f"{path}: is empty: nothing was recorded before the writer ended")
    raise RecordingError(f"{path}: not an MCAP file; recordings of slipd are")


def _ends_closed(file: BinaryIO) -> bool:
    here = file.tell()
    file.seek(0, 2)
    file.seek(max(here, file.tell() - len(MCAP0_MAGIC)))
    closed = file.read() == MCAP0_MAGIC
    file.seek(here)
    return closed


def _records(file: BinaryIO) -> Iterator[McapRecord]:
    """Yield the records of the data section that matter here, up to its end or the end of the file."""
    while True:
        place = file.tell()
        head = _read(file, _HEAD.size, place, may_end=True)
        if not head:
            return
        opcode, length = _HEAD.unpack(head)
        if opcode == Opcode.DATA_END:
            return
        if length > mcap_file.RECORD_LIMIT_BYTES:
            raise _DamageError(f"is damaged at byte {place}: a record of {length} bytes")
        body = _read(file, length, place)
        if opcode in _READ:
            yield _parse(opcode, body, place)


def _read(file: BinaryIO, length: int, place: int, *, may_end: bool = False) -> bytes:
    data = file.read(length)
    if len(data) < length and not (may_end and not data):
        raise _DamageError(f"was cut off in the record at byte {place}")
    return data


def _parse(opcode: int, body: bytes, place: int) -> McapRecord:
    try:
        record: McapRecord = _READ[opcode].read(ReadDataStream(BytesIO(body)))
    except _BAD_RECORD as error:
        raise _DamageError(f"is damaged at byte {place}: {error}") from error
    return record


def _chunk_records(chunk: Chunk) -> list[McapRecord]:
    try:
        # The library would make room for whatever length the compressed data claims.
        if chunk.compression != "zstd" or not (
            zstandard.frame_content_size(chunk.data) == chunk.uncompressed_size <= mcap_file.RECORD_LIMIT_BYTES
        ):
            raise _DamageError("has a chunk that slipd cannot have written")
        return breakup_chunk(chunk, validate_crc=True)
    except _BAD_RECORD as error:
        raise _DamageError(f"has a damaged chunk: {error}") from error


def _event(payload: bytes, n: int, t_ns: int) -> Entered:
    try:
        told_n, told_t_ns, event = decode_event(payload)
    except RecordingError as error:
        raise _DamageError(f"entry {n}: {error}") from error
    if (told_n, told_t_ns) != (n, t_ns):
        raise _DamageError(f"entry {n} calls itself {told_n}, or tells another time")
    return Entered(n, t_ns, event)
