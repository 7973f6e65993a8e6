"""The file of a recording: what stands in it, in which order, under which names.

An MCAP file (https://mcap.dev/spec) of profile ``slipd``:

- a metadata record ``slipd``: format, boot, wall offset, versions, and a CRC-32 over these and the config
  (MCAP protects no metadata, and its Python reader does not check attachments);
- an attachment ``config.toml``: the config with which the run was started;
- chunks of messages, in the order in which things happened. Channel ``slipd/event`` carries the events that
  entered the engine (event_codec.py); every other channel carries the very bytes published under its topic.
  The MCAP ``sequence`` of a message is its running index over *all* channels, modulo 2³²: a loss is a gap;
- a metadata record ``slipd/end``, written when the recording was closed in good order: how many entries there
  were, lost ones included.
"""

from __future__ import annotations

import os
import platform
import zlib
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

import msgpack
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from slipd.errors import RecordingError
from slipd.pipeline.events import Event
from slipd.recording.event_codec import encode_event

PROFILE = "slipd"
FORMAT = "1"
START = "slipd"
END = "slipd/end"
CONFIG = "config.toml"
EVENTS = "slipd/event"
SEQUENCE_MASK = 0xFFFF_FFFF  # MCAP's sequence has 32 bits

CHUNK_BYTES = 256 * 1024  # closing a chunk of 256 KiB holds the writer for 6 ms; larger ones for much longer
ENTRY_LIMIT_BYTES = 2 * 1024 * 1024  # twice the longest WebSocket message that a transport takes
RECORD_LIMIT_BYTES = 2 * ENTRY_LIMIT_BYTES  # a chunk: CHUNK_BYTES and the one entry that made it overflow

_VERSIONED = ("slipd", "numpy", "numba", "msgpack", "mcap")


def checksum(metadata: dict[str, str], config_text: str) -> str:
    """Return the CRC-32 of the start metadata (without its own entry) and the config, in hexadecimal."""
    items = sorted((key, value) for key, value in metadata.items() if key != "crc32")
    return f"{zlib.crc32(msgpack.packb([items, config_text])):08x}"


class RecordingFile:
    """Writes a recording, entry by entry, on the thread of the caller.

    Args:
        path: File to be written; an existing one is never overwritten.
        config_text: The config of the run, TOML.
        boot: Id of the run.
        wall_minus_monotonic_ns: Wall-clock time minus CLOCK_MONOTONIC, ns.

    Raises:
        RecordingError: The file cannot be created. Every other method raises OSError when the disk fails.
    """

    def __init__(self, path: Path, *, config_text: str, boot: str, wall_minus_monotonic_ns: int) -> None:
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._channels: dict[str, int] = {}
        try:
            # A device file exists already, and nothing in it can be lost.
            self._stream = path.open("wb" if path.is_char_device() else "xb")
        except FileExistsError as error:
            raise RecordingError(f"{path}: exists already; give the name of a new file") from error
        except OSError as error:
            raise RecordingError(f"{path}: cannot be created: {error.strerror}") from error
        self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        try:
            self._start(config_text, boot)
        except OSError as error:
            with suppress(OSError):
                self._stream.close()
            raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error

    def event(self, n: int, t_ns: int, event: Event) -> None:
        """Write an event that entered the engine at ``t_ns``; ``n`` is its running index."""
        self._entry(EVENTS, n, t_ns, encode_event(n, t_ns, event))

    def published(self, n: int, t_ns: int, topic: str, payload: bytes) -> None:
        """Write the very bytes that were published under ``topic``."""
        self._entry(topic, n, t_ns, payload)

    def flush(self) -> None:
        """Hand everything so far to the kernel: it outlives the process."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def sync(self) -> None:
        """Hand everything flushed to the disk: it outlives a power cut."""
        os.fdatasync(self._stream.fileno())

    def finish(self, entries: int) -> None:
        """Close the file in good order; ``entries`` is how many there were, lost ones included."""
        self.flush()  # metadata would overtake a chunk that is still open
        self._writer.add_metadata(END, {"entries": str(entries)})
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.flush()
        self.sync()
        self._stream.close()

    def abandon(self) -> None:
        """Let go of a file that cannot be finished; what was flushed stays readable.

        Raises:
            OSError: What was not flushed could not be written; the file is let go of nevertheless.
        """
        self._stream.close()

    def _start(self, config_text: str, boot: str) -> None:
        metadata = {
            "format": FORMAT,
            "boot": boot,
            "wall_minus_monotonic_ns": str(self._wall_minus_monotonic_ns),
            "python": platform.python_version(),
            **{name: version(name) for name in _VERSIONED},
        }
        metadata["crc32"] = checksum(metadata, config_text)
        self._writer.start(profile=PROFILE, library=f"slipd {metadata['slipd']}")
        self._writer.add_metadata(START, metadata)
        self._writer.add_attachment(0, 0, CONFIG, "application/toml", config_text.encode())

    def _entry(self, topic: str, n: int, t_ns: int, payload: bytes) -> None:
        if len(payload) > ENTRY_LIMIT_BYTES:
            raise ValueError(f"an entry of {len(payload)} bytes on {topic}; the most is {ENTRY_LIMIT_BYTES}")
        wall_ns = t_ns + self._wall_minus_monotonic_ns
        channel = self._channels.get(topic) or self._register(topic)
        self._writer.add_message(channel, wall_ns, payload, wall_ns, n & SEQUENCE_MASK)

    def _register(self, topic: str) -> int:
        # msgpack describes itself, but readers of MCAP look the schema up and fail where there is none.
        schema = self._writer.register_schema(f"slipd.{topic}", SchemaEncoding.SelfDescribing, b"")
        self._channels[topic] = self._writer.register_channel(topic, MessageEncoding.MessagePack, schema)
        return self._channels[topic]
