"""Output of an MCAP writer: unbuffered, cut back to the last complete record, with a small index of its chunks."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import Writer

BLOCK_CHUNKS = 256
"""Chunks whose entries are compressed together."""


class RecordStream:
    """A new file, written record by record.

    Nothing is buffered here, so no part of a failed record can reach the file later.

    Args:
        path: File to create; an existing one is never overwritten.

    Raises:
        OSError: The file exists or cannot be created. All methods except `cut_back`, `remove` and `close` raise it when
            the disk fails.
    """

    def __init__(self, path: Path) -> None:
        # A device file exists already, and holds nothing that could be lost.
        self._file = path.open("wb" if path.is_char_device() else "xb", buffering=0)
        self._path = path
        self._written = self._whole = 0

    def write(self, data: bytes) -> int:
        """Write all of ``data``; a disk that is nearly full may take only a part at first."""
        rest = memoryview(data)
        while rest:
            count = self._file.write(rest) or 0
            self._written += count
            rest = rest[count:]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._written

    def flush(self) -> None:
        """Mark everything written so far as complete records; the kernel has them already."""
        self._whole = self._written

    def sync(self) -> None:
        """Pass everything to the disk, so that it survives a power cut; a file that was deleted is a failed disk."""
        os.fdatasync(self._file.fileno())
        if not os.fstat(self._file.fileno()).st_nlink:
            raise OSError(errno.ENOENT, "the file was deleted while it was written")

    def free_bytes(self) -> int:
        """Return the free space of the disk, bytes."""
        found = os.fstatvfs(self._file.fileno())
        return found.f_bavail * found.f_frsize

    def cut_back(self) -> None:
        """Remove everything after the last `flush`; leave a device file unchanged."""
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._whole)
            self._file.seek(self._whole)
        self._written = self._whole

    def remove(self) -> None:
        """Remove the file from its folder."""
        with suppress(OSError):
            if not self._path.is_char_device():
                self._path.unlink()

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            self._file.close()


class PackedIndex:
    """Entries of the index as bytes, which the library writes one after another."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def write(self, stream: RecordBuilder) -> None:
        """Write them."""
        stream.write(self._data)


class PackedChunkIndices:
    """Keeps the index of the chunks small until it is written at the end.

    The library keeps an object for each chunk, about 1 kB, and the recorder writes fourteen chunks a second. This takes
    the place of its list, of which it uses `append` and iteration.
    """

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
