"""The index of the chunks of a recording, kept small until it is written at the end.

The library keeps an object for each chunk, about 1 kB, and the recorder writes fourteen chunks a second.
"""

from __future__ import annotations

from collections.abc import Iterator

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import Writer

BLOCK_CHUNKS = 256
"""Chunks whose entries are compressed together."""


class PackedIndex:
    """Entries of the index as bytes, which the library writes one after another."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def write(self, stream: RecordBuilder) -> None:
        """Write them."""
        stream.write(self._data)


class PackedChunkIndices:
    """Takes the place of the list of the library, of which it uses `append` and iteration."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._open: list[bytes] = []

    def append(self, index: ChunkIndex) -> None:
        """Add the entry of a chunk."""
        builder = RecordBuilder()
        index.write(builder)
        self._open.append(bytes(builder.end()))  # type: ignore[no-untyped-call]
        if len(self._open) == BLOCK_CHUNKS:
            self._blocks.append(trimmed(zstandard.compress(b"".join(self._open), level=1)))
            self._open = []

    def __iter__(self) -> Iterator[PackedIndex]:
        """Yield all entries, in order."""
        for block in self._blocks:
            yield PackedIndex(zstandard.decompress(block))
        yield PackedIndex(b"".join(self._open))


def trimmed(data: bytes) -> bytes:
    """Return a copy that takes only its own size; compressed bytes keep the memory of the largest possible result."""
    return bytes(memoryview(data))


def keep_index_packed(writer: Writer) -> None:
    """Let a writer without chunks keep its index packed."""
    writer._Writer__chunk_indices = PackedChunkIndices()  # type: ignore[attr-defined]  # noqa: SLF001 - no public way
