"""``slipd recover``: writes what can be read of a damaged recording as a complete file, and reports the rest.

A reader of recordings stops at the first fault. This one searches behind it for the next chunk that is intact by its
checksum.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import fields, replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import msgpack
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from mcap.writer import MCAP0_MAGIC

from slipd.errors import RecordingError
from slipd.events import Bytes, Tick
from slipd.io.progress import Progress
from slipd.recording.entry_walk import Entry, EntryWalk
from slipd.recording.mcap_file import STOPPED, RecordingFile, RunHead
from slipd.recording.mcap_records import BAD_RECORD, HEAD, RECORD_LIMIT_BYTES, DamageError, inner_records, unpack_chunk
from slipd.recording.reader import Recording, open_recording
from slipd.tools.outputs import NEW, draft
from slipd_client.diagnose import without_secrets as without_secrets_of

_MARK = re.compile(rb"\x06.{36}\x04\0\0\0zstd|\x0c.{8}\x09\0\0\0slipd/end", re.DOTALL)
"""What every chunk and every end record of slipd begins with: its kind, some numbers, and a text with its length."""

_FOOTER = struct.Struct("<BQQQI")  # kind, length, place of the summary, of its offsets, CRC-32 of both
_CRC_BYTES = 4


def recover_command(source: Path, out: Path, *, without_secrets: bool) -> None:
    """Recover a recording, and print what is missing; errors are those of `recover`."""
    clean = without_secrets_of if without_secrets else str
    with Progress(lambda done, of: f"{100 * done // max(of, 1)} % of the recording").shown() as show:
        found = recover(source, out, clean, show)
    for fault in found.faults:
        print(f"{source}: {fault}")
    lost = f"{found.lost} known to be missing" if found.lost or found.faults else "nothing was missing"
    print(f"{out}: {found.entries} entries, {lost}")


def recover(
    source: Path,
    out: Path,
    clean: Callable[[str], str] = str,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Recovered:
    """Write every intact entry of a recording to a new, complete file.

    Args:
        source: The recording; it is only read.
        out: The new file. It states as missing what is missing in the source.
        clean: Returns what to write for the config, and for each text of an event or message.
        progress: Called with how much of the source is read, and its size, bytes.

    Raises:
        RecordingError: The source is no recording, or its start or all of its entries are damaged.
        SlipdError: ``out`` exists or cannot be written; nothing is written then.
    """
    recording = open_recording(source)
    with (
        draft(out, NEW, [source]) as written,
        source.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
    ):
        found = Recovered(data, recording)
        text, wall_ns = clean(recording.config_text), recording.wall_minus_monotonic_ns
        head = RunHead(text, recording.boot, wall_ns, recording.versions)
        new = RecordingFile(written, head, first=recording.first)
        cleaned = None if clean is str else _cleaning(lru_cache(maxsize=10_000)(clean))
        with closing(new):
            for entry in found.read():
                new.add(*(entry if cleaned is None else cleaned(entry)))
                progress(found.read_up_to, len(data))
            if not found.entries:
                raise RecordingError(f"{source}: holds no entry that is intact; {'; '.join(found.faults)}")
            new.finish(found.end, found.stopped)
        entries_read = sum(1 for _ in open_recording(written).entries())  # a disk may keep less than it was given
        if entries_read != found.entries:
            raise RecordingError(
                f"{out}: has {entries_read} entries after {found.entries} were written: the disk failed"
            )
    return found


def _cleaning(clean: Callable[[str], str]) -> Callable[[Entry], Entry]:
    """Return what returns an entry with all its texts cleaned."""

    def cleaned(value: Any) -> Any:
        if isinstance(value, str):
            return clean(value)
        if isinstance(value, dict):
            return {key: cleaned(each) for key, each in value.items()}
        if isinstance(value, list):
            return [cleaned(each) for each in value]
        return value

    def cleaned_entry(entry: Entry) -> Entry:
        content: Any = entry.content
        if isinstance(content, (Bytes, Tick)):  # without texts
            return entry
        if isinstance(content, bytes):
            return entry._replace(content=msgpack.packb(cleaned(msgpack.unpackb(content))))
        texts = {each.name: cleaned(getattr(content, each.name)) for each in fields(content)}
        return entry._replace(content=replace(content, **texts))

    return cleaned_entry


class Recovered:
    """What is recovered of a file, by one pass over its intact records.

    Args:
        data: The file.
        recording: Its start.

    Attributes:
        entries: Number of intact entries so far.
        lost: Number of entries known to be missing.
        faults: What is missing or damaged, and where in the file; one line each.
        end: Index behind the last entry, missing ones included.
        stopped: Why entries are missing at the end; "" where none is.
        read_up_to: Place behind the newest intact record.
    """

    def __init__(self, data: mmap.mmap, recording: Recording) -> None:
        self.entries = self.lost = self.read_up_to = 0
        self.faults: list[str] = []
        self.end, self.stopped = recording.first, ""
        self._data = data
        self._walk = EntryWalk(recording.wall_minus_monotonic_ns, recording.first)
        self._walk.file_bytes = len(data)
        self._begin_ns = self._last_ns = 0

    def read(self) -> Iterator[Entry]:
        """Yield every intact entry, in order."""
        for body in _summary_channels(self._data):
            self._walk.announce(body)
        for place, end, record in _intact_records(self._data, self.faults):
            if isinstance(record, Metadata):
                if self._end(place, record):
                    return
            else:
                yield from self._chunk(place, record)
            self.read_up_to = end
        size = len(self._data)
        self.stopped = f"recovered from a file of {size} bytes without an end record"
        text = f"from byte {self.read_up_to} of {size}: the end is missing; how many entries it held is not known"
        self.faults.append(text)

    def _chunk(self, place: int, chunk: Chunk) -> Iterator[Entry]:
        try:
            for entry in map(Entry._make, self._walk.items(chunk)):
                if self.entries == 0:
                    self._begin_ns = self._last_ns = entry.t_ns
                if entry.n > self.end:
                    self._report_gap(place, entry.n, f" up to {(entry.t_ns - self._begin_ns) * 1e-9:.3f} s")
                self.end, self._last_ns = entry.n + 1, entry.t_ns
                self.entries += 1
                yield entry
        except DamageError as error:
            self.faults.append(f"chunk at byte {place}: the file {error}")

    def _end(self, place: int, record: Metadata) -> bool:
        """Read the end record; return whether it is intact."""
        try:
            list(self._walk.items(record))
        except DamageError as error:
            self.faults.append(f"at byte {place}: {error}")
            return False
        if self._walk.next_n > self.end:
            self._report_gap(place, self._walk.next_n, "")
        self.end, self.stopped = self._walk.next_n, record.metadata.get(STOPPED, "")
        if self.stopped:
            self.faults.append(f"at byte {place}: the recording stopped before the run did ({self.stopped})")
        return True

    def _report_gap(self, place: int, n: int, until: str) -> None:
        missing = n - self.end
        self.lost += missing
        where = "lost while recording" if self._adjoin(place) else f"bytes {self.read_up_to} to {place} are damaged"
        since = f"from {(self._last_ns - self._begin_ns) * 1e-9:.3f} s{until}"
        self.faults.append(f"{missing} entries are missing, {since}: {where}")

    def _adjoin(self, place: int) -> bool:
        """Return whether nothing but indexes is between the last intact chunk and this one."""
        at = self.read_up_to
        while at + HEAD.size <= place and self._data[at] == Opcode.MESSAGE_INDEX:
            at += HEAD.size + HEAD.unpack_from(self._data, at)[1]
        return at == place


def _intact_records(data: mmap.mmap, faults: list[str]) -> Iterator[tuple[int, int, Chunk | Metadata]]:
    """Yield first byte, last byte + 1 and content of every intact chunk and end record; note the damaged ones."""
    place = 0
    while (mark := _MARK.search(data, place)) is not None:
        place, kind = mark.start(), Opcode(mark[0][0])
        end = place + HEAD.size + HEAD.unpack_from(data, place)[1]
        record = _record(data, place, end, kind)
        if record is not None:
            yield place, end, record
            place = end
        else:
            if end <= len(data):
                faults.append(f"at byte {place}: a {kind.name.lower()} record is damaged")
            place += 1


def _record(data: mmap.mmap, place: int, end: int, kind: Opcode) -> Chunk | Metadata | None:
    """Return a record; None where it is damaged or cut off."""
    if end > min(len(data), place + HEAD.size + RECORD_LIMIT_BYTES):
        return None
    body = ReadDataStream(BytesIO(data[place + HEAD.size : end]))
    try:
        if kind == Opcode.METADATA:
            metadata: Metadata = Metadata.read(body)
            return metadata
        chunk: Chunk = Chunk.read(body)
        unpack_chunk(chunk)
    except (*BAD_RECORD, DamageError):
        return None
    return chunk


def _summary_channels(data: mmap.mmap) -> list[bytes]:
    """Return the channels that the summary of a closed file repeats; none if it is damaged."""
    place = len(data) - len(MCAP0_MAGIC) - _FOOTER.size
    _, _, start, _, crc = _FOOTER.unpack_from(data, place)
    if not 0 < start < place or zlib.crc32(data[start : place + _FOOTER.size - _CRC_BYTES]) != crc:
        return []
    found: list[bytes] = []
    with suppress(DamageError):  # other records follow the channels
        for opcode, body in inner_records(data[start:place]):
            if opcode == Opcode.CHANNEL:
                found.append(body)
    return found
