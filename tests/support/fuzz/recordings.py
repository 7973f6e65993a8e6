"""Cut off and damage recordings at every place: what is read must be what was written, up to the fault."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import TypeVar
from unittest.mock import patch

from mcap.records import Chunk
from project import DATA

from slipd.errors import RecordingError
from slipd.recording import entry_walk
from slipd.recording.entry_walk import Entered, Published
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import Recording, open_recording

SOURCE = DATA / "replays" / "demo.mcap"
SMALL_BYTES = 20_000
FLUSH_EVERY = 20
"""Entries in a chunk: about as many as the daemon writes between two flushes."""

Entry = Entered | Published
Argument = TypeVar("Argument")
Result = TypeVar("Result")


@dataclass
class Damaged:
    """What reading damaged copies of one recording gave.

    Attributes:
        copies: Number of copies.
        refused: Copies that could not be opened.
        ended: Copies that were read up to the fault, and called incomplete.
        harmless: Copies that read as the whole recording.
        misread: What else was read, one line for each copy.
    """

    copies: int = 0
    refused: int = 0
    ended: int = 0
    harmless: int = 0
    misread: list[str] = field(default_factory=list)


def write_recording(path: Path, size: int) -> None:
    """Write entries of the demo, again and again, until the file has a size, bytes."""
    source = open_recording(SOURCE)
    file = RecordingFile(
        path, config_text=source.config_text, boot=source.boot, wall_minus_monotonic_ns=source.wall_minus_monotonic_ns
    )
    n = 0
    while file.size_bytes < size:
        for entry in source.entries():
            if isinstance(entry, Entered):
                file.event(n, entry.t_ns, entry.event)
            else:
                file.published(n, entry.t_ns, entry.topic, entry.payload)
            n += 1
            if n % FLUSH_EVERY == 0:
                file.flush()
                if file.size_bytes >= size:
                    break
    file.finish(n)


class Judge:
    """Reads copies of a recording, and compares them with it.

    Args:
        path: The recording.
        folder: Folder for the copies.
    """

    def __init__(self, path: Path, folder: Path) -> None:
        self.data = path.read_bytes()
        whole = open_recording(path)
        self._entries, self._about = list(whole.entries()), _about(whole)
        self._copy = folder / f"damaged-{path.stem}.mcap"

    def cut(self, places: range | list[int]) -> Damaged:
        """Read copies that end before each of some bytes."""
        found = Damaged()
        for place in places:
            self._judge(self.data[:place], f"cut at {place}", found, cut=True)
        return found

    def flip(self, places: range | list[int], seed: int) -> Damaged:
        """Read copies in which one byte is another: any value, all bits flipped, and one bit flipped."""
        found, rng = Damaged(), Random(seed)
        for place in places:
            for change in (rng.randrange(1, 0xFF), 0xFF, 1 << rng.randrange(8)):
                data = bytearray(self.data)
                data[place] ^= change
                self._judge(bytes(data), f"byte {place} ^ {change:#04x}", found, cut=False)
        return found

    def _judge(self, data: bytes, what: str, found: Damaged, *, cut: bool) -> None:
        self._copy.write_bytes(data)
        found.copies += 1
        try:
            recording = open_recording(self._copy)
            number = 0
            for entry in recording.entries():
                if number == len(self._entries) or entry != self._entries[number]:
                    found.misread.append(f"{what}: entry {number} is another")
                    return
                number += 1
        except RecordingError:
            found.refused += 1
            return
        whole = number == len(self._entries)
        if _about(recording) != self._about:
            found.misread.append(f"{what}: another config, boot or time")
        elif recording.complete and not (whole and not cut):
            found.misread.append(f"{what}: called complete with {number} entries")
        elif recording.complete:
            found.harmless += 1
        else:
            found.ended += 1


@contextmanager
def unchanged_bytes_decoded_once() -> Iterator[None]:
    """Remember what undamaged bytes decode to: thousands of copies share most of theirs, and the decoders are pure."""
    with (
        patch.object(entry_walk, "unpack_chunk", _remembering(entry_walk.unpack_chunk, _all_of_it)),
        patch.object(entry_walk, "decode_event", _remembering(entry_walk.decode_event, bytes)),
    ):
        yield


def _all_of_it(chunk: Chunk) -> tuple[object, ...]:
    return chunk.data, chunk.compression, chunk.uncompressed_size, chunk.uncompressed_crc


def _remembering(
    function: Callable[[Argument], Result], key: Callable[[Argument], Hashable]
) -> Callable[[Argument], Result]:
    known: dict[Hashable, Result] = {}

    def remembered(argument: Argument) -> Result:
        name = key(argument)
        if name not in known:
            known[name] = function(argument)
        return known[name]

    return remembered


def _about(recording: Recording) -> tuple[object, ...]:
    return recording.config_text, recording.boot, recording.wall_minus_monotonic_ns, recording.versions
