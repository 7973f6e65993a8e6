"""Read a recording: complete, cut off by a kill, or damaged, and report which.

The readers of MCAP look first at the end of the file, which a killed writer never wrote, and trust the lengths that
they find. This one starts at the beginning, reads only records of kinds and lengths that slipd writes, and stops at the
first byte that cannot be right. So its work is bounded by the size of the file: a chunk that unpacks to far more than
it holds ends the reading. The ``mcap`` library decodes the records themselves.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mcap.records import Attachment, Header, McapRecord, Metadata

from slipd.config import Config, parse
from slipd.errors import RecordingError
from slipd.events import Event
from slipd.recording import mcap_file
from slipd.recording.entry_walk import Entry, EntryWalk
from slipd.recording.mcap_records import DamageError, data_records, ends_closed, open_mcap

GAP_S = 0.1
"""Least time without an event that is a gap: ticks enter the engine every 5 ms, and a busy machine delays them."""


class Gap(NamedTuple):
    """The time between two events that are too far apart, s from the begin."""

    begin_s: float
    end_s: float


class EventGaps:
    """Finds the gaps from the times of all events. What was reported before a gap does not hold in it.

    Args:
        begin_ns: Where the times of the gaps begin to count, CLOCK_MONOTONIC.

    Attributes:
        found: The gaps so far, in order.
        newest_s: Time of the newest event, s from the begin; None before the first.
    """

    def __init__(self, begin_ns: int = 0) -> None:
        self.found: list[Gap] = []
        self._begin_ns = begin_ns
        self.newest_s: float | None = None

    def time_s(self, t_ns: int) -> float:
        """Return the time since the begin, s."""
        return (t_ns - self._begin_ns) * 1e-9

    def add(self, t_ns: int) -> bool:
        """Add the time of an event, before the messages that it causes; return whether a gap ends there."""
        t_s = self.time_s(t_ns)
        before_s, self.newest_s = self.newest_s, t_s
        if before_s is None or t_s - before_s <= GAP_S:
            return False
        self.found.append(Gap(before_s, t_s))
        return True


@dataclass
class Recording:
    """A recording on disk; every pass reads the file again.

    Attributes:
        path: The file.
        config_text: The config of the recorded run, TOML.
        boot: Id of the recorded run.
        wall_minus_monotonic_ns: Wall-clock time minus CLOCK_MONOTONIC in the recorded run, ns.
        versions: Versions of Python, slipd and its libraries in the recorded run.
        first: Index of its first entry in the run.
        closed: Whether the file was closed in good order, by its last bytes.
        fault: Why a pass ended early; None if no pass did.
        stopped: The file is whole, and states itself that it ends before the run did.
        lost: Number of entries that a pass found missing, as far as it can tell.
        size_bytes: Size of the file when the present pass began; 0 before the first.
        read_bytes: How much of it that pass has read.
    """

    path: Path
    config_text: str
    boot: str
    wall_minus_monotonic_ns: int
    versions: dict[str, str]
    first: int
    closed: bool
    fault: str | None = None
    stopped: bool = False
    lost: int = 0
    size_bytes: int = 0
    read_bytes: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing is missing; faults within the file are known only after a pass."""
        return self.closed and self.fault is None and self.lost == 0

    @property
    def missing(self) -> str:
        """What is missing, for people, after a pass; "" where nothing is."""
        if self.complete:
            return ""
        lost = f"{self.lost} entries were lost while recording" if self.lost else "the end is missing"
        return self.fault or f"{self.path}: {lost}"

    def settings(self) -> Config:
        """Return the config of the recorded run.

        Raises:
            ConfigError: It has faults (for this version of slipd).
        """
        return parse(self.config_text, f"{self.path}: config")

    def events(self) -> Iterator[tuple[int, Event]]:
        """Yield ``(t_ns, event)`` of every event, in the order in which they entered the engine."""
        return ((t_ns, content) for _, t_ns, _, content in self.entries() if not isinstance(content, bytes))

    def messages(self, on_event: Callable[[int], object] = lambda _: None) -> Iterator[tuple[str, bytes]]:
        """Yield ``(topic, payload)`` of every published message, in the order in which they were published.

        Events are not decoded, so damage that only their own checksums show stays unnoticed.

        Args:
            on_event: Called with the time of each event, ns, before the messages that it caused are yielded.
        """
        for _, t_ns, topic, content in self.entries(decode=False):
            if isinstance(content, bytes):
                yield topic, content
            else:
                on_event(t_ns)

    def entries(self, *, decode: bool = True) -> Iterator[Entry]:
        """Yield events and messages in their total order, up to the first that cannot be read.

        Args:
            decode: Whether events are decoded, which takes more than half of a pass; otherwise ticks stand for them.

        Raises:
            RecordingError: The file cannot be opened.
        """
        walk = EntryWalk(self.wall_minus_monotonic_ns, self.first, decode=decode)
        try:
            with open_mcap(self.path) as file:
                self.size_bytes = walk.file_bytes = os.fstat(file.fileno()).st_size
                for record in data_records(file):
                    self.read_bytes = file.tell()
                    yield from walk.items(record)
        except (DamageError, OSError) as error:
            walk.fault = str(error)
        finally:  # also of a pass that its caller ends early
            self.lost, self.stopped = max(self.lost, walk.lost), walk.stopped
        self.fault = self.fault or (walk.fault and f"{self.path}: {walk.fault}")


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


def _start(path: Path, records: Iterator[McapRecord], *, closed: bool) -> Recording:
    start, config = next(records, None), next(records, None)
    if not isinstance(start, Metadata) or start.name != mcap_file.START or not isinstance(config, Attachment):
        raise DamageError("is cut off or damaged before its config, so nothing can be read")
    metadata = start.metadata
    if metadata.get("format") != mcap_file.FORMAT:
        raise DamageError(f"must have format {mcap_file.FORMAT!r}, got {metadata.get('format')!r}")
    try:
        config_text = config.data.decode()
        if metadata.pop(mcap_file.CRC32, "") != mcap_file.checksum(metadata, config_text):
            raise DamageError("its start is damaged: config and boot do not match their checksum")
        wall_minus_monotonic_ns = int(metadata.pop("wall_minus_monotonic_ns"))
        boot = metadata.pop("boot")
        first = int(metadata.pop(mcap_file.FIRST, "0"))
        del metadata["format"]
    except (ValueError, KeyError) as error:
        raise DamageError(f"its start is damaged: {error}") from error
    return Recording(path, config_text, boot, wall_minus_monotonic_ns, metadata, first, closed)
