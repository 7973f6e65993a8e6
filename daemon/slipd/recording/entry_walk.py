"""Entries of a recording, decoded from its chunks one after another, and checked against what slipd writes."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Metadata
from mcap.well_known import MessageEncoding

from slipd.errors import RecordingError
from slipd.events import Event, Tick
from slipd.recording import mcap_file
from slipd.recording.event_codec import decode_event
from slipd.recording.mcap_records import BAD_RECORD, DamageError, inner_records, unpack_chunk

_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHANNELS_MAX = 1024  # enough topics for a hundred fingers
_CHANNEL_LIMIT_BYTES = 4096
_REASON_LIMIT = 500

_UNPACKED_BYTES, _UNPACKED_RATIO = 64 * 1024 * 1024, 4000
"""Most bytes that all chunks together may unpack to: this many in total, or this many per byte of the file. The ticks
of an idle daemon compress to a tenth, datagrams of 64 kB of zeros to a 630th, messages of 1 MiB to a 3300th."""


class Entry(NamedTuple):
    """One entry of a recording.

    Attributes:
        n: Its running index.
        t_ns: When the event entered the engine that it is, or that caused it; CLOCK_MONOTONIC of the recorded run.
        topic: Topic of a message, or `EVENTS`.
        content: The bytes that were published, or the event.
    """

    n: int
    t_ns: int
    topic: str
    content: Event | bytes


_UNDECODED = Tick()
"""Stands for any event where events are not decoded."""


class EntryWalk:
    """State of one pass over the records: the topic of each channel, and the next index.

    Args:
        wall_minus_monotonic_ns: Wall-clock time minus CLOCK_MONOTONIC in the recorded run, ns.
        first: Index of the first entry.
        decode: Whether events are decoded, which takes more than half of a pass.

    Attributes:
        lost: Number of entries missing so far.
        fault: Why entries are missing behind the last one; None where the recording ended with the run.
        stopped: The recording is whole, and states itself that it ends before the run did.
        file_bytes: Size of the file.
        next_n: Index that the next entry has if none is missing.
    """

    def __init__(self, wall_minus_monotonic_ns: int, first: int, *, decode: bool = True) -> None:
        self.lost = 0
        self.fault: str | None = "ends without an end record"
        self.stopped = False
        self.file_bytes = 0
        self.next_n = first
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._decode = decode
        self._topics: dict[int, str] = {}
        self._schemas = 0
        self._unpacked_bytes = 0

    def items(self, record: McapRecord) -> Iterator[Entry]:
        """Yield the entries of a record.

        Raises:
            DamageError: The record is damaged, or not one that slipd writes.
        """
        if isinstance(record, Chunk):
            yield from self._chunk(record)
        elif isinstance(record, Metadata) and record.name == mcap_file.END:
            self._end(record)

    def _chunk(self, chunk: Chunk) -> Iterator[Entry]:
        self._unpacked_bytes += chunk.uncompressed_size
        if self._unpacked_bytes > max(_UNPACKED_BYTES, _UNPACKED_RATIO * self.file_bytes):
            raise DamageError(
                f"unpacks to over {self._unpacked_bytes} bytes, which slipd cannot have written into {self.file_bytes}"
            )
        for opcode, body in inner_records(unpack_chunk(chunk)):
            if opcode != Opcode.MESSAGE:
                self._describe(opcode, body)
                continue
            if len(body) < _MESSAGE_HEAD.size:
                raise DamageError(f"entry {self.next_n} is cut off")
            channel_id, sequence, log_time_ns, _ = _MESSAGE_HEAD.unpack_from(body)
            topic = self._topics.get(channel_id)
            if topic is None:
                raise DamageError(f"entry {self.next_n} is on a channel that was never announced")
            n = self.next_n + ((sequence - self.next_n) & mcap_file.SEQUENCE_MASK)
            t_ns = log_time_ns - self._wall_minus_monotonic_ns
            payload = body[_MESSAGE_HEAD.size :]
            content: Event | bytes = payload
            if topic == mcap_file.EVENTS:
                content = _event(payload, n, t_ns) if self._decode else _UNDECODED
            if n != self.next_n:
                self._skip_to(n)
            self.next_n = n + 1
            yield Entry(n, t_ns, topic, content)

    def _describe(self, opcode: int, body: bytes) -> None:
        """Note a channel; a schema holds nothing that is needed."""
        if len(body) > _CHANNEL_LIMIT_BYTES:
            raise DamageError(f"has a channel or schema of {len(body)} bytes, which slipd cannot have written")
        if opcode == Opcode.CHANNEL:
            self.announce(body)
            return
        self._schemas += 1
        if self._schemas > _CHANNELS_MAX:
            raise DamageError(f"has more than {_CHANNELS_MAX} schemas, which slipd cannot have written")

    def announce(self, body: bytes) -> None:
        """Note the topic of a channel.

        Raises:
            DamageError: The channel is damaged, of another encoding, or known under another topic.
        """
        try:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
        except BAD_RECORD as error:
            raise DamageError(f"has a damaged channel: {error}") from error
        if channel.message_encoding != MessageEncoding.MessagePack:
            raise DamageError(f"channel {channel.topic!r:.80} is not msgpack")
        if self._topics.setdefault(channel.id, channel.topic) != channel.topic or len(self._topics) > _CHANNELS_MAX:
            raise DamageError(f"channel {channel.topic!r:.80} has the number of another, or is one too many")

    def _end(self, end: Metadata) -> None:
        # Recordings made before the checksum was added have none; a damaged key must not make this file one of those.
        known = {mcap_file.ENTRIES, mcap_file.STOPPED}
        if end.metadata.pop(mcap_file.CRC32, None) not in (None, mcap_file.checksum(end.metadata, "")) or not (
            set(end.metadata) <= known
        ):
            raise DamageError("its end is damaged: the number of entries does not match its checksum")
        try:
            count = int(end.metadata[mcap_file.ENTRIES])
        except (KeyError, ValueError) as error:
            raise DamageError(f"its end is damaged: {error}") from error
        self._skip_to(count)
        self.fault = None
        self.stopped = mcap_file.STOPPED in end.metadata
        if self.stopped:
            reason = end.metadata[mcap_file.STOPPED][:_REASON_LIMIT]
            self.fault = f"the recording stopped before the run did ({reason}); {self.lost} entries are missing"

    def _skip_to(self, n: int) -> None:
        if not 0 <= n - self.next_n <= mcap_file.SEQUENCE_MASK // 2:
            raise DamageError(f"entry {n} is where entry {self.next_n} should be")
        self.lost += n - self.next_n
        self.next_n = n


def _event(payload: bytes, n: int, t_ns: int) -> Event:
    try:
        stated_n, stated_t_ns, event = decode_event(payload)
    except RecordingError as error:
        raise DamageError(f"entry {n}: {error}") from error
    if (stated_n, stated_t_ns) != (n, t_ns):
        raise DamageError(f"entry {n} has another index ({stated_n}) or time in its payload")
    return event
